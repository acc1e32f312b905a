"""Records of the traffic on a bus, as lines of text: the bytes on the wire, and the servos on it.

A log begins with lines ``# KEY = VALUE``, the first of which is ``# omote traffic = 1``. Each other line is the time in
seconds, ``>`` for bytes of the host, ``<`` for answers or ``-`` where a wire was only listened to, and the bytes in
hexadecimal. :mod:`drivers.core.pcapng` stores the same for network analysers.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from drivers.base.errors import DriverError

FORMAT = "1"
MAX_PIECES = 5_000_000
"""Greatest number of pieces of traffic in a record."""
_SIGNS: dict[bool | None, str] = {True: ">", False: "<", None: "-"}
_SENT = {sign: sent for sent, sign in _SIGNS.items()}
_HEAD = re.compile(r"# *([\w ]{1,40}?) *= *(.{0,100000})")
_SERVO = re.compile(r"(\d{1,3}):([\w.-]{1,60})")


class Piece(NamedTuple):
    """Bytes that passed together. time_s : since the beginning. sent : by the host; None if not known."""

    time_s: float
    sent: bool | None
    data: bytes


@dataclass(frozen=True)
class Wire:
    """Description of a wire. servos : known models by id. model : of all other servos; empty if not known."""

    family: str = "dynamixel"
    baud: int = 1_000_000
    servos: dict[int, str] = field(default_factory=dict)
    model: str = ""

    def head(self) -> str:
        """The first lines of a log."""
        servos = " ".join(f"{number}:{model}" for number, model in sorted(self.servos.items()))
        keys = {"omote traffic": FORMAT, "family": self.family, "baud": self.baud}
        keys |= {"servos": servos, "model": self.model}
        return "".join(f"# {key} = {value}\n" for key, value in keys.items() if value)


@dataclass(frozen=True)
class TrafficRecord:
    """What passed over a wire, in order."""

    wire: Wire
    pieces: tuple[Piece, ...]


def format_piece(piece: Piece) -> str:
    """A line of a log."""
    return f"{piece.time_s:.6f} {_SIGNS[piece.sent]} {piece.data.hex(' ')}\n"


def read_log(text: str) -> TrafficRecord:
    """Parse a log. Raises DriverError, which names the first wrong line."""
    lines = text.splitlines()
    head = dict(_keys(lines))
    if "omote traffic" not in head:
        raise DriverError("it is no record of traffic: its first line is not '# omote traffic = 1'", hint=_HINT)
    wire = read_head(head)
    pieces: list[Piece] = []
    for number, line in enumerate(lines, 1):
        if line.strip() and not line.startswith("#"):
            pieces.append(_read_piece(number, line, pieces[-1].time_s if pieces else 0.0))
        if len(pieces) > MAX_PIECES:
            raise DriverError(f"line {number}: a record has at most {MAX_PIECES} pieces", hint="cut it into parts")
    return TrafficRecord(wire, tuple(pieces))


_HINT = "records come from `omote simulate ... --record FILE` and `omote monitor PORT --record FILE`"


def _keys(lines: Iterable[str]) -> Iterator[tuple[str, str]]:
    for line in lines:
        if not line.startswith("#"):
            return
        if found := _HEAD.fullmatch(line.rstrip()):
            yield found[1], found[2].strip()


def read_head(head: dict[str, str]) -> Wire:
    """Parse the keys at the beginning of a log. Raises DriverError for a newer format or a wrong value."""
    if head.get("omote traffic", FORMAT) != FORMAT:
        raise DriverError("it was written by a newer omote", hint="pip install --upgrade omote")
    baud = head.get("baud", "1000000")
    if not (baud.isascii() and baud.isdecimal() and 300 <= int(baud[:9]) <= 12_000_000):
        raise DriverError(f"baud = {baud[:40]} is no bit rate", hint="write one from 300 to 12000000")
    words = head.get("servos", "").split()
    servos = [_SERVO.fullmatch(word) for word in words]
    if None in servos or len(words) > 2048:
        raise DriverError("servos must be like 1:xl330-m288 2:xl330-m288", hint=_HINT)
    models = {int(each[1]): each[2] for each in servos if each}
    return Wire(head.get("family", "dynamixel"), int(baud), models, head.get("model", "")[:60])


def read_keys(text: str) -> dict[str, str]:
    """Parse the keys in the first lines of a text."""
    return dict(_keys(text.splitlines()))


def _read_piece(number: int, line: str, earliest_s: float) -> Piece:
    time_text, _, rest = line.strip().partition(" ")
    sign, _, data = rest.partition(" ")
    try:
        piece = Piece(float(time_text), _SENT[sign], bytes.fromhex(data))
    except (ValueError, KeyError) as error:
        raise DriverError(
            f"line {number}: {line[:60]!r} is not TIME > BYTES", hint="as 0.001250 > ff ff 01 02 01 fb"
        ) from error
    if not math.isfinite(piece.time_s) or piece.time_s < earliest_s:
        raise DriverError(f"line {number}: times must rise; {time_text[:40]} is before {earliest_s:g}", hint=_HINT)
    return piece
