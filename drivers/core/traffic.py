"""Decoding of the bytes on a servo bus into readable lines, with registers and values by name.

A decoder takes the bytes of one port in the order in which they passed. On a wire that is only listened to, the
direction of a byte is unknown; it follows from the packets.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, ClassVar

from drivers.base.errors import DriverError
from drivers.packets import packet as v2
from drivers.packets import packet1 as v1
from drivers.packets.framing import FrameReader
from drivers.tables.tables import ControlTable, Item, load_table

TO, FROM = "->", "<-"
ARROWS = {True: TO, False: FROM, None: "--"}
MAX_NAMED = 8
"""Greatest number of servos of a group that a line names; for the others it gives their number."""


@dataclass
class ServoTraffic:
    """What was received from one servo.

    packets : number of answers. error : error byte of the last one.
    values : last value by register name, read or written.
    """

    packets: int = 0
    error: int = 0
    values: dict[str, int] = field(default_factory=dict)


class Decoder(ABC):
    """Decodes bytes to lines of text. ``heard`` : what was received from each servo, by id."""

    def __init__(self) -> None:
        self.heard: dict[int, ServoTraffic] = {}

    @abstractmethod
    def feed(self, sent: bool | None, data: bytes) -> list[str]:
        """Return the lines that ``data`` completes. sent : True: bytes of the host; False: replies; None: unknown."""


class PacketDecoder(Decoder):
    """Base of decoders of packet protocols: instructions, registers by name, values by servo.

    tables : control tables by id, as far as known; answers to pings add to them.
    default : table of all other servos, or None.
    """

    INSTRUCTIONS: ClassVar[type[IntEnum]]
    WORD: ClassVar[int]
    """Bytes of an address and of a size."""
    READER: ClassVar[type[FrameReader[Any]]]

    def __init__(self, tables: Mapping[int, ControlTable] = {}, default: ControlTable | None = None) -> None:
        super().__init__()
        self.tables, self._default = dict(tables), default
        self._readers = {True: self.READER(), False: self.READER()}
        self._asked: dict[int, tuple[int, int]] = {}
        self._group: list[tuple[int, int, int]] = []  # servo, address and size of each read of the last group

    def feed(self, sent: bool | None, data: bytes) -> list[str]:
        reader = self._readers[bool(sent)]
        before = reader.noise_bytes
        lines = [line for frame in reader.feed_frames(data) for line in self._frame(sent, frame)]
        noise = reader.noise_bytes - before
        return lines + ([f"?? {noise} bytes that are no packet"] if noise else [])

    @abstractmethod
    def _frame(self, sent: bool | None, frame: bytes) -> list[str]:
        """The lines that describe one frame. sent : as for :meth:`feed`."""

    def _count(self, servo: int, error: int) -> None:
        heard = self.heard.setdefault(servo, ServoTraffic())
        heard.packets += 1
        heard.error = error

    def _area(self, servo: int, address: int, size: int) -> str:
        """Name of an area: a register, or the first and last of several."""
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
        """Registers and their values as text; the values are also stored in ``heard``."""
        items = self._items(servo, address, len(data))
        if not items:
            return f"{len(data)} bytes at {address}: {data.hex(' ')}"
        values = {item.name: item.decode(data[item.address - address :]) for item in items}
        self.heard.setdefault(servo, ServoTraffic()).values.update(values)
        return ", ".join(f"{name} = {value}" for name, value in values.items())

    def _data(self, servo: int, data: bytes) -> str:
        """The data of an answer as text, decoded by the request that the servo answers."""
        address, size = self._asked.pop(servo, (-1, -1))
        if size == len(data):
            return self._values(servo, address, data)
        return data.hex(" ") if data else "ok"

    def _instruction(self, servo: int, code: int, params: bytes) -> str:
        name, head = _name(self.INSTRUCTIONS, code), 2 * self.WORD
        address, size = self._words(params)
        self._group = []
        if name in ("write", "reg write") and len(params) > self.WORD:
            text = self._values(servo, address, params[self.WORD :])
        elif name == "read" and len(params) == head:
            self._asked[servo] = address, size
            text = self._area(servo, address, size)
        elif name in ("sync read", "fast sync read") and len(params) > head:
            ids = list(params[head:])
            self._read_group([(each, address, size) for each in ids])
            text = f"{self._area(ids[0], address, size)} of {_limited(map(str, ids))}"
        elif name == "sync write" and len(params) > head:
            text = self._sync_write(address, size, params[head:])
        elif name in ("bulk read", "fast bulk read") and self.WORD == 2:
            rows = [params[at : at + 5] for at in range(0, len(params), 5)]
            self._read_group([(row[0], *self._words(row[1:])) for row in rows if len(row) == 5])
            text = _limited(f"{each}: {self._area(each, at, count)}" for each, at, count in self._group)
        else:
            text = params.hex(" ")
        return f"{name} {text}".rstrip()

    def _words(self, data: bytes) -> tuple[int, int]:
        """Address and size, with which the parameters of most instructions begin."""
        return int.from_bytes(data[: self.WORD], "little"), int.from_bytes(data[self.WORD : 2 * self.WORD], "little")

    def _read_group(self, group: list[tuple[int, int, int]]) -> None:
        self._group = group
        self._asked |= {servo: (address, size) for servo, address, size in group}

    def _sync_write(self, address: int, size: int, data: bytes) -> str:
        """A group write as text: the register once, then the value for each servo."""
        rows = [data[at : at + size + 1] for at in range(0, len(data), size + 1)]
        area = self._area(rows[0][0], address, size)
        values = [f"{row[0]}: {self._values(row[0], address, row[1:]).replace(f'{area} = ', '')}" for row in rows]
        return f"{area} of {_limited(values)}"


class Decoder2(PacketDecoder):
    """Dynamixel Protocol 2.0."""

    INSTRUCTIONS, WORD, READER = v2.Instruction, 2, v2.StatusReader

    def __init__(self, tables: Mapping[int, ControlTable] = {}, default: ControlTable | None = None) -> None:
        super().__init__(tables, default)
        self._pinged = False

    def _frame(self, sent: bool | None, frame: bytes) -> list[str]:
        servo, code = frame[4], frame[7]
        if code != v2.Instruction.STATUS:
            self._pinged = code == v2.Instruction.PING
            return [f"{TO} {_who(servo)} {self._instruction(servo, code, v2.unstuff(frame[8:-2]))}"]
        if servo != v2.BROADCAST_ID:
            return [self._status(servo, frame[8], v2.unstuff(frame[9:-2]))]
        replies = v2.decode_fast(frame, [(each, size) for each, _, size in self._group])
        self._group = []
        lines = [self._status(reply.id, reply.error, reply.params) for reply in replies]
        return lines or [f"{FROM} joint reply of {len(frame)} bytes"]

    def _status(self, servo: int, error: int, data: bytes) -> str:
        self._count(servo, error)
        number, alert = error & 0x7F, " ALERT" if error & v2.ALERT else ""
        if number:
            self._asked.pop(servo, None)
            return f"{FROM} {servo} refused: {_name(v2.ErrorNumber, number)}{alert}"
        if not self._pinged or servo in self._asked or len(data) != 3:
            return f"{FROM} {servo}{alert} {self._data(servo, data)}"
        model, firmware = int.from_bytes(data[:2], "little"), data[2]
        with suppress(DriverError):
            self.tables[servo] = load_table(model, firmware)
        table = self.tables.get(servo)
        return f"{FROM} {servo}{alert} is {table.model if table else f'model {model}'}, firmware {firmware}"


class Decoder1(PacketDecoder):
    """Protocol 1.0 framing: Dynamixel AX and MX, Feetech STS and SCS."""

    INSTRUCTIONS, WORD, READER = v1.Instruction1, 1, v1.Reader1

    def __init__(self, tables: Mapping[int, ControlTable] = {}, default: ControlTable | None = None) -> None:
        super().__init__(tables, default)
        self._waiting: list[int] = []

    def _frame(self, sent: bool | None, frame: bytes) -> list[str]:
        servo, code, params = frame[2], frame[4], frame[5:-1]
        is_answer = servo in self._waiting if sent is None else not sent
        if is_answer:
            if servo in self._waiting:
                self._waiting.remove(servo)
            self._count(servo, code)
            flags = " ".join(flag.name or "" for flag in v1.Error1 if flag and code & flag)
            error = f" {flags.lower().replace('_', ' ')}" if flags else ""
            return [f"{FROM} {servo}{error} {self._data(servo, params)}"]
        line = f"{TO} {_who(servo)} {self._instruction(servo, code, params)}"
        if self._group:
            self._waiting = [each for each, _, _ in self._group]
        elif servo != v1.BROADCAST_ID:
            self._waiting = [servo]
        return [line]


class TextDecoder(Decoder):
    """Boards that speak in lines of text: SSC-32, template boards, omote line protocol."""

    def __init__(self) -> None:
        super().__init__()
        self._rest = {True: b"", False: b""}

    def feed(self, sent: bool | None, data: bytes) -> list[str]:
        *lines, rest = (self._rest[bool(sent)] + data).replace(b"\r\n", b"\n").replace(b"\r", b"\n").split(b"\n")
        self._rest[bool(sent)] = rest
        return [f"{ARROWS[sent]} {line.decode('ascii', 'backslashreplace')}" for line in lines if line]


class HexDecoder(Decoder):
    """Bytes in hexadecimal, one line for each piece, for protocols without a decoder."""

    def feed(self, sent: bool | None, data: bytes) -> list[str]:
        return [f"{ARROWS[sent]} {data.hex(' ')}"]


def _who(servo: int) -> str:
    return "all" if servo == v2.BROADCAST_ID else str(servo)


def _name(names: type, code: int) -> str:
    with suppress(ValueError):
        return str(names(code).name).lower().replace("_", " ")
    return f"number {code}"


def _limited(texts: Iterable[str]) -> str:
    """The first texts, and how many more there are."""
    listed = list(texts)
    return ", ".join(listed[:MAX_NAMED]) + (f" and {len(listed) - MAX_NAMED} more" if len(listed) > MAX_NAMED else "")
