"""Knot insertion: more control points for the same surface, where detail is wanted and nowhere else.

A knot put into a blending function splits it exactly in two (Boehm 1980): over knots t_0 .. t_p+1 with x between,
N = a N' + b N'', where N' stands on the knots but the last, N'' on those but the first (both with x), and
a = min(1, (x - t_0) / (t_p - t_0)), b = min(1, (t_p+1 - x) / (t_p+1 - t_1)). A control point so becomes two at the
same place with weights a w and b w; points with equal knots are then joined at their weighted mean.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from surface.base.arrays import Floats, Ints
from surface.base.checks import check_ids

from .controlpoints import ControlPoints

Table = TypeVar("Table", bound=ControlPoints)


@dataclass(frozen=True)
class Refinement(Generic[Table]):
    """A refined surface, and where its points come from.

    Attributes
    ----------
    surface : the same surface, of the same class, with n' >= n control points; those that were not split come first,
        in order
    point, parent : (k,) int64, new point and old point of every share
    share : (k,) float64, the shares of a new point sum to 1
    """

    surface: Table
    point: Ints
    parent: Ints
    share: Floats

    def carry(self, values: ArrayLike) -> Floats:
        """Data of the old points (n, ...), such as displacements, for the new ones (n', ...)."""
        old = np.asarray(values, dtype=np.float64)
        new = np.zeros((self.surface.n, *old.shape[1:]))
        np.add.at(new, self.point, old[self.parent] * self.share.reshape(-1, *[1] * (old.ndim - 1)))
        return new


@dataclass
class _Pieces:
    """Control points while they are split."""

    parent: Ints
    weight: Floats
    knots: list[Floats]
    degree: list[Ints]
    split: np.ndarray

    def take(self, index: np.ndarray) -> _Pieces:
        """The pieces at ``index``."""
        return _Pieces(
            self.parent[index],
            self.weight[index],
            [k[index] for k in self.knots],
            [p[index] for p in self.degree],
            self.split[index],
        )


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
    chosen = np.ones(surface.n, dtype=bool)
    if ids is not None:
        which = check_ids(ids, surface.n)
        chosen[:] = False
        chosen[which] = True
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
    knots = [k.copy() for k in surface.padded]
    degrees = [p.copy() for p in surface.degrees]
    return _Pieces(np.arange(surface.n), surface.weights.copy(), knots, degrees, np.zeros(surface.n, dtype=bool))


def _middles(knots: Floats, low: float, high: float) -> Floats:
    """(n, w - 1): middles of the knot spans that share more than an end with low..high, NaN for the others."""
    a, b = knots[:, :-1], knots[:, 1:]
    return np.where((b > a) & (a < high) & (b > low), (a + b) / 2, np.nan)


def _split(pieces: _Pieces, axis: int, value: Floats, chosen: np.ndarray) -> _Pieces:
    """Split the chosen pieces whose support has ``value`` inside."""
    knots = pieces.knots[axis]
    at = np.flatnonzero(chosen & (knots[:, 0] < value) & (value < knots[:, -1]))
    if not len(at):
        return pieces
    low, high = pieces.take(at), pieces.take(at)
    rows, x, p = knots[at], value[at], pieces.degree[axis][at]
    last = np.take_along_axis(rows, p[:, None] + 1, 1)[:, 0]
    before_last = np.take_along_axis(rows, p[:, None], 1)[:, 0]
    low.weight *= _part(x - rows[:, 0], before_last - rows[:, 0])
    high.weight *= _part(last - x, last - rows[:, 1])
    low.knots[axis], high.knots[axis] = _halves(rows, x, p)
    low.split[:] = high.split[:] = True
    rest = pieces.take(np.setdiff1d(np.arange(len(pieces.parent)), at))
    parts = (rest, low, high)
    return _Pieces(
        np.concatenate([part.parent for part in parts]),
        np.concatenate([part.weight for part in parts]),
        [np.concatenate([part.knots[k] for part in parts]) for k in range(2)],
        [np.concatenate([part.degree[k] for part in parts]) for k in range(2)],
        np.concatenate([part.split for part in parts]),
    )


def _part(length: Floats, whole: Floats) -> Floats:
    """min(1, length / whole), 1 where whole is 0."""
    return np.minimum(1.0, length / np.where(whole > 0, whole, length))


def _halves(rows: Floats, x: Floats, p: Ints) -> tuple[Floats, Floats]:
    """Knots with x put in: without the last one, and without the first one."""
    column = np.arange(rows.shape[1])
    real = column < (p + 2)[:, None]
    full = np.sort(np.hstack([np.where(real, rows, np.inf), x[:, None]]), axis=1)  # p + 3 numbers, then inf
    low, high = full[:, :-1].copy(), full[:, 1:].copy()
    for half in (low, high):
        end = np.take_along_axis(half, p[:, None] + 1, 1)
        half[~real] = np.broadcast_to(end, half.shape)[~real]
    return low, high


def _join(surface: Table, pieces: _Pieces) -> Refinement[Table]:
    """Join split pieces that stand on equal knots; the rest keep their order and come first."""
    order = np.concatenate([np.flatnonzero(~pieces.split), np.flatnonzero(pieces.split)])
    pieces = pieces.take(order)
    columns = [*pieces.knots, *(p[:, None].astype(np.float64) for p in pieces.degree)]
    unique_tag = np.where(pieces.split, -1.0, np.arange(len(order)))[:, None]
    table = np.ascontiguousarray(np.hstack([*columns, unique_tag]) + 0.0)
    _, first, group = np.unique(table.view(f"V{table.shape[1] * 8}").ravel(), return_index=True, return_inverse=True)
    rank = np.zeros(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    point = rank[group.ravel()]
    keep = np.sort(first)
    weight = np.bincount(point, pieces.weight)
    share = pieces.weight / weight[point]
    xyz = np.zeros((len(keep), 3))
    np.add.at(xyz, point, surface.points[pieces.parent] * share[:, None])
    knots, degrees = [k[keep] for k in pieces.knots], [p[keep] for p in pieces.degree]
    closed_u, closed_v = surface.closed
    made = type(surface).from_padded(xyz, weight, *knots, *degrees, closed_u=closed_u, closed_v=closed_v)
    return Refinement(made, point, pieces.parent, share)
