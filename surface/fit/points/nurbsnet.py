"""Fit uniform cubic B-spline nets to a chart, to compare how many points they need with discretized control points.

Such a net gets the same samples with the same weights, only points that reach a sample count, and it has the same
slits: where a slit cuts the whole of a point's reach, the net is split there, and the point becomes one above and one
below. Sizes are tried in steps of a tenth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import NdBSpline
from scipy.sparse import csr_matrix, diags, identity, kron, vstack
from scipy.sparse.linalg import splu

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.source.chart import FIRST_TILE, Chart, Cut

STEP = 1.1  # of sizes, in points
STEPS = (-12, 24)  # the least and the largest that is tried: a third and ten times the points of the head's own net
FAIR = 1e-5  # weight of the differences between points and their neighbours, relative to the samples' of a point


@dataclass(frozen=True)
class UniformNet:
    """One uniform net: points in use and the RMS of the face at rest, mm."""

    points: int
    rms: float


@dataclass(frozen=True)
class _Task:
    """Samples of the first tile: uv (m, 2), weight (m,), which are counted (m,), targets (m, 3), slits."""

    uv: Floats
    weight: Floats
    counted: Bools
    targets: Floats
    cuts: list[Cut]


def uniform_nets(chart: Chart, targets: Floats, points: int, enough: float) -> list[UniformNet]:
    """Nets for the chart's first tile, smallest first; the last is the first that is as good as ``enough`` (mm).

    Errors fall as nets grow: the smallest that is good enough is found by halving the range of sizes. If the largest is
    not as good either, it alone is measured.

    targets : (m, 3) positions of the chart's samples; points : how many the head's own net has there.
    """
    own = chart.uv[:, 0] < FIRST_TILE
    cuts = [c for c in chart.cuts if c.start < FIRST_TILE]
    task = _Task(chart.uv[own], chart.weight[own], ~chart.folded[own], targets[own], cuts)
    low, high = STEPS[0] - 1, STEPS[1]
    tried = {high: _net(task, points * STEP**high)}
    while high - low > 1 and tried[STEPS[1]].rms <= enough:
        middle = (low + high) // 2
        tried[middle] = _net(task, points * STEP**middle)
        low, high = (low, middle) if tried[middle].rms <= enough else (middle, high)
    return [tried[k] for k in sorted(tried) if k <= high]


def _net(task: _Task, wanted: float) -> UniformNet:
    """A net of about the wanted number of points."""
    spans = _spans_for(task, wanted, np.sqrt(wanted))
    rows, split = _rows(task.uv, spans, task.cuts)
    used = np.flatnonzero(rows.getnnz(axis=0))
    off = np.linalg.norm(_solve(rows, used, split, task) - task.targets, axis=1)[task.counted]
    return UniformNet(len(used), float(np.sqrt((off**2).mean())))


def _spans_for(task: _Task, wanted: float, guess: float) -> int:
    """Spans along u and v so that about the wanted number of points reach a sample."""
    spans = guess
    for _ in range(4):
        used = len(np.flatnonzero(_rows(task.uv, max(int(spans), 1), task.cuts)[0].getnnz(axis=0)))
        spans *= np.sqrt(wanted / max(used, 1))
    return max(round(spans), 4)


def _rows(uv: Floats, spans: int, cuts: list[Cut]) -> tuple[csr_matrix, Bools]:
    """(m, 2 n) sparse: the n = (spans + 3)^2 bicubic B-splines of a uniform net at the samples; and which are split.

    Column n + k is the lower half of spline k, where that is split: it serves the samples below the slit.
    """
    low, extent = uv.min(axis=0), np.maximum(np.ptp(uv, axis=0), 1e-12)
    knots = np.arange(-3.0, spans + 4.0)
    at = (uv - low) / extent * (spans - 1e-9)
    grid = csr_matrix(NdBSpline.design_matrix(at, (knots, knots), 3)).tocoo()
    n = grid.shape[1]
    level = _levels([low[k] + knots / spans * extent[k] for k in (0, 1)], cuts)
    below = uv[grid.row, 1] < level[grid.col]
    rows = csr_matrix((grid.data, (grid.row, grid.col + n * below)), shape=(len(uv), 2 * n))
    return rows, np.isfinite(level)


def _levels(knots: list[Floats], cuts: list[Cut]) -> Floats:
    """(n,) the v at which a slit splits every spline of the net; -inf where none does."""
    count = len(knots[0]) - 4
    (u0, u1), (v0, v1) = ((k[:-4], k[4:]) for k in knots)
    level = np.full((count, count), -np.inf)
    for cut in cuts:
        inside = (u0 >= cut.start) & (u1 <= cut.end)
        level[np.ix_(inside, (v0 < cut.v) & (v1 > cut.v))] = cut.v
    return level.ravel()


def _solve(rows: csr_matrix, used: Ints, split: Bools, task: _Task) -> Floats:
    """The net's surface at the samples, (m, 3)."""
    n = len(split)
    side = round(np.sqrt(n))
    second = diags([1.0, -2.0, 1.0], [-1, 0, 1], shape=(side, side))
    grid = (kron(second, identity(side)) + kron(identity(side), second)).tocsr()
    lower = np.where(split, np.arange(n) + n, np.arange(n))
    sides = [csr_matrix((np.ones(n), (np.arange(n), k)), shape=(n, 2 * n)) for k in (np.arange(n), lower)]
    fair = vstack([grid @ s for s in sides]).tocsr()[:, used]
    own = rows[:, used]
    strength = 0.5 * FAIR * task.weight.sum() / len(used)
    pulled = strength * (fair.T @ fair + 1e-9 * identity(len(used)))
    normal = (own.T @ diags(task.weight) @ own + pulled).tocsc()
    solved: Floats = own @ splu(normal).solve(np.ascontiguousarray(own.T @ (task.weight[:, None] * task.targets)))
    return solved
