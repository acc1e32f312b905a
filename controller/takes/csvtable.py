"""Reads tables of comma-separated values: a header line, then rows of cells."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from controller.base.errors import TakeError
from controller.base.parameters import Floats
from surface.base import files

_DELIMITERS = ",;\t"
_CUT_OFF = "the file may be cut off; export it again"
_CORRECT = "correct or remove that line"


@dataclass(frozen=True)
class CsvTable:
    """A table of strings.

    header : names of the columns, stripped. rows : for each row its line number and its cells, one for each column.
    decimal_comma : whether numbers have decimal commas, as in files that are separated by semicolons.
    """

    path: Path
    header: list[str]
    rows: list[tuple[int, list[str]]]
    decimal_comma: bool = False

    def texts(self, column: int) -> list[str]:
        """Return the cells of a column."""
        return [row[column] for _, row in self.rows]

    def numbers(self, columns: Sequence[int], *, gaps: bool = False, blanks: bool = False) -> Floats:
        """Return the cells of k columns as (n, k) float64.

        gaps : whether every cell without a finite number becomes NaN. blanks : whether only empty cells do.

        Raises TakeError: another cell is not a finite number; it names line and column.
        """
        found = [
            [math.nan if blanks and not row[column].strip() else self._number(line, column, row[column], gaps)
             for column in columns]
            for line, row in self.rows
        ]  # fmt: skip
        return np.array(found, dtype=np.float64).reshape(len(self.rows), len(columns))

    def fault(self, line: int, column: int, why: str) -> TakeError:
        """Return the error for a cell."""
        return TakeError(f"{self.path}, line {line}, column {self.header[column]}: {why}", hint=_CORRECT)

    def _number(self, line: int, column: int, text: str, gaps: bool) -> float:
        try:
            value = float(text.replace(",", ".") if self.decimal_comma else text)
        except ValueError:
            value = math.nan
        if math.isfinite(value):
            return value
        if gaps:
            return math.nan
        raise self.fault(line, column, f"{text!r} is not a finite number")


def read_csv(path: Path, hint: str) -> CsvTable:
    """Read a table from a file in UTF-8 whose cells are separated by commas, semicolons or tabs.

    A repetition of the header, as in a saved stream, is ignored.

    hint : says what such a file should be.

    Raises TakeError: the file cannot be read, is empty or has no rows, or a row has another number of cells than the
    header.
    """
    with files.reading(path, TakeError, hint=hint):
        text = files.read_text(path)
    first = text.lstrip("\r\n").partition("\n")[0]
    delimiter = max(_DELIMITERS, key=first.count)
    try:
        rows = list(csv.reader(io.StringIO(text, newline=""), delimiter=delimiter))
    except csv.Error as error:
        raise TakeError(f"{path}: not a CSV file: {error}", hint=hint) from error
    filled = [(number, row) for number, row in enumerate(rows, 1) if any(cell.strip() for cell in row)]
    if not filled:
        raise TakeError(f"{path}: the file is empty", hint=hint)
    (_, names), *lines = filled
    lines = [(number, row) for number, row in lines if row != names]
    if not lines:
        raise TakeError(f"{path}: a header but no rows", hint="record the take again, or export it again")
    for number, row in lines:
        if len(row) != len(names):
            why = f"{path}, line {number}: {len(row)} cells where the header has {len(names)}"
            raise TakeError(why, hint=_CUT_OFF)
    return CsvTable(path, [name.strip() for name in names], lines, delimiter != "," and "," in text)


def header_of(start: bytes) -> list[str]:
    """Return the column names, in lower case, from the first bytes of a table; never fails, whatever the bytes are."""
    first = start.decode("utf-8-sig", "replace").lstrip("\r\n").partition("\n")[0]
    return [name.strip().strip('"').lower() for name in first.split(max(_DELIMITERS, key=first.count))]
