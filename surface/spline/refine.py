"""Knot insertion and local refinement: more control points for exactly the same surface.

A knot x inserted into a blending function splits it exactly in two (Boehm 1980): for knots t_0 .. t_p+1 around x,
N = a N' + b N'', where N' has all knots but the last, N'' all but the first (both with x), and
a = min(1, (x - t_0) / (t_p - t_0)), b = min(1, (t_p+1 - x) / (t_p+1 - t_1)). A control point so becomes two at the
same place with weights a w and b w; points with equal knots are then merged at their weighted mean.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from surface.base.arrays import Bools, Floats, Ints
from surface.base.checks import check_ids

from .controlpoints import ControlPoints

Table = TypeVar("Table", bound=ControlPoints)


@dataclass(frozen=True)
class Refinement(Generic[Table]):
    """A refined surface of the same class, and where its points come from: those that were not split come first.

    ``point`` and ``parent`` (k,) int64 are new point and old point of every ``share`` (k,) float64; the shares of a new
    point sum to 1.
    """

    surface: Table
    point: Ints
    parent: Ints
    share: Floats

    def carry(self, values: ArrayLike) -> Floats:
        """Return data of the old points (n, ...), such as displacements, for the new ones (n', ...)."""
        old = np.asarray(values, dtype=np.float64)
        new = np.zeros((self.surface.n, *old.shape[1:]))
        np.add.at(new, self.point, old[self.parent] * self.share.reshape(-1, *[1] * (old.ndim - 1)))
        return new


class _Pieces(NamedTuple):
    """Control points while they are split: rows of all arrays belong together."""

    parent: Ints
    weight: Floats
    knots_u: Floats
    knots_v: Floats
    degree_u: Ints
    degree_v: Ints
    split: Bools

    def take(self, index: np.ndarray) -> _Pieces:
        """Return the pieces at ``index``."""
        return _Pieces(*(array[index] for array in self))


def insert_knot(surface: Table, axis: str, value: float, ids: ArrayLike | None = None) -> Refinement[Table]:
    """See :meth:`surface.DCPSurface.insert_knot`."""
    if axis not in ("u", "v"):
        raise ValueError(f'axis: must be "u" or "v", not {axis!r}')
    if not np.isfinite(value):
        raise ValueError(f"value: must be finite, not {value}")
    k = "uv".index(axis)
    low, high = surface.rect[2 * k], surface.rect[2 * k + 1]
    if surface.closed[k] is None and not low <= value <= high:
        raise ValueError(f"value: {axis} = {value} is outside the domain, {low} to {high}")
    pieces = _pieces(surface)
    chosen = np.full(surface.n, ids is None)
    if ids is not None:
        chosen[check_ids(ids, surface.n)] = True
    for shift in np.unique(surface.shifts[:, k]):
        pieces = _split(pieces, k, np.full(len(pieces.parent), value - shift), chosen[pieces.parent])
    return _join(surface, pieces)


def refine(surface: Table, region: tuple[float, float, float, float]) -> Refinement[Table]:
    """See :meth:`surface.DCPSurface.refine`."""
    if np.shape(region) != (4,):
        raise ValueError(f"region: needs (u0, u1, v0, v1), got {region!r}")
    u0, u1, v0, v1 = region
    if not np.isfinite(region).all() or not (u0 < u1 and v0 < v1):
        raise ValueError(f"region: needs finite u0 < u1 and v0 < v1, got {tuple(region)}")
    pieces, s = _pieces(surface), surface.supports
    for du, dv in surface.shifts:
        a, b, c, d = u0 - du, u1 - du, v0 - dv, v1 - dv
        reached = (s[:, 0] < b) & (s[:, 1] > a) & (s[:, 2] < d) & (s[:, 3] > c)
        for axis, (low, high) in enumerate(((a, b), (c, d))):
            targets = _middles(surface.padded[axis], low, high)
            for column in range(targets.shape[1]):
                value = targets[pieces.parent, column]
                pieces = _split(pieces, axis, value, reached[pieces.parent] & np.isfinite(value))
    return _join(surface, pieces)


def _pieces(surface: ControlPoints) -> _Pieces:
    n = surface.n
    return _Pieces(np.arange(n), surface.weights, *surface.padded, *surface.degrees, np.zeros(n, dtype=bool))


def _middles(knots: Floats, low: float, high: float) -> Floats:
    """Return (n, w - 1): middles of the knot spans that share more than an end with low..high, NaN for the others."""
    a, b = knots[:, :-1], knots[:, 1:]
    return np.where((b > a) & (a < high) & (b > low), (a + b) / 2, np.nan)


def _split(pieces: _Pieces, axis: int, value: Floats, chosen: np.ndarray) -> _Pieces:
    """Split the chosen pieces whose support has ``value`` inside."""
    knots, degree = ((pieces.knots_u, pieces.degree_u), (pieces.knots_v, pieces.degree_v))[axis]
    inside = chosen & (knots[:, 0] < value) & (value < knots[:, -1])
    if not inside.any():
        return pieces
    old, rows, x, p = pieces.take(inside), knots[inside], value[inside], degree[inside]
    last = np.take_along_axis(rows, p[:, None] + 1, 1)[:, 0]
    before_last = np.take_along_axis(rows, p[:, None], 1)[:, 0]
    low = old.weight * _part(x - rows[:, 0], before_last - rows[:, 0])
    high = old.weight * _part(last - x, last - rows[:, 1])
    name, split = ("knots_u", "knots_v")[axis], np.ones(len(x), dtype=bool)
    halves = [
        old._replace(weight=weight, split=split, **{name: half})  # type: ignore[arg-type]
        for weight, half in zip((low, high), _halves(rows, x, p), strict=True)
    ]
    return _Pieces(*(np.concatenate(arrays) for arrays in zip(pieces.take(~inside), *halves, strict=True)))


def _part(length: Floats, whole: Floats) -> Floats:
    """Return min(1, length / whole), 1 where whole is 0."""
    return np.minimum(1.0, length / np.where(whole > 0, whole, length))


def _halves(rows: Floats, x: Floats, p: Ints) -> tuple[Floats, Floats]:
    """Return knots with x inserted: without the last one, and without the first one."""
    column = np.arange(rows.shape[1])
    real = column < (p + 2)[:, None]
    full = np.sort(np.hstack([np.where(real, rows, np.inf), x[:, None]]), axis=1)  # p + 3 numbers, then inf
    low, high = full[:, :-1].copy(), full[:, 1:].copy()
    for half in (low, high):
        end = np.take_along_axis(half, p[:, None] + 1, 1)
        half[~real] = np.broadcast_to(end, half.shape)[~real]
    return low, high


def _join(surface: Table, pieces: _Pieces) -> Refinement[Table]:
    """Merge split pieces with equal knots; the rest keep their order and come first."""
    order = np.concatenate([np.flatnonzero(~pieces.split), np.flatnonzero(pieces.split)])
    pieces = pieces.take(order)
    tag = np.where(pieces.split, -1.0, np.arange(len(order)))
    columns = [np.asarray(array, dtype=np.float64).reshape(len(order), -1) for array in (*pieces[2:6], tag)]
    table = np.ascontiguousarray(np.hstack(columns) + 0.0)
    _, first, group = np.unique(table.view(f"V{table.shape[1] * 8}").ravel(), return_index=True, return_inverse=True)
    rank = np.zeros(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    point = rank[group.ravel()]
    weight = np.bincount(point, pieces.weight)
    share = pieces.weight / weight[point]
    kept = pieces.take(np.sort(first))
    xyz = np.zeros((len(first), 3))
    np.add.at(xyz, point, surface.points[pieces.parent] * share[:, None])
    closed_u, closed_v = surface.closed
    made = type(surface).from_padded(xyz, weight, *kept[2:6], closed_u=closed_u, closed_v=closed_v)
    return Refinement(made, point, pieces.parent, share)
