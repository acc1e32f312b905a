"""Format CSV, for spreadsheets and plotting programs: a header line of names, then one line of numbers per frame.

The names are those of parameters, with an optional ``time`` (s). An empty cell means that a parameter is not given. The
encoder repeats the header every 120 frames, so that a receiver that connects late can read the lines after it. The face
that the servos show, if frames have it, is written to columns ``servos:jawOpen`` and so on, which the decoder ignores.
"""

from __future__ import annotations

import math

import numpy as np

from controller.base.parameters import Flags, Floats, Parameters
from controller.formats.format import API, Format, everything
from controller.formats.frame import Frame, Refusals

_TIME = "time"
MEASURED = "servos:"
"""Prefix of the names of columns with the face that the servos show."""
_HEADER_INTERVAL = 120  # frames
_MAX_COLUMNS = 1024
_MAX_CELL_LENGTH = 32
_MAX_NUMBER = 1e15


class CsvDecoder:
    """Decodes lines; a line in which no cell is a number is a new header.

    A new header with unknown names may be a damaged copy of the previous one. It takes effect only when it comes twice,
    or when a line of numbers follows that has as many cells as it and not as many as the previous header.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.refused = Refusals()
        self._parameters = parameters
        self._columns: list[int | None] = []
        self._time_column: int | None = None
        self._doubtful: list[str] = []  # a new header of which some names are unknown

    def feed(self, message: bytes) -> list[Frame]:
        """Return one frame for each line of numbers; a datagram may also hold the header."""
        return [frame for line in message.strip().split(b"\n") for frame in self._read(line)]

    def _read(self, line: bytes) -> list[Frame]:
        cells = [cell.strip() for cell in line.decode("utf-8", "replace").strip().split(",", _MAX_COLUMNS)]
        numbers = [_number(cell) for cell in cells]
        if not any(number is not None for number in numbers):
            self._read_header(cells)
            return []
        if len(cells) != len(self._columns) and len(cells) == len(self._doubtful):
            self._use_header(self._doubtful)
        if not self._columns or len(cells) != len(self._columns):
            self.refused.add(
                "numbers before their names" if not self._columns else "a line with another number of cells"
            )
            return []
        return self._frame(cells, numbers)

    def _read_header(self, cells: list[str]) -> None:
        columns = [self._parameters.find(cell) for cell in cells]
        folded = [cell.lower() for cell in cells]
        known = (index is not None or name == _TIME or name.startswith(MEASURED)
                 for index, name in zip(columns, folded, strict=True))  # fmt: skip
        unknown = not all(known)
        if not any(index is not None for index in columns):
            self.refused.add("neither names nor numbers")
        elif unknown and self._columns and folded != self._doubtful:
            self.refused.add("unknown names")
            self._doubtful = folded
        else:
            self._use_header(folded)

    def _use_header(self, names: list[str]) -> None:
        """Read the following lines by these names, which are in lower case."""
        self._columns = [self._parameters.find(name) for name in names]
        self._time_column = names.index(_TIME) if _TIME in names else None
        self._doubtful = []

    def _frame(self, cells: list[str], numbers: list[float | None]) -> list[Frame]:
        values, mask = self._parameters.neutral(), np.zeros(len(self._parameters), dtype=bool)
        for index, number, cell in zip(self._columns, numbers, cells, strict=True):
            if index is not None and number is not None:
                values[index], mask[index] = number, True
            elif index is not None and cell:
                self.refused.add("cells that are not numbers")
        time_s = None if self._time_column is None else numbers[self._time_column]
        return [Frame(values, mask, time_s, None, bool(mask.any()))]


class CsvEncoder:
    """Encodes frames as lines of numbers, with headers."""

    def __init__(self, parameters: Parameters) -> None:
        self._names = parameters.names
        self._sent = 0
        self._measured = False

    def encode(self, frame: Frame) -> list[bytes]:
        """Return a line of numbers, preceded by the header if it is due; parameters not given have empty cells."""
        adds_columns = frame.measured is not None and not self._measured
        self._measured |= adds_columns
        time_s = self._sent / 60.0 if frame.time_s is None else frame.time_s
        mask = frame.mask if frame.face else np.zeros_like(frame.mask)
        cells = _cells(frame.values, mask)
        if self._measured:
            cells += _cells(frame.values if frame.measured is None else frame.measured,
                            np.zeros_like(mask) if frame.measured is None else frame.mask)  # fmt: skip
        header = [self._header()] if adds_columns or self._sent % _HEADER_INTERVAL == 0 else []
        self._sent += 1
        return [*header, ",".join([f"{time_s:.6f}", *cells]).encode()]

    def _header(self) -> bytes:
        measured = [MEASURED + name for name in self._names] if self._measured else []
        return ",".join([_TIME, *self._names, *measured]).encode()


def _cells(values: Floats, mask: Flags) -> list[str]:
    """Return a cell for each value; an empty one where ``mask`` is False."""
    return [f"{value:.6g}" if held else "" for value, held in zip(values.tolist(), mask.tolist(), strict=True)]


def _number(text: str) -> float | None:
    """Parse a finite number; return None for any other text."""
    try:
        value = float(text) if len(text) <= _MAX_CELL_LENGTH else math.nan
    except ValueError:
        return None
    return value if abs(value) < _MAX_NUMBER else None


FORMAT = Format(
    api=API,
    kind="csv",
    title="CSV, one column for each parameter",
    transports=("tcp", "udp", "serial", "lines"),
    port=9402,
    decoder=CsvDecoder,
    encoder=CsvEncoder,
    carries=everything,
    delimiter=b"\n",
    takes_token=True,
    measured=True,
)
