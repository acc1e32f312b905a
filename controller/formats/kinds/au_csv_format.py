"""Format of action units as CSV, with the column names of OpenFace: ``timestamp,AU01_r,AU12_r``, 0 to 5.

A header line is followed by one line of numbers per frame. A line whose ``success`` is 0 reports that no face is seen.
Units and sides of ``configs/vocabularies/facs.toml`` are read in any spelling (``AU1``, ``AU01_r``, ``AUL12``); other
columns are ignored. An empty cell is 0.
"""

from __future__ import annotations

import math
import re
from functools import cache

import numpy as np

from controller.base.parameters import Parameters
from controller.formats.format import API, Format, nothing
from controller.formats.frame import Frame, Refusals
from controller.formats.kinds.au_json_format import about, unit_columns
from controller.vocabulary.facs import Facs

_TIMES = ("timestamp", "time")
_SUCCESS = "success"
_MAX_INTENSITY = 5.0
_HEADER_INTERVAL = 120  # frames
_MAX_COLUMNS, _MAX_CELL_LENGTH = 1024, 32
_NAME = re.compile(r"AU([LR]?)0*(\d{1,2})(?:_r)?", re.IGNORECASE)

_facs = cache(Facs.load)


class AuCsvDecoder:
    """Decodes lines; a line in which no cell is a number is a new header."""

    def __init__(self, parameters: Parameters) -> None:
        self.refused = Refusals()
        self._facs, self._mask = _facs(parameters), about(parameters)
        self._columns: list[np.ndarray | None] = []
        self._time_column: int | None = None
        self._success_column: int | None = None

    def feed(self, message: bytes) -> list[Frame]:
        """Return one frame for each line of numbers; a datagram may also hold the header."""
        return [frame for line in message.strip().split(b"\n") for frame in self._read(line)]

    def _read(self, line: bytes) -> list[Frame]:
        cells = [cell.strip() for cell in line.decode("utf-8", "replace").strip().split(",", _MAX_COLUMNS)]
        numbers = [_number(cell) for cell in cells]
        if not any(math.isfinite(number) for number in numbers):
            self._read_header(cells)
            return []
        if len(cells) != len(self._columns):
            self.refused.add("a line that does not fit its names" if self._columns else "numbers before their names")
            return []
        return [self._frame(numbers)]

    def _read_header(self, cells: list[str]) -> None:
        columns = [_columns(self._facs, cell) for cell in cells]
        if all(column is None for column in columns) or (self._columns and len(cells) != len(self._columns)):
            self.refused.add("neither names nor numbers")
            return
        folded = [cell.lower() for cell in cells]
        self._columns = columns
        self._time_column = next((folded.index(name) for name in _TIMES if name in folded), None)
        self._success_column = folded.index(_SUCCESS) if _SUCCESS in folded else None

    def _frame(self, numbers: list[float]) -> Frame:
        levels = np.zeros(len(self._facs.names))
        for column, number in zip(self._columns, numbers, strict=True):
            if column is not None and math.isfinite(number):
                levels[column] = min(max(number, 0.0) / _MAX_INTENSITY, 1.0)
        time_s = numbers[self._time_column] if self._time_column is not None else math.nan
        values = np.minimum(self._facs.matrix @ levels, 1.0)
        face = self._success_column is None or numbers[self._success_column] != 0.0
        return Frame(values, self._mask.copy(), time_s if math.isfinite(time_s) else None, face=face)


class AuCsvEncoder:
    """Encodes a face as the intensities that fit it best, for both sides where a unit has two."""

    def __init__(self, parameters: Parameters) -> None:
        self._facs, self._sent = _facs(parameters), 0
        self._header = ",".join([_TIMES[0], *map(_column_name, self._facs.names)]).encode()

    def encode(self, frame: Frame) -> list[bytes]:
        """Return a line of numbers, preceded by the header every 120 frames; none for a frame without a face."""
        if not frame.face:
            return []
        levels = self._facs.read(np.clip(np.where(frame.mask, frame.values, 0.0), -1.0, 1.0))
        time_s = self._sent / 60.0 if frame.time_s is None else frame.time_s
        header = [self._header] if self._sent % _HEADER_INTERVAL == 0 else []
        self._sent += 1
        cells = (f"{_MAX_INTENSITY * level:.4g}" for level in levels.tolist())
        return [*header, ",".join([f"{time_s:.6f}", *cells]).encode()]


def _column_name(name: str) -> str:
    """Return the column name of a unit or of one side of it: ``AU01_r``, ``AUL12_r``."""
    side = name[0] if name[0] in "LR" else ""
    return f"AU{side}{int(name.removeprefix(side)):02d}_r"


def _columns(facs: Facs, name: str) -> np.ndarray | None:
    """Return the columns of ``facs`` for the unit that a column name means; None if it means none."""
    found = _NAME.fullmatch(name)
    return None if found is None else unit_columns(facs, f"AU{found[1].upper()}{int(found[2])}")


def _number(text: str) -> float:
    """Parse a number; return NaN for any other text."""
    try:
        value = float(text) if len(text) <= _MAX_CELL_LENGTH else math.nan
    except ValueError:
        return math.nan
    return value if abs(value) < 1e9 else math.nan


FORMAT = Format(
    api=API,
    kind="au-csv",
    title="action units as CSV (OpenFace)",
    transports=("tcp", "udp", "serial", "lines"),
    port=9406,
    decoder=AuCsvDecoder,
    encoder=AuCsvEncoder,
    carries=nothing,
    about=about,
    delimiter=b"\n",
    takes_token=True,
    note="intensities 0 to 5 of each side; no angles",
)
