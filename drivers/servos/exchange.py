"""Request-reply transactions with servos: every reply is checked for sender and length, in any protocol."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Generic, NamedTuple, Protocol, TypeVar

from drivers.packets.framing import FrameReader
from drivers.packets.packet import BROADCAST_ID, Instruction
from drivers.servos.port import Port

_LATE_CHUNKS = 16


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
    missing : ids that were addressed and are not in ``replies``.
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
        """The packet of an instruction."""

    @abstractmethod
    def hello(self, port: Port, servo: int) -> Exchange[R]:
        """Send the greeting, a request whose reply has a unique length. The servo may be in ``port.suspects``."""

    @abstractmethod
    def _read_asked(self, port: Port, ids: tuple[int, ...], address: int, size: int, manner: str) -> Exchange[R]:
        """Read the same registers of servos that owe no reply; parameters as for :meth:`read_group`."""

    # ------------------------------------------------------------------ one servo

    def number(self, value: int) -> bytes:
        """An address or a length, as packets carry it."""
        return value.to_bytes(self.number_size, "little")

    def send(self, port: Port, frame: bytes) -> None:
        """Clear the input and send one packet; the port stays in use until the reply was taken."""
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
        """One instruction to one servo and its reply of ``length`` data bytes.

        A servo that missed a deadline must first answer a greeting: its replies come in order, so a late one has
        arrived by then. A reply with as many bytes as the one to a greeting cannot be distinguished from a late one.
        """
        if servo in port.suspects and code != self.greeting and not self.revive(port, servo):
            return Exchange({}, (servo,), False)
        return self.exchange(port, self.encode(servo, code, params), {servo: length})

    def read(self, port: Port, servo: int, address: int, size: int) -> Exchange[R]:
        """``size`` bytes of registers of one servo."""
        return self.ask(port, servo, Instruction.READ, self.number(address) + self.number(size), size)

    def write(self, port: Port, servo: int, address: int, data: bytes) -> Exchange[R]:
        """Write registers of one servo and wait for its status."""
        return self.ask(port, servo, Instruction.WRITE, self.number(address) + data, 0)

    def revive(self, port: Port, servo: int) -> bool:
        """Greet a servo that missed a deadline; True when it answers again."""
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
        got = self._read_asked(port, asked, address, size, manner)
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
        head, step = self.number(address) + self.number(size), self._rows_at_most(width) * width
        parts = (rows[at : at + step] for at in range(0, len(rows), step))
        return [self.encode(BROADCAST_ID, Instruction.SYNC_WRITE, head + part) for part in parts]

    def _rows_at_most(self, width: int) -> int:
        """Rows of so many bytes that one sync write carries; by default as many as there can be servos."""
        return BROADCAST_ID

    # ------------------------------------------------------------------ on the wire

    def exchange(self, port: Port, frame: bytes, wanted: Mapping[int, int]) -> Exchange[R]:
        """Send a packet and collect the replies; `wanted`: data bytes expected by servo id, in the replies' order."""
        size = len(wanted) * self.status_size + sum(wanted.values())
        port.suspects.update(wanted)  # until they have answered, so also when this is interrupted
        self.send(port, frame)
        try:
            port.expect(size)
            data = self._fill(port, size)
            if len(wanted) == 1 and len(data) == size:
                port.note_delay(size)
            return self._sort(port, wanted, data)
        finally:
            port.is_using = False

    def _fill(self, port: Port, size: int) -> bytes:
        """Received bytes, at least ``size`` of them unless the deadline passes."""
        data = more = port.link.read(port.deadline_s)
        while more and len(data) < size:
            more = port.link.read(port.deadline_s)
            data += more
        return data

    def _sort(self, port: Port, wanted: Mapping[int, int], data: bytes) -> Exchange[R]:
        """The replies in ``data`` and in what still arrives, whatever lies between them."""
        reader, box, late = self.reader(), _Sorter[R](wanted, self.refusals), 0
        box.take(reader.feed(data))
        while len(box.replies) < len(wanted) and late < _LATE_CHUNKS:
            data = port.link.read(port.deadline_s)
            if not data:
                box.take(reader.flush())
                break
            late += port.clock() > port.deadline_s
            box.take(reader.feed(data))
        port.stray += box.stray
        return settled(port, wanted, box.unique(), bool(reader.broken_frames or reader.noise_bytes or box.twice))


class _Sorter(Generic[R]):
    """Sorts replies into requested ones and strays; two under one id are both discarded.

    `wanted` holds the data bytes expected by servo id, `refusals` the error bits with which a reply may lack them.
    """

    def __init__(self, wanted: Mapping[int, int], refusals: int) -> None:
        self._wanted, self._refusals = wanted, refusals
        self.replies: dict[int, R] = {}
        self.twice: set[int] = set()
        self.stray = 0

    def take(self, arrived: Sequence[R]) -> None:
        """Sort some more."""
        for reply in arrived:
            length = self._wanted.get(reply.id)
            refused = reply.error & self._refusals and not reply.params
            if length is None or (len(reply.params) != length and not refused):
                self.stray += 1
            elif self.replies.setdefault(reply.id, reply) is not reply:
                self.stray += 1 if reply.id in self.twice else 2  # the one that was kept first is a stray, too
                self.twice.add(reply.id)

    def unique(self) -> dict[int, R]:
        """Replies that came once."""
        return {servo: reply for servo, reply in self.replies.items() if servo not in self.twice}


def settled(port: Port, wanted: Mapping[int, int], replies: dict[int, R], corrupt: bool) -> Exchange[R]:
    """The exchange of these replies; servos without one stay suspects."""
    missing = tuple(servo for servo in wanted if servo not in replies)
    port.suspects.difference_update(replies)
    return Exchange(replies, missing, corrupt and bool(missing))
