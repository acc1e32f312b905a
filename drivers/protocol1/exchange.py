"""Questions and answers on a wire with Protocol 1.0 framing, every answer checked for sender and length."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple, Protocol

from drivers.packets.packet1 import BROADCAST_ID, HEADER, Error1, Instruction1, Packet1, Reader1, checksum, encode
from drivers.port.serialport import SerialPort
from drivers.protocol1 import HELLO

STATUS_SIZE = 6
_LATE_CHUNKS = 16


class WirePort(Protocol):
    """What a port must have: `suspects` are the servos that owe an answer, `stray` counts what nobody asked for."""

    link: SerialPort
    baudrate: int
    deadline_s: float
    suspects: set[int]
    stray: int
    is_using: bool

    def clearPort(self) -> None:
        """Throw away all input."""

    def transmit(self, packet: bytes) -> None:
        """Hand bytes to the system, and keep count of when the last of them will have left."""

    def expect(self, size: int) -> None:
        """Set ``deadline_s`` for so many bytes of reply to what was sent."""


class Exchange(NamedTuple):
    """What came back for one question.

    Attributes
    ----------
    replies : by servo id; only those with the right sender, length and checksum.
    missing : ids that were asked and are not in ``replies``.
    corrupt : True when damaged bytes arrived too, so that a missing reply may have been one of them.
    """

    replies: dict[int, Packet1]
    missing: tuple[int, ...]
    corrupt: bool


class Exchanges:
    """Transactions of a driver.

    Attributes
    ----------
    longest : longest packet, in bytes, that its servos take.
    refusals : flags of the error byte that say why an instruction was refused; the others are about the servo.
    """

    longest = 250
    refusals = Error1.NONE

    def send(self, port: WirePort, frame: bytes) -> None:
        """Clear the input and send one packet; the port stays in use until the reply was taken."""
        port.is_using = True
        try:
            port.clearPort()
            port.transmit(frame)
        except BaseException:
            port.is_using = False
            raise

    def tell(self, port: WirePort, frame: bytes) -> None:
        """Send one packet whose answer nobody waits for."""
        self.send(port, frame)
        port.is_using = False

    def ask(self, port: WirePort, servo: int, code: int, params: bytes, length: int) -> Exchange:
        """One instruction to one servo and its reply of `length` data bytes; a suspect must answer a hello first."""
        if servo in port.suspects and not self.revive(port, servo):
            return Exchange({}, (servo,), False)
        return self.exchange(port, encode(servo, code, params), {servo: length})

    def hello(self, port: WirePort, servo: int) -> Exchange:
        """Ask a servo for the first ``HELLO`` bytes of its registers."""
        return self.exchange(port, _read_frame(servo, 0, HELLO), {servo: HELLO})

    def revive(self, port: WirePort, servo: int) -> bool:
        """Greet a servo that missed its time; True when it is in step again."""
        return not self.hello(port, servo).missing

    def pings(self, port: WirePort, servo: int) -> bool:
        """Whether a servo answers a ping, which it does even when it may answer nothing else.

        An answer with the error flags 1 looks like the ping itself and counts as an echo of it.
        """
        frame = encode(servo, Instruction1.PING)
        got = self.exchange(port, frame, {servo: 0}).replies.get(servo)
        return got is not None and got.code != Instruction1.PING

    def read_group(self, port: WirePort, ids: Sequence[int], address: int, size: int, manner: str) -> Exchange:
        """Read the same registers of many servos, keeping every reply that arrived.

        Suspects are not asked and count as missing until :meth:`revive` brought them back.

        Parameters
        ----------
        manner : ``"sync"`` (Feetech STS), ``"bulk"`` (Dynamixel MX), or ``""`` for one question each.
        """
        left_out = tuple(servo for servo in ids if servo in port.suspects)
        asked = tuple(servo for servo in ids if servo not in left_out)
        if not asked:
            return Exchange({}, left_out, False)
        if manner:
            got = self.exchange(port, _group_frame(asked, address, size, manner), dict.fromkeys(asked, size))
        else:
            got = self._read_singly(port, asked, address, size)
        return got._replace(missing=got.missing + left_out)

    def _read_singly(self, port: WirePort, ids: Sequence[int], address: int, size: int) -> Exchange:
        replies: dict[int, Packet1] = {}
        corrupt = False
        for servo in ids:
            got = self.exchange(port, _read_frame(servo, address, size), {servo: size})
            replies |= got.replies
            corrupt |= got.corrupt
        return Exchange(replies, tuple(servo for servo in ids if servo not in replies), corrupt)

    def write_group(self, port: WirePort, address: int, size: int, rows: bytes) -> None:
        """Sync writes, as many as the rows need, that nobody answers; parameters as for :meth:`group_frames`."""
        for frame in self.group_frames(address, size, rows):
            self.tell(port, frame)

    def group_frames(self, address: int, size: int, rows: bytes) -> list[bytes]:
        """Sync writes of some registers of many servos.

        Parameters
        ----------
        address, size : the registers.
        rows : for each servo its id and `size` bytes, one behind the other.

        Raises
        ------
        ValueError : `rows` does not hold whole rows.
        """
        width = size + 1
        if not rows or len(rows) % width:
            raise ValueError(f"rows: {len(rows)} bytes are not whole rows of 1 + {size}")
        step = (self.longest - 8) // width * width
        head = bytes((address, size))
        parts = (rows[at : at + step] for at in range(0, len(rows), step))
        return [encode(BROADCAST_ID, Instruction1.SYNC_WRITE, head + part) for part in parts]

    def exchange(self, port: WirePort, frame: bytes, wanted: Mapping[int, int]) -> Exchange:
        """Send a packet and collect the replies to it.

        Parameters
        ----------
        wanted : data bytes expected, by servo id, in the order of the replies.
        """
        size = len(wanted) * STATUS_SIZE + sum(wanted.values())
        port.suspects.update(wanted)  # until they have answered, so also when this is interrupted
        self.send(port, frame)
        try:
            port.expect(size)
            data = _fill(port.link, size, port.deadline_s)
            replies = _in_order(data, wanted) if len(data) == size else None
            if replies is not None:
                port.suspects.difference_update(replies)
                return Exchange(replies, (), False)
            return self._collect(port, wanted, data)
        finally:
            port.is_using = False

    def _collect(self, port: WirePort, wanted: Mapping[int, int], data: bytes) -> Exchange:
        """The replies in `data` and in what still comes, whatever lies between them."""
        reader, box, late = Reader1(), _Sorter(wanted, self.refusals), 0
        box.take(reader.feed(data))
        while len(box.replies) < len(wanted) and late < _LATE_CHUNKS:
            data = port.link.read(port.deadline_s)
            if not data:
                box.take(reader.flush())
                break
            late += port.link.clock() > port.deadline_s
            box.take(reader.feed(data))
        port.stray += box.stray
        replies = box.unique()
        port.suspects.difference_update(replies)
        missing = tuple(servo for servo in wanted if servo not in replies)
        damaged = bool(reader.broken_frames or reader.noise_bytes or box.twice)
        return Exchange(replies, missing, damaged and bool(missing))


class _Sorter:
    """Sorts packets into the replies asked for and strays; two of one servo are both worth nothing."""

    def __init__(self, wanted: Mapping[int, int], refusals: int) -> None:
        self._wanted, self._refusals = wanted, refusals
        self.replies: dict[int, Packet1] = {}
        self.twice: set[int] = set()
        self.stray = 0

    def take(self, arrived: list[Packet1]) -> None:
        """Sort some more."""
        for reply in arrived:
            length = self._wanted.get(reply.id)
            refused = bool(reply.code & self._refusals) and not reply.params
            if length is None or (len(reply.params) != length and not refused):
                self.stray += 1
            elif self.replies.setdefault(reply.id, reply) is not reply:
                self.twice.add(reply.id)
                self.stray += 2

    def unique(self) -> dict[int, Packet1]:
        """Replies that came once."""
        return {servo: reply for servo, reply in self.replies.items() if servo not in self.twice}


def _fill(link: SerialPort, size: int, deadline_s: float) -> bytes:
    """Received bytes, at least `size` of them unless the deadline passes."""
    data = link.read(deadline_s)
    while len(data) < size:
        more = link.read(deadline_s)
        if not more:
            break
        data += more
    return data


def _in_order(data: bytes, wanted: Mapping[int, int]) -> dict[int, Packet1] | None:
    """The usual case, quickly: exactly the replies asked for, in order. None when it is not that."""
    at, replies = 0, {}
    for servo, length in wanted.items():
        end = at + STATUS_SIZE + length
        body = data[at + 2 : end - 1]
        if data[at : at + 2] != HEADER or body[0] != servo or body[1] != length + 2:
            return None
        if checksum(body) != data[end - 1]:
            return None
        replies[servo] = Packet1(servo, body[2], body[3:])
        at = end
    return replies


@lru_cache(maxsize=1024)
def _read_frame(servo: int, address: int, size: int) -> bytes:
    return encode(servo, Instruction1.READ, bytes((address, size)))


@lru_cache(maxsize=256)
def _group_frame(ids: tuple[int, ...], address: int, size: int, manner: str) -> bytes:
    if manner == "sync":
        return encode(BROADCAST_ID, Instruction1.SYNC_READ, bytes((address, size, *ids)))
    entries = b"".join(bytes((size, servo, address)) for servo in ids)
    return encode(BROADCAST_ID, Instruction1.BULK_READ, b"\0" + entries)
