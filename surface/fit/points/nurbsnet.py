"""A uniform cubic NURBS net fitted beside a head: how many points it needs where discretized control points do.

The net has no slits: a row of knots goes all the way across. It gets the same samples with the same weights, and
counts only points that reach a sample.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Floats
from surface.fit.source.chart import TILE, Chart

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix  # takes a moment to import

MULTIPLES = (1.0, 2.0, 4.2, 6.0, 8.0)  # of the points of the head's own net
FAIR = 1e-5  # pull of every point towards its neighbours' middle, beside a sample's weight


@dataclass(frozen=True)
class UniformNet:
    """One uniform net: points in use and the RMS of the face at rest, mm."""

    points: int
    rms: float


def uniform_nets(chart: Chart, targets: Floats, points: int, enough: float) -> list[UniformNet]:
    """Nets of growing size for the chart's first tile, until one is as good as ``enough`` (mm).

    Parameters
    ----------
    targets : (m, 3) where the chart's samples are; points : how many the head's own net has there.
    """
    own = chart.uv[:, 0] < TILE / 2
    uv, weight, counted = chart.uv[own], chart.weight[own], ~chart.folded[own]
    out: list[UniformNet] = []
    side = np.sqrt(float(points))
    for multiple in MULTIPLES:
        rows = _rows(uv, _side_for(uv, points * multiple, side * np.sqrt(multiple)))
        used = np.flatnonzero(rows.getnnz(axis=0))
        off = np.linalg.norm(_solve(rows, used, weight, targets[own]) - targets[own], axis=1)[counted]
        out.append(UniformNet(len(used), float(np.sqrt((off**2).mean()))))
        if out[-1].rms <= enough:
            break
    return out


def _side_for(uv: Floats, wanted: float, guess: float) -> int:
    """Spans along u and v so that about the wanted number of points reach a sample."""
    spans = guess
    for _ in range(4):
        used = len(np.flatnonzero(_rows(uv, int(spans)).getnnz(axis=0)))
        spans *= np.sqrt(wanted / max(used, 1))
    return max(round(spans), 4)


def _rows(uv: Floats, spans: int) -> csr_matrix:
    """(m, (spans + 3)^2) sparse: the bicubic B-splines of a uniform net at the samples."""
    from scipy.interpolate import BSpline  # takes a moment to import
    from scipy.sparse import csr_matrix

    low, high = uv.min(axis=0), uv.max(axis=0)
    at = (uv - low) / np.maximum(high - low, 1e-12) * (spans - 1e-9)
    knots = np.arange(-3.0, spans + 4.0)
    one, two = (BSpline.design_matrix(at[:, k], knots, 3) for k in (0, 1))
    n = spans + 3
    a, b = one.indices.reshape(-1, 4), two.indices.reshape(-1, 4)
    column = (a[:, :, None] * n + b[:, None, :]).reshape(len(uv), 16)
    value = (one.data.reshape(-1, 4, 1) * two.data.reshape(-1, 1, 4)).reshape(len(uv), 16)
    return csr_matrix((value.ravel(), column.ravel(), np.arange(0, 16 * len(uv) + 1, 16)), shape=(len(uv), n * n))


def _solve(rows: csr_matrix, used: NDArray[np.integer], weight: Floats, targets: Floats) -> Floats:
    """The net's surface at the samples, (m, 3)."""
    from scipy.sparse import diags, identity
    from scipy.sparse.linalg import splu

    side = round(np.sqrt(rows.shape[1]))
    fair = _laplacian(side)[:, used]
    own = rows[:, used]
    strength = FAIR * weight.sum() / len(used)
    pulled = strength * (fair.T @ fair + 1e-9 * identity(len(used)))
    normal = (own.T @ diags(weight) @ own + pulled).tocsc()
    solved: Floats = own @ splu(normal).solve(np.ascontiguousarray(own.T @ (weight[:, None] * targets)))
    return solved


def _laplacian(side: int) -> csr_matrix:
    from scipy.sparse import diags, identity, kron

    second = diags([1.0, -2.0, 1.0], [-1, 0, 1], shape=(side, side))
    return (kron(second, identity(side)) + kron(identity(side), second)).tocsr()
