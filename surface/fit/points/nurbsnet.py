"""Fit uniform cubic NURBS nets to a chart, to compare how many points they need with discretized control points.

Such a net has no slits: a row of knots goes all the way across. It gets the same samples with the same weights, and
only points that reach a sample count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import NdBSpline
from scipy.sparse import csr_matrix, diags, identity, kron
from scipy.sparse.linalg import splu

from surface.base.arrays import Floats, Ints
from surface.fit.source.chart import TILE, Chart

MULTIPLES = (1.0, 2.0, 4.2, 6.0, 8.0)  # of the points of the head's own net
FAIR = 1e-5  # weight of every point's distance from its neighbours' middle, relative to a sample's


@dataclass(frozen=True)
class UniformNet:
    """One uniform net: points in use and the RMS of the face at rest, mm."""

    points: int
    rms: float


def uniform_nets(chart: Chart, targets: Floats, points: int, enough: float) -> list[UniformNet]:
    """Nets of growing size for the chart's first tile, until one is as good as ``enough`` (mm).

    targets : (m, 3) positions of the chart's samples; points : how many the head's own net has there.
    """
    own = chart.uv[:, 0] < TILE / 2
    uv, weight, counted = chart.uv[own], chart.weight[own], ~chart.folded[own]
    out: list[UniformNet] = []
    side = np.sqrt(float(points))
    for multiple in MULTIPLES:
        rows = _rows(uv, _spans_for(uv, points * multiple, side * np.sqrt(multiple)))
        used = np.flatnonzero(rows.getnnz(axis=0))
        off = np.linalg.norm(_solve(rows, used, weight, targets[own]) - targets[own], axis=1)[counted]
        out.append(UniformNet(len(used), float(np.sqrt((off**2).mean()))))
        if out[-1].rms <= enough:
            break
    return out


def _spans_for(uv: Floats, wanted: float, guess: float) -> int:
    """Spans along u and v so that about the wanted number of points reach a sample."""
    spans = guess
    for _ in range(4):
        used = len(np.flatnonzero(_rows(uv, int(spans)).getnnz(axis=0)))
        spans *= np.sqrt(wanted / max(used, 1))
    return max(round(spans), 4)


def _rows(uv: Floats, spans: int) -> csr_matrix:
    """(m, (spans + 3)^2) sparse: the bicubic B-splines of a uniform net at the samples."""
    low, high = uv.min(axis=0), uv.max(axis=0)
    at = (uv - low) / np.maximum(high - low, 1e-12) * (spans - 1e-9)
    knots = np.arange(-3.0, spans + 4.0)
    return csr_matrix(NdBSpline.design_matrix(at, (knots, knots), 3))


def _solve(rows: csr_matrix, used: Ints, weight: Floats, targets: Floats) -> Floats:
    """The net's surface at the samples, (m, 3)."""
    side = round(np.sqrt(rows.shape[1]))
    second = diags([1.0, -2.0, 1.0], [-1, 0, 1], shape=(side, side))
    fair = (kron(second, identity(side)) + kron(identity(side), second)).tocsr()[:, used]
    own = rows[:, used]
    strength = FAIR * weight.sum() / len(used)
    pulled = strength * (fair.T @ fair + 1e-9 * identity(len(used)))
    normal = (own.T @ diags(weight) @ own + pulled).tocsc()
    solved: Floats = own @ splu(normal).solve(np.ascontiguousarray(own.T @ (weight[:, None] * targets)))
    return solved
