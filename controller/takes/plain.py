"""Reads and writes plain tables of parameters: ``time,jawOpen,mouthSmileLeft,...``, with the time in seconds.

Columns may have any spelling of a parameter. A name without a side means both sides, and ``headYaw_deg`` is in degrees.
Other columns are ignored, also those with the face that the servos showed; but a name that is nearly that of a
parameter is an error. An empty cell repeats the value of the row before. A column without any value does not count.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from controller.base.errors import TakeError
from controller.base.files import replacing
from controller.base.parameters import Flags, Floats, Parameters, did_you_mean
from controller.formats.kinds.csv_format import MEASURED
from controller.takes.csvtable import CsvTable, read_csv
from controller.takes.livelink import Take
from controller.vocabulary.sides import sides

_HINT = "a plain take begins with the line time,jawOpen,mouthSmileLeft,..., and the time is in seconds"
_UNKNOWN = "correct it, or remove the column; a parameter of your own needs --vocabulary FILE or --stage STAGE"
_TIMES = {"time": 1.0, "t": 1.0, "seconds": 1.0, "timestamp": 1.0, "ms": 1e-3, "milliseconds": 1e-3}
_TIMES |= {f"{name}_{unit}": scale for name in ("time", "t", "timestamp")
           for unit, scale in (("s", 1.0), ("sec", 1.0), ("seconds", 1.0), ("ms", 1e-3))}  # fmt: skip
_DEGREES = re.compile(r"(.+?)[ _.]?\(?deg(?:rees)?\)?", re.IGNORECASE)


def plain_take(path: Path, parameters: Parameters) -> Take:
    """Read a take from a table with a column of times and columns of parameters.

    Raises TakeError: the file cannot be read; it has no column of times or of a parameter; a name is nearly that of a
    parameter; a parameter occurs twice; a cell is not a number; or the times are not ascending.
    """
    table = read_csv(path, _HINT)
    time_column, scale = _time_column(table)
    times = scale * table.numbers([time_column])[:, 0]
    for row, step in enumerate(np.diff(times), 1):
        if step <= 0.0:
            raise table.fault(table.rows[row][0], time_column, "the time is not later than that of the row before")
    values, mask = np.zeros((len(times), len(parameters))), np.zeros(len(parameters), dtype=bool)
    for column, positions, unit in _parameter_columns(table, time_column, parameters):
        if mask[positions].any():
            raise TakeError(f"{path}, line 1, column {table.header[column]}: occurs twice", hint="remove one of them")
        cells = table.numbers([column], blanks=True)[:, 0]
        if np.isfinite(cells).any():
            values[:, positions] = unit * _fill_gaps(cells)[:, None]
            mask[positions] = True
    if not mask.any():
        raise TakeError(f"{path}, line 1: no column is a parameter, or none has a value", hint=_HINT)
    return Take(path.name, times - times[0], values, mask, parameters.low, parameters.high)


def _fill_gaps(cells: Floats) -> Floats:
    """Replace each NaN in cells (n,) by the last value before it, or, if there is none, by the first value after it."""
    given = np.flatnonzero(np.isfinite(cells))
    filled: Floats = cells[given[np.maximum(np.searchsorted(given, np.arange(len(cells)), side="right") - 1, 0)]]
    return filled


def write_plain(path: Path, times: Floats, values: Floats, mask: Flags, parameters: Parameters) -> None:
    """Write times (n,) s and values (n, P) of the parameters in ``mask`` : (P,), with six decimals.

    Raises ControllerError: the file cannot be written; an existing file stays unchanged.
    """
    with replacing(path) as temporary:
        temporary.write_text("".join(_lines(times, values, mask, parameters)), encoding="ascii")


def _lines(times: Floats, values: Floats, mask: Flags, parameters: Parameters) -> Iterator[str]:
    columns = np.flatnonzero(mask)
    yield ",".join(["time", *(parameters.names[i] for i in columns)]) + "\n"
    for time, row in zip(times.tolist(), values[:, columns].tolist(), strict=True):
        yield ",".join(f"{cell:.6f}".rstrip("0").rstrip(".") for cell in (time, *row)) + "\n"


def _time_column(table: CsvTable) -> tuple[int, float]:
    """Return the index of the column of times, and its unit in seconds."""
    for i, name in enumerate(table.header):
        scale = _TIMES.get(re.sub(r"[ _.()\[\]]+", "_", name.lower()).strip("_"))
        if scale is not None:
            return i, scale
    raise TakeError(f"{table.path}, line 1: no column time", hint=_HINT)


def _parameter_columns(
    table: CsvTable, time_column: int, parameters: Parameters
) -> Iterator[tuple[int, list[int], float]]:
    """Yield the index of each column of a parameter, the indices of the parameters it means, and their factor."""
    for column, name in enumerate(table.header):
        if name.startswith(MEASURED):
            continue
        positions, unit = sides(parameters, name), 1.0
        if not positions and (degrees := _DEGREES.fullmatch(name)):
            found = parameters.find(degrees[1])
            if found is not None and math.isfinite(full := float(parameters.full_scale_rad[found])):
                positions, unit = [found], math.radians(1.0) / full
        if positions:
            yield column, positions, unit
        elif column != time_column and (meant := did_you_mean(name, parameters.names)):
            why = f"{table.path}, line 1: unknown column {name!r}{meant}"
            raise TakeError(why, hint=_UNKNOWN)
