"""Fit a chart: solve for control points, measure neutral and every shape, add points where they are off, repeat."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from surface.base.arrays import Floats
from surface.fit.points.net import Net, coarse_places, keys, level_caps, net_at, wanted_places
from surface.fit.points.solve import basis, solve
from surface.fit.source.chart import Chart
from surface.fit.source.mesh import FitMesh


@dataclass(frozen=True)
class FitRequest:
    """How finely and how smoothly a chart is fitted.

    points : most control points; coarse : spacing of the first net, in tiles; deepest : its finest level.
    neutral_mm, shape_mm : errors of neutral and shapes that count as 1; fair : weight of fairness.
    growth : most factor by which the net grows between two solves.
    finest : least spacing of a net, in spacings of the mesh's vertices.
    """

    points: int
    coarse: float = 1 / 10
    deepest: int = 8
    neutral_mm: float = 0.25
    shape_mm: float = 0.3
    fair: float = 1e-4
    growth: float = 1.25
    finest: float = 1.2


@dataclass(frozen=True)
class Fitted:
    """A fitted chart.

    net : the knots; points : (n, 3); moves : (k, n, 3), one displacement field per shape.
    error : (m,) neutral error at the chart's samples, mm; shape_error : (k, m).
    """

    net: Net
    points: Floats
    moves: Floats
    error: Floats
    shape_error: Floats


def fit_chart(
    mesh: FitMesh, chart: Chart, request: FitRequest, report: Callable[[float], None] = lambda _: None
) -> Fitted:
    """Control points for neutral and shapes of one chart; ``report`` is called with the fraction done."""
    targets = _targets(mesh, chart.mix)
    slopes = None
    if chart.slopes is not None:
        slopes = chart.slopes, _targets(mesh, chart.slopes.mix_u), _targets(mesh, chart.slopes.mix_v)
    net = net_at(coarse_places(chart.uv, request.coarse), request.coarse, chart.cuts, chart.uv)
    while True:
        b = basis(net, chart.uv)
        fitted = _measured(net, b, targets, solve(net, b, chart.weight, targets, request.fair, slopes))
        report(min(1.0, len(net) / request.points))
        room = request.points - len(net)
        if room <= 0:
            return fitted
        net, grown = _grow(net, chart, need(chart, fitted, request), request, room)
        if not grown:
            return fitted


def _targets(mesh: FitMesh, mix: csr_matrix) -> Floats:
    """(m, 3 (1 + k)): neutral and shape displacements at rows of ``mix``."""
    return np.hstack([mix @ mesh.vertices, *(mix @ d for d in mesh.deltas)])


def _measured(net: Net, b: csr_matrix, targets: Floats, x: Floats) -> Fitted:
    off = np.linalg.norm((b @ x - targets).reshape(len(targets), -1, 3), axis=2)
    x3 = x.reshape(len(net), -1, 3)
    return Fitted(net, x3[:, 0].copy(), x3[:, 1:].transpose(1, 0, 2).copy(), off[:, 0], off[:, 1:].T)


def need(chart: Chart, fitted: Fitted, request: FitRequest) -> Floats:
    """(m,) error of each sample, 1 = just good enough; the worse of neutral and the worst shape."""
    worst = fitted.shape_error.max(axis=0) if len(fitted.shape_error) else np.zeros_like(fitted.error)
    return np.minimum(chart.weight, 1.0) * np.maximum(fitted.error / request.neutral_mm, worst / request.shape_mm)


def _grow(net: Net, chart: Chart, error: Floats, request: FitRequest, room: int) -> tuple[Net, bool]:
    """The net with the most wanted points, at most a share of those it has; and whether there were any."""
    caps = level_caps(request.finest * chart.spacing, request.coarse, request.deepest)
    places = wanted_places(net, chart.uv, caps, error, request.coarse)
    quota = min(room, max(12, int(len(net) * (request.growth - 1))))
    fresh = places[~np.isin(keys(places), keys(net.place))][: 2 * quota]
    added = net_at(fresh, request.coarse, chart.cuts, chart.uv)
    rank = dict(zip(keys(fresh).tolist(), range(len(fresh)), strict=True))
    chosen = np.argsort([rank[k] for k in keys(added.place).tolist()], kind="stable")[:quota]
    return net.joined(added.take(chosen)), len(chosen) > 0
