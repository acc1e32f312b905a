"""Request-reply transactions with servos: every reply is checked for sender and length, in any protocol."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Generic, NamedTuple, Protocol, TypeVar

from drivers.packets.framing import FrameReader
from drivers.packets.packet import BROADCAST_ID, Instruction
from drivers.servos.port import Port

_MAX_LATE_READS = 16


class Reply(Protocol):
    """A status packet: the servo's `id`, its `error` byte, and the data in `params`."""

    @property
    def id(self) -> int: ...

    @property
    def error(self) -> int: ...

    @property
    def params(self) -> bytes: ...


R = TypeVar("R", bound=Reply)


class Exchange(NamedTuple, Generic[R]):
    """The replies to one request.

    replies : by servo id; only those with the right sender, length and checksum.
    missing : ids of servos that should have answered and are not in ``replies``.
    corrupt : True when damaged bytes arrived too, so that a missing reply may have been one of them.
    joint_lost : True when no servo answered a fast read, also where the plain read after it was answered.
    """

    replies: dict[int, R]
    missing: tuple[int, ...]
    corrupt: bool
    joint_lost: bool = False


class Exchanges(ABC, Generic[R]):
    """Transactions of a driver; a protocol sets the attributes and implements the abstract methods.

    status_size : bytes of a reply without data.
    number_size : bytes of an address or a length in a packet.
    refusals : bits of the error byte that refuse the request, so that the reply may be without the requested data.
    reader : finds replies in received bytes.
    greeting : the instruction that a servo in ``port.suspects`` is asked first; -1 where that is a plain read.
    """

    status_size: ClassVar[int]
    number_size: ClassVar[int]
    refusals: ClassVar[int]
    reader: ClassVar[type[FrameReader[Any]]]
    greeting: ClassVar[int] = -1

    # ------------------------------------------------------------------ hooks

    @abstractmethod
    def encode(self, servo: int, code: int, params: bytes = b"") -> bytes:
        """Encode the packet of an instruction."""

    @abstractmethod
    def hello(self, port: Port, servo: int) -> Exchange[R]:
        """Send the greeting, a request whose reply has a unique length, also to a servo in ``port.suspects``."""

    @abstractmethod
    def _read_ready(self, port: Port, ids: tuple[int, ...], address: int, size: int, manner: str) -> Exchange[R]:
        """Read the same registers of servos that are not in ``port.suspects``; parameters as for :meth:`read_group`."""

    # ------------------------------------------------------------------ one servo

    def number(self, value: int) -> bytes:
        """Encode an address or a length as packets carry it."""
        return value.to_bytes(self.number_size, "little")

    def send(self, port: Port, frame: bytes) -> None:
        """Discard the input and send one packet; the caller ends the use of the port after the reply."""
        port.is_using = True
        try:
            port.clearPort()
            port.transmit(frame)
        except BaseException:
            port.is_using = False
            raise

    def send_only(self, port: Port, frame: bytes) -> None:
        """Send a packet, or several, that no servo answers."""
        port.is_using = True
        try:
            port.transmit(frame)
        finally:
            port.is_using = False

    def ask(self, port: Port, servo: int, code: int, params: bytes, length: int) -> Exchange[R]:
        """Send one instruction to one servo and receive its reply of ``length`` data bytes.

        A servo that missed a deadline must first answer a greeting: its replies come in order, so a late one has
        arrived by then. A reply with as many bytes as the one to a greeting cannot be distinguished from a late one.
        """
        if servo in port.suspects and code != self.greeting and not self.revive(port, servo):
            return Exchange({}, (servo,), False)
        return self.exchange(port, self.encode(servo, code, params), {servo: length})

    def read(self, port: Port, servo: int, address: int, size: int) -> Exchange[R]:
        """Read ``size`` bytes of registers of one servo."""
        return self.ask(port, servo, Instruction.READ, self.number(address) + self.number(size), size)

    def write(self, port: Port, servo: int, address: int, data: bytes) -> Exchange[R]:
        """Write registers of one servo and wait for its status."""
        return self.ask(port, servo, Instruction.WRITE, self.number(address) + data, 0)

    def revive(self, port: Port, servo: int) -> bool:
        """Greet a servo that missed a deadline; return whether it answers again."""
        return not self.hello(port, servo).missing

    # ------------------------------------------------------------------ many servos

    def read_group(self, port: Port, ids: Sequence[int], address: int, size: int, manner: str = "sync") -> Exchange[R]:
        """Read the same registers of many servos, keeping every reply that arrived.

        Servos in ``port.suspects`` are left out and count as missing until they answered :meth:`revive`. `manner` is
        the protocol's name of the kind of read, such as ``"sync"``.
        """
        left_out = tuple(servo for servo in ids if servo in port.suspects)
        asked = tuple(servo for servo in ids if servo not in left_out)
        if not asked:
            return Exchange({}, left_out, False)
        got = self._read_ready(port, asked, address, size, manner)
        return got._replace(missing=got.missing + left_out)

    def write_group(self, port: Port, address: int, size: int, rows: bytes) -> None:
        """Send the sync writes of :meth:`group_frames`, which no servo answers."""
        for frame in self.group_frames(address, size, rows):
            self.send_only(port, frame)

    def group_frames(self, address: int, size: int, rows: bytes) -> list[bytes]:
        """Sync writes of `size` bytes from `address` of many servos.

        `rows` holds for each servo its id and its bytes; raises ValueError where they are not whole rows.
        """
        width = size + 1
        if not rows or len(rows) % width:
            raise ValueError(f"rows: {len(rows)} bytes are not whole rows of 1 + {size}")
        head, step = self.number(address) + self.number(size), self._max_rows(width) * width
        parts = (rows[at : at + step] for at in range(0, len(rows), step))
        return [self.encode(BROADCAST_ID, Instruction.SYNC_WRITE, head + part) for part in parts]

    def _max_rows(self, width: int) -> int:
        """Greatest number of rows of ``width`` bytes in one sync write; by default one for every possible servo."""
        return BROADCAST_ID

    # ------------------------------------------------------------------ on the wire

    def exchange(self, port: Port, frame: bytes, wanted: Mapping[int, int]) -> Exchange[R]:
        """Send a packet and collect the replies; `wanted`: data bytes expected by servo id, in the replies' order."""
        size = len(wanted) * self.status_size + sum(wanted.values())
        port.suspects.update(wanted)  # removed by replies, so they stay when this is interrupted
        self.send(port, frame)
        try:
            port.expect(size)
            data = self._receive(port, size)
            if len(wanted) == 1 and len(data) == size:
                port.note_delay(size)
            return self._find_replies(port, wanted, data)
        finally:
            port.is_using = False

    def _receive(self, port: Port, size: int) -> bytes:
        """Receive bytes, at least ``size`` of them unless the deadline passes."""
        data = more = port.link.read(port.deadline_s)
        while more and len(data) < size:
            more = port.link.read(port.deadline_s)
            data += more
        return data

    def _find_replies(self, port: Port, wanted: Mapping[int, int], data: bytes) -> Exchange[R]:
        """Find the replies in ``data`` and, where some are missing, in what still arrives."""
        reader, sorter, late = self.reader(), _Sorter[R](wanted, self.refusals), 0
        sorter.take(reader.feed(data))
        while len(sorter.replies) < len(wanted) and late < _MAX_LATE_READS:
            data = port.link.read(port.deadline_s)
            if not data:
                sorter.take(reader.flush())
                break
            late += port.clock() > port.deadline_s
            sorter.take(reader.feed(data))
        port.stray += sorter.stray
        return finish_exchange(
            port, wanted, sorter.unique(), bool(reader.broken_frames or reader.noise_bytes or sorter.twice)
        )


