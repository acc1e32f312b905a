"""Bytes of a servo bus as lines that people read: who said what to whom, by the registers' own names.

A decoder takes the bytes of one port in the order in which they passed, from either end. On a wire that is only
listened to nobody says which end sent a byte; the packets tell.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field

from drivers.base.errors import DriverError
from drivers.packets import packet as v2
from drivers.packets import packet1 as v1
from drivers.tables.tables import ControlTable, Item, load_table

TO, FROM = "->", "<-"
ARROWS = {True: TO, False: FROM, None: "--"}
MANY = 8
"""Servos of a group that a line names before it says how many more there are."""


@dataclass
class ServoTraffic:
    """What passed about one servo.

    Attributes
    ----------
    packets : answers heard. error : error byte of the last one.
    values : last value by register name, read or written.
    """

    packets: int = 0
    error: int = 0
    values: dict[str, int] = field(default_factory=dict)


class Decoder(ABC):
    """Turns bytes into lines and keeps what they say of each servo.

    Attributes
    ----------
    heard : what passed about each servo, by id.
    """

    def __init__(self) -> None:
        self.heard: dict[int, ServoTraffic] = {}

    @abstractmethod
    def feed(self, sent: bool | None, data: bytes) -> list[str]:
        """Lines completed by bytes.

        Parameters
        ----------
        sent : True where the host sent them, False where it received them, None where nobody knows.
        """


class PacketDecoder(Decoder):
    """What decoders of packet protocols share: registers by name, values by servo.

    Parameters
    ----------
    tables : control tables by id, as far as they are known; answers to pings add to them.
    default : table of all others, or None.
    """

    def __init__(self, tables: Mapping[int, ControlTable] = {}, default: ControlTable | None = None) -> None:
        super().__init__()
        self.tables, self._default = dict(tables), default
        self._asked: dict[int, tuple[int, int]] = {}

    def _said(self, servo: int, error: int) -> None:
        heard = self.heard.setdefault(servo, ServoTraffic())
        heard.packets += 1
        heard.error = error

    def _ask(self, servo: int, address: int, size: int) -> None:
        self._asked[servo] = (address, size)

    def _area(self, servo: int, address: int, size: int) -> str:
        """Name of what lies at an address: a register, or the first and last of several."""
        items = self._items(servo, address, size)
        if not items:
            return f"{size} bytes at {address}"
        first, last = items[0].name, items[-1].name
        return first if first == last else f"{first} .. {last}"

    def _items(self, servo: int, address: int, size: int) -> list[Item]:
        table = self.tables.get(servo, self._default)
        if table is None:
            return []
        return [item for item in table.values() if address <= item.address and item.end <= address + size]

    def _values(self, servo: int, address: int, data: bytes) -> str:
        """Registers and their values, kept and told."""
        items = self._items(servo, address, len(data))
        if not items:
            return f"{len(data)} bytes at {address}: {data.hex(' ')}"
        heard = self.heard.setdefault(servo, ServoTraffic())
        told = {item.name: item.decode(data[item.address - address :]) for item in items}
        heard.values.update(told)
        return ", ".join(f"{name} = {value}" for name, value in told.items())

    def _data(self, servo: int, data: bytes) -> str:
        address, size = self._asked.pop(servo, (-1, -1))
        if size == len(data):
            return self._values(servo, address, data)
        return data.hex(" ") if data else "ok"


class Decoder2(PacketDecoder):
    """Dynamixel Protocol 2.0."""

    def __init__(self, tables: Mapping[int, ControlTable] = {}, default: ControlTable | None = None) -> None:
        super().__init__(tables, default)
        self._readers = {True: v2.PacketReader(), False: v2.PacketReader()}
        self._fast: list[tuple[int, int, int]] = []
        self._pinged = False

    def feed(self, sent: bool | None, data: bytes) -> list[str]:
        """Lines completed by bytes."""
        reader = self._readers[bool(sent)]
        lost = reader.noise_bytes
        lines = [line for frame in reader.feed_frames(data) for line in self._frame(frame)]
        noise = reader.noise_bytes - lost
        return lines + ([f"?? {noise} bytes that are no packet"] if noise else [])

    def _frame(self, frame: bytes) -> list[str]:
        servo, code = frame[4], frame[7]
        if code != v2.Instruction.STATUS:
            return [f"{TO} {_who(servo)} {self._instruction(servo, code, v2.unstuff(frame[8:-2]))}"]
        if servo == v2.BROADCAST_ID:
            return self._joint(frame)
        return [self._status(servo, frame[8], v2.unstuff(frame[9:-2]))]

    def _status(self, servo: int, error: int, data: bytes) -> str:
        self._said(servo, error)
        number, alert = error & 0x7F, " ALERT" if error & v2.ALERT else ""
        if number:
            self._asked.pop(servo, None)
            return f"{FROM} {servo} refused: {_name(v2.ErrorNumber, number)}{alert}"
        return f"{FROM} {servo}{alert} {self._answer(servo, data)}"

    def _answer(self, servo: int, data: bytes) -> str:
        if self._pinged and servo not in self._asked and len(data) == 3:
            with suppress(DriverError):
                self.tables[servo] = load_table(data[0] | data[1] << 8, data[2])
            table = self.tables.get(servo)
            return f"is {table.model if table else f'model {data[0] | data[1] << 8}'}, firmware {data[2]}"
        return self._data(servo, data)

    def _joint(self, frame: bytes) -> list[str]:
        asked, self._fast = self._fast, []
        replies = v2.decode_fast(frame, [(servo, size) for servo, _, size in asked])
        lines = [self._status(reply.id, reply.error, reply.params) for reply in replies]
        return lines or [f"{FROM} joint reply of {len(frame)} bytes"]

    def _instruction(self, servo: int, code: int, params: bytes) -> str:
        self._pinged = code == v2.Instruction.PING
        word = _name(v2.Instruction, code)
        if code in (v2.Instruction.WRITE, v2.Instruction.REG_WRITE) and len(params) > 2:
            return f"{word} {self._values(servo, params[0] | params[1] << 8, params[2:])}"
        if code == v2.Instruction.READ and len(params) == 4:
            address, size = _words(params)
            self._ask(servo, address, size)
            return f"{word} {self._area(servo, address, size)}"
        if code in (v2.Instruction.SYNC_READ, v2.Instruction.FAST_SYNC_READ) and len(params) > 4:
            return f"{word} {self._group_read(code, params)}"
        if code == v2.Instruction.SYNC_WRITE and len(params) > 4:
            return f"{word} {self._group_write(params)}"
        if code in (v2.Instruction.BULK_READ, v2.Instruction.FAST_BULK_READ):
            return f"{word} {self._bulk_read(code, params)}"
        return f"{word} {params.hex(' ')}".rstrip()

    def _group_read(self, code: int, params: bytes) -> str:
        address, size = _words(params)
        ids = list(params[4:])
        for servo in ids:
            self._ask(servo, address, size)
        if code == v2.Instruction.FAST_SYNC_READ:
            self._fast = [(servo, address, size) for servo in ids]
        return f"{self._area(ids[0], address, size)} of {_ids(ids)}"

    def _group_write(self, params: bytes) -> str:
        address, size = _words(params)
        rows = [params[at : at + size + 1] for at in range(4, len(params), size + 1)]
        told = [f"{row[0]}: {self._values(row[0], address, row[1:])}" for row in rows]
        values = [text.replace(f"{self._area(rows[0][0], address, size)} = ", "") for text in told[:MANY]]
        return f"{self._area(rows[0][0], address, size)} of {', '.join(values)}{_more(len(told))}"

    def _bulk_read(self, code: int, params: bytes) -> str:
        rows = [params[at : at + 5] for at in range(0, len(params), 5)]
        asked = [(row[0], *_words(row[1:])) for row in rows if len(row) == 5]
        for servo, address, size in asked:
            self._ask(servo, address, size)
        if code == v2.Instruction.FAST_BULK_READ:
            self._fast = asked
        return ", ".join(f"{servo}: {self._area(servo, a, n)}" for servo, a, n in asked[:MANY]) + _more(len(asked))


class Decoder1(PacketDecoder):
    """Protocol 1.0 framing: Dynamixel AX and MX, Feetech STS and SCS."""

    def __init__(self, tables: Mapping[int, ControlTable] = {}, default: ControlTable | None = None) -> None:
        super().__init__(tables, default)
        self._readers = {True: v1.Reader1(), False: v1.Reader1()}
        self._waiting: list[int] = []

    def feed(self, sent: bool | None, data: bytes) -> list[str]:
        """Lines completed by bytes."""
        reader = self._readers[bool(sent)]
        lost = reader.noise_bytes
        lines = [self._packet(sent, packet) for packet in reader.feed(data)]
        noise = reader.noise_bytes - lost
        return lines + ([f"?? {noise} bytes that are no packet"] if noise else [])

    def _packet(self, sent: bool | None, packet: v1.Packet1) -> str:
        answers = packet.id in self._waiting if sent is None else not sent
        if answers:
            if packet.id in self._waiting:
                self._waiting.remove(packet.id)
            return self._status(packet)
        return f"{TO} {_who(packet.id)} {self._instruction(packet)}"

    def _status(self, packet: v1.Packet1) -> str:
        self._said(packet.id, packet.code)
        flags = " ".join(flag.name or "" for flag in v1.Error1 if flag and packet.code & flag)
        error = f" {flags.lower().replace('_', ' ')}" if flags else ""
        return f"{FROM} {packet.id}{error} {self._data(packet.id, packet.params)}"

    def _instruction(self, packet: v1.Packet1) -> str:
        code, params = packet.code, packet.params
        word = _name(v1.Instruction1, code)
        if packet.id != v1.BROADCAST_ID:
            self._waiting = [packet.id]
        if code in (v1.Instruction1.WRITE, v1.Instruction1.REG_WRITE) and len(params) > 1:
            return f"{word} {self._values(packet.id, params[0], params[1:])}"
        if code == v1.Instruction1.READ and len(params) == 2:
            self._ask(packet.id, params[0], params[1])
            return f"{word} {self._area(packet.id, params[0], params[1])}"
        if code == v1.Instruction1.SYNC_READ and len(params) > 2:
            return f"{word} {self._group_read(params)}"
        if code == v1.Instruction1.SYNC_WRITE and len(params) > 2:
            return f"{word} {self._group_write(params)}"
        return f"{word} {params.hex(' ')}".rstrip()

    def _group_read(self, params: bytes) -> str:
        ids = list(params[2:])
        for servo in ids:
            self._ask(servo, params[0], params[1])
        self._waiting = ids
        return f"{self._area(ids[0], params[0], params[1])} of {_ids(ids)}"

    def _group_write(self, params: bytes) -> str:
        address, size = params[0], params[1]
        rows = [params[at : at + size + 1] for at in range(2, len(params), size + 1)]
        told = [f"{row[0]}: {self._values(row[0], address, row[1:])}" for row in rows]
        return f"{', '.join(told[:MANY])}{_more(len(told))}"


class TextDecoder(Decoder):
    """Boards that speak in lines of text: SSC-32, template boards, omote line protocol."""

    def __init__(self) -> None:
        super().__init__()
        self._rest = {True: b"", False: b""}

    def feed(self, sent: bool | None, data: bytes) -> list[str]:
        """Lines completed by bytes."""
        *lines, rest = (self._rest[bool(sent)] + data).replace(b"\r\n", b"\n").replace(b"\r", b"\n").split(b"\n")
        self._rest[bool(sent)] = rest
        return [f"{ARROWS[sent]} {line.decode('ascii', 'backslashreplace')}" for line in lines if line]


class HexDecoder(Decoder):
    """Bytes as they are, for a protocol that no decoder knows."""

    def feed(self, sent: bool | None, data: bytes) -> list[str]:
        """One line a piece."""
        return [f"{ARROWS[sent]} {data.hex(' ')}"]


def _who(servo: int) -> str:
    return "all" if servo == v2.BROADCAST_ID else str(servo)


def _name(names: type, code: int) -> str:
    with suppress(ValueError):
        return str(names(code).name).lower().replace("_", " ")
    return f"number {code}"


def _words(data: bytes) -> tuple[int, int]:
    return data[0] | data[1] << 8, data[2] | data[3] << 8


def _ids(ids: Iterable[int]) -> str:
    listed = list(ids)
    return ", ".join(map(str, listed[:MANY])) + _more(len(listed))


def _more(count: int) -> str:
    return f" and {count - MANY} more" if count > MANY else ""
