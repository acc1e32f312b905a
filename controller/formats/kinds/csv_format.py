"""CSV: numbers between commas, as tables and plotting programs have them; a line of names, then one for each frame.

The names are parameters and, if there is one, ``time`` (s). An empty cell means that a parameter is not given. The
encoder repeats the names every 120 frames, so that a receiver that begins late understands the rest. Where it is given
what the servos show, it writes that in columns ``servos:jawOpen`` and so on, which the decoder leaves out.
"""

from __future__ import annotations

import math

import numpy as np

from controller.base.parameters import Flags, Floats, Parameters
from controller.formats.format import API, Format, everything
from controller.formats.frame import Frame, Refusals

_TIME = "time"
MEASURED = "servos:"
"""Prefix of the names of columns with what the servos show."""
_REPEAT = 120
_MOST_COLUMNS = 1024
_LONGEST_CELL = 32
_LARGEST = 1e15


class CsvDecoder:
    """Reads lines; a line of which no cell is a number is a new line of names.

    A new line of names in which some are unknown may be a damaged one of the same stream. It counts once it comes
    twice, or once numbers follow that fit it and not the names before.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.refused = Refusals()
        self._parameters = parameters
        self._columns: list[int | None] = []
        self._time: int | None = None
        self._offered: list[str] = []  # names of which some are unknown

    def feed(self, message: bytes) -> list[Frame]:
        """One frame for each line of numbers; a datagram may hold the names, too."""
        return [frame for line in message.strip().split(b"\n") for frame in self._read(line)]

    def _read(self, line: bytes) -> list[Frame]:
        cells = [cell.strip() for cell in line.decode("utf-8", "replace").strip().split(",", _MOST_COLUMNS)]
        numbers = [_number(cell) for cell in cells]
        if not any(number is not None for number in numbers):
            self._name(cells)
            return []
        if len(cells) != len(self._columns) and len(cells) == len(self._offered):
            self._take(self._offered)
        if not self._columns or len(cells) != len(self._columns):
            self.refused.add(
                "numbers before their names" if not self._columns else "a line with another number of cells"
            )
            return []
        return self._frame(cells, numbers)

    def _name(self, cells: list[str]) -> None:
        columns = [self._parameters.find(cell) for cell in cells]
        folded = [cell.lower() for cell in cells]
        known = (at is not None or name == _TIME or name.startswith(MEASURED)
                 for at, name in zip(columns, folded, strict=True))  # fmt: skip
        unknown = not all(known)
        if not any(at is not None for at in columns):
            self.refused.add("neither names nor numbers")
        elif unknown and self._columns and folded != self._offered:
            self.refused.add("unknown names")
            self._offered = folded
        else:
            self._take(folded)

    def _take(self, names: list[str]) -> None:
        """Read the lines that follow by these names, in lower case."""
        self._columns = [self._parameters.find(name) for name in names]
        self._time = names.index(_TIME) if _TIME in names else None
        self._offered = []

    def _frame(self, cells: list[str], numbers: list[float | None]) -> list[Frame]:
        values, mask = self._parameters.neutral(), np.zeros(len(self._parameters), dtype=bool)
        for at, number, cell in zip(self._columns, numbers, cells, strict=True):
            if at is not None and number is not None:
                values[at], mask[at] = number, True
            elif at is not None and cell:
                self.refused.add("cells that are no numbers")
        time_s = None if self._time is None else numbers[self._time]
        return [Frame(values, mask, time_s, None, bool(mask.any()))]


class CsvEncoder:
    """Writes a line of names, and a line of numbers for each frame."""

    def __init__(self, parameters: Parameters) -> None:
        self._names = parameters.names
        self._sent = 0
        self._measured = False

    def encode(self, frame: Frame) -> list[bytes]:
        """A line, with the line of names before it where that is due; empty cells for what is not given."""
        begins = frame.measured is not None and not self._measured
        self._measured |= begins
        time_s = self._sent / 60.0 if frame.time_s is None else frame.time_s
        mask = frame.mask if frame.face else np.zeros_like(frame.mask)
        cells = _cells(frame.values, mask)
        if self._measured:
            cells += _cells(frame.values if frame.measured is None else frame.measured,
                            np.zeros_like(mask) if frame.measured is None else frame.mask)  # fmt: skip
        names = [self._header()] if begins or self._sent % _REPEAT == 0 else []
        self._sent += 1
        return [*names, ",".join([f"{time_s:.6f}", *cells]).encode()]

    def _header(self) -> bytes:
        measured = [MEASURED + name for name in self._names] if self._measured else []
        return ",".join([_TIME, *self._names, *measured]).encode()


def _cells(values: Floats, mask: Flags) -> list[str]:
    """Numbers, and nothing where none is given."""
    return [f"{value:.6g}" if held else "" for value, held in zip(values.tolist(), mask.tolist(), strict=True)]


def _number(text: str) -> float | None:
    """A finite number; None for any other text."""
    try:
        value = float(text) if len(text) <= _LONGEST_CELL else math.nan
    except ValueError:
        return None
    return value if abs(value) < _LARGEST else None


FORMAT = Format(
    api=API,
    kind="csv",
    title="numbers between commas",
    transports=("tcp", "udp", "serial", "lines"),
    port=9402,
    decoder=CsvDecoder,
    encoder=CsvEncoder,
    carries=everything,
    delimiter=b"\n",
    takes_token=True,
    measured=True,
)