class _Sorter(Generic[R]):
    """Separates requested replies from strays; two replies with one id are both discarded.

    `wanted` holds the data bytes expected by servo id, `refusals` the error bits with which a reply may lack them.
    """

    def __init__(self, wanted: Mapping[int, int], refusals: int) -> None:
        self._wanted, self._refusals = wanted, refusals
        self.replies: dict[int, R] = {}
        self.twice: set[int] = set()
        self.stray = 0

    def take(self, arrived: Sequence[R]) -> None:
        """Sort replies that arrived."""
        for reply in arrived:
            length = self._wanted.get(reply.id)
            refused = reply.error & self._refusals and not reply.params
            if length is None or (len(reply.params) != length and not refused):
                self.stray += 1
            elif self.replies.setdefault(reply.id, reply) is not reply:
                self.stray += 1 if reply.id in self.twice else 2  # the first one is discarded as well
                self.twice.add(reply.id)

    def unique(self) -> dict[int, R]:
        """Return the replies whose id came once."""
        return {servo: reply for servo, reply in self.replies.items() if servo not in self.twice}


def finish_exchange(port: Port, wanted: Mapping[int, int], replies: dict[int, R], corrupt: bool) -> Exchange[R]:
    """Return the result of an exchange; servos that replied are no longer suspects, the others stay so."""
    missing = tuple(servo for servo in wanted if servo not in replies)
    port.suspects.difference_update(replies)
    return Exchange(replies, missing, corrupt and bool(missing))
