"""A measured table: angles of the servos at a grid of values of one to three inputs, interpolated between them.

The table is a CSV file beside the robot's, with a column for each input and each channel, with their names, and a row
for each point of the grid, in any order. The grid may be irregular; each combination of its values must occur once.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from controller.base.config import config_error
from controller.base.errors import ConfigError
from controller.base.parameters import Floats
from controller.base.plain_numbers import plain_number
from controller.robot.linkages.kind import API, Input, LinkageKind, LinkageSettings
from surface.base.files import read_text, reading

_MAX_BYTES, _MAX_ROWS = 1 << 22, 20_000


class TableSettings(LinkageSettings):
    """``file`` : the table, beside the robot's file or a path."""

    file: str
    inputs: Annotated[dict[str, Input], Field(min_length=1, max_length=3)]


@dataclass(frozen=True)
class GridTable:
    """Multilinear interpolation. axes : k ascending arrays (g,). values : (g1, ..., gk, n) degrees at the grid."""

    axes: tuple[Floats, ...]
    values: Floats

    def angles(self, inputs: Floats) -> tuple[Floats, bool]:
        """(n,) degrees for inputs (k,), which are clipped to the grid; and whether they were outside."""
        low, high = np.array([[axis[0], axis[-1]] for axis in self.axes]).T
        kept = np.clip(inputs, low, high)
        cells = [min(int(np.searchsorted(a, x, "right")), len(a) - 1) for a, x in zip(self.axes, kept, strict=True)]
        shares = [(x - a[i - 1]) / (a[i] - a[i - 1]) for a, i, x in zip(self.axes, cells, kept, strict=True)]
        found = np.zeros(self.values.shape[-1])
        for corner in product((0, 1), repeat=len(cells)):
            weight = np.prod([t if side else 1.0 - t for side, t in zip(corner, shares, strict=True)])
            found += weight * self.values[tuple(i - 1 + side for i, side in zip(cells, corner, strict=True))]
        return found, bool((kept != inputs).any())


def _make(settings: TableSettings) -> GridTable:
    path, names = Path(settings.file), [*settings.inputs, *settings.channels]
    rows = _rows(path, names)
    k = len(settings.inputs)
    axes = tuple(np.unique(rows[:, i]) for i in range(k))
    if any(len(axis) < 2 for axis in axes):
        raise config_error(path, [f"{names[i]}: needs two values or more" for i in range(k) if len(axes[i]) < 2])
    found: dict[tuple[float, ...], Floats] = {}
    for row in rows:
        if found.setdefault(tuple(row[:k]), row) is not row:
            raise config_error(path, [f"{_place(names[:k], row)} stands there twice"])
    if missing := math.prod(map(len, axes)) - len(
        found
    ):  # before memory is allocated for a grid that few rows may span
        point = next(place for place in product(*axes) if place not in found)
        more = f", and {missing - 1} more" if missing > 1 else ""
        raise config_error(path, [f"there is no row for {_place(names, point)}{more}: every combination needs one"])
    values = np.array([found[place][k:] for place in product(*axes)])
    return GridTable(axes, values.reshape(*map(len, axes), len(settings.channels)))


def _place(names: list[str], values: Iterable[float]) -> str:
    return ", ".join(f"{name} = {value:g}" for name, value in zip(names, values, strict=False))


def _rows(path: Path, names: list[str]) -> Floats:
    """(r, names) the numbers of a file. Raises ConfigError: it cannot be read, or a column or number is missing."""
    with reading(path, ConfigError):
        lines = list(enumerate(read_text(path, _MAX_BYTES).splitlines(), 1))
    lines = [(number, line) for number, line in lines if line.strip() and line[0] != "#"]
    head = [cell.strip() for cell in lines[0][1].split(",")] if lines else []
    if lacking := [name for name in names if name not in head]:
        raise config_error(path, [f"there is no column {name!r}" for name in lacking])
    if len(lines) > _MAX_ROWS:
        raise config_error(path, [f"has {len(lines)} rows; {_MAX_ROWS} at most"])
    columns = [head.index(name) for name in names]
    rows = []
    for number, line in lines[1:]:
        cells = line.split(",")
        found = [plain_number(cells[i].strip()) if i < len(cells) else None for i in columns]
        if any(each is None for each in found):
            raise config_error(path, [f"line {number}: a number is missing"])
        rows.append(found)
    return np.array(rows, dtype=np.float64).reshape(-1, len(names))


LINKAGE = LinkageKind(
    api=API, kind="table", title="a measured table of one to three inputs", settings=TableSettings, make=_make
)
