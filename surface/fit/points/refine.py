"""Fit a chart: solve for control points, measure neutral and every shape, add points where they are off, repeat.

Then look between the samples. Where the surface strays there, places between the samples become samples, too; the net
may become finer there; and control points around are held to their neighbours, positions and displacements alike, ever
more strongly, until nothing strays.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix, vstack

from surface.base.arrays import Bools, Floats
from surface.fit.points.calm import Calm, beside, samples_of
from surface.fit.points.dense import around, bounded, dense_errors, places_of
from surface.fit.points.net import Net, coarse_places, keys, level_caps, net_at, wanted_places
from surface.fit.points.solve import basis, solve
from surface.fit.source.chart import Chart, Places
from surface.fit.source.mesh import FitMesh

HOLD_WEIGHTS = (1.0, 30.0, 1e3, 3e4)  # how strongly points around outliers are held, one round after another
FAR_FACTOR = 1.5  # of the error that is mended: control points beyond it are clamped to the mesh's own range
MAX_RMS_FACTOR = 1.25  # of the RMS of the first fit: the price elsewhere that mending a spike may have
ROOMS = (3.2, 2.3, 1.6, 1.0, 0.7)  # errors that a calmer surface may have, in those that count as 1, tried in turn
BOUNDS = (1.0, 3.2, 0.32)  # of RMS, of 99 in 100 samples and of shapes' RMS, relative to that of the RMS
KEPT = 0.995  # of the bounds: what a calmer surface may reach
CALM_ROUNDS = 4  # of finding out where the surface may be calm
MAX_LOSS = 1.05  # factor by which errors that are larger than wanted may grow for that
MIN_PROGRESS = 0.9  # of the number of outliers, or of the largest error: a round that leaves more is the last


@dataclass(frozen=True)
class FitRequest:
    """How finely and how smoothly a chart is fitted.

    points : most control points; coarse : spacing of the first net, in tiles; deepest : its finest level.
    neutral_mm, shape_mm : errors of neutral and shapes that count as 1; fair : weight of fairness.
    bend : weight of bending within faces of the mesh, where it says nothing of the form, relative to that of slopes.
    calm_mm : RMS of neutral up to which the surface is made calmer than the mesh's faces, see
        :mod:`surface.fit.points.calm`; 0 : it is not.
    growth : most factor by which the net grows between two solves.
    finest : least spacing of a net, in spacings of the mesh's vertices.
    astray_mm : where the surface is further off, also between samples, it is mended; spare : points kept for that.
    dense : are places between the samples samples from the start? For a coarse mesh, whose few vertices leave room for
        bulges in between.
    """

    points: int
    coarse: float = 1 / 10
    deepest: int = 8
    neutral_mm: float = 0.25
    shape_mm: float = 0.3
    fair: float = 1e-4
    bend: float = 0.0
    calm_mm: float = 0.0
    growth: float = 1.25
    finest: float = 1.2
    astray_mm: float = 2.5
    spare: int = 0
    dense: bool = False


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
    net = net_at(coarse_places(chart.uv, request.coarse), request.coarse, chart.cuts, chart.uv)
    first = replace(request, points=request.points - request.spare)
    share = first.points / request.points
    if chart.between is None:
        return _refined(mesh, chart, net, first, Hold(), lambda done: report(share * done))
    within = _with_samples(chart, chart.between.take(~chart.between.folded)) if request.dense else chart
    fitted = _refined(mesh, within, net, first, Hold(), lambda done: report(share * done))
    return _mended(mesh, chart, within, _on(mesh, chart, fitted), request, report)


@dataclass(frozen=True)
class Hold:
    """Where control points are held to their neighbours: those that reach any of places ``uv (d, 2)``, ``factor`` times
    as strongly as all others."""

    uv: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    factor: float = 1.0

    def fair(self, net: Net, usual: float) -> Floats:
        """(n,) weight of fairness of every control point."""
        reached = basis(net, self.uv).getnnz(axis=0) > 0 if len(self.uv) else np.zeros(len(net), bool)
        return np.where(reached, self.factor, 1.0) * usual


def _refined(
    mesh: FitMesh, chart: Chart, net: Net, request: FitRequest, hold: Hold, report: Callable[[float], None]
) -> Fitted:  # fmt: skip
    """Solve, and add points where samples are off, until none is or there are enough points."""
    targets, slopes = samples_of(mesh, chart.mix), None
    if chart.slopes is not None:
        slopes = chart.slopes, samples_of(mesh, chart.slopes.mix_u), samples_of(mesh, chart.slopes.mix_v)
    while True:
        b = basis(net, chart.uv)
        solved = solve(net, b, chart.weight, targets, hold.fair(net, request.fair), slopes, request.bend)
        fitted = _measured(net, b, targets, solved)
        report(min(1.0, len(net) / request.points))
        room = request.points - len(net)
        if room <= 0:
            break
        net, grown = _grow(net, chart, need(chart, fitted, request), request, room)
        if not grown:
            break
    return _calmed(mesh, chart, fitted, request, hold) if request.calm_mm > 0.0 else fitted


def _calmed(mesh: FitMesh, chart: Chart, fitted: Fitted, request: FitRequest, hold: Hold) -> Fitted:
    """The fit with the same net, as calm as the bounds of its errors allow; as it was where they allow nothing."""
    if chart.slopes is None:
        return fitted
    calm = Calm(mesh, chart, fitted.net, hold.fair(fitted.net, request.fair), request.bend)
    most = np.maximum(KEPT * request.calm_mm * np.array(BOUNDS), bounded_errors(chart, fitted))
    for room in ROOMS:
        trial = _calmed_within(room, calm, fitted, request)
        if (bounded_errors(chart, trial) <= most).all():
            return trial
    return fitted


def _calmed_within(room: float, calm: Calm, fitted: Fitted, request: FitRequest) -> Fitted:
    """The fit, calm wherever no error grows above ``room``, in errors that count as 1, or much above what it was.

    Where one does, and around there if that is not enough, the surface follows the mesh's faces as before.
    """
    chart, net = calm.chart, calm.net
    targets, rows = samples_of(calm.mesh, chart.mix), basis(net, chart.uv)
    before = need(chart, fitted, request)  # less on lids, through which an eyeball would come
    strict = before > room
    for _ in range(CALM_ROUNDS):
        trial = _measured(net, rows, targets, calm.solved(rows, targets, strict))
        worse = need(chart, trial, request) > np.maximum(room, MAX_LOSS * before)
        if not worse.any():
            break
        strict = strict | (worse if (worse & ~strict).any() else beside(chart, worse))
    return trial


def bounded_errors(chart: Chart, fitted: Fitted) -> Floats:
    """(3,) mm, what has bounds: RMS and 99th percentile of neutral and the mean of shapes' RMS, outside folds."""
    counted = ~chart.folded
    if not counted.any():
        return np.zeros(len(BOUNDS))
    off, shapes = fitted.error[counted], fitted.shape_error[:, counted]
    mean = np.sqrt((shapes**2).mean(axis=1)).mean() if len(shapes) else 0.0
    return np.array([np.sqrt((off**2).mean()), np.percentile(off, 99), mean])


def _mended(
    mesh: FitMesh, chart: Chart, within: Chart, fitted: Fitted, request: FitRequest, report: Callable[[float], None]
) -> Fitted:  # fmt: skip
    """The fit without spikes between its samples; the errors that come with it are those of the chart's own samples.

    within : the chart with the samples that it was fitted to.
    """
    held = np.zeros((0, 2))
    places, best, enough = places_of(chart, mesh), fitted, MAX_RMS_FACTOR * _rms(mesh, chart, fitted)
    count, most = len(places.uv) + 1, np.inf
    for factor in HOLD_WEIGHTS:
        strays = _strays(mesh, chart, fitted, request.astray_mm)
        if not strays.any():
            return fitted
        now = _most(mesh, chart, fitted)
        if strays.sum() > MIN_PROGRESS * count and now > MIN_PROGRESS * most:
            break
        count, most = int(strays.sum()), now
        held = np.concatenate([held, places.uv[strays]])
        within = _with_samples(within, places.take(around(places, places.mix[np.flatnonzero(strays)])))
        fitted = _on(mesh, chart, _refined(mesh, within, fitted.net, request, Hold(held, factor), report))
        if _rms(mesh, chart, fitted) <= enough:
            best = min(best, fitted, key=lambda f: _most(mesh, chart, f))
    off = dense_errors(mesh, chart, best.net, best.points, best.moves)
    far = np.maximum(off.neutral, off.worst) > FAR_FACTOR * request.astray_mm
    points, moves = bounded(mesh, chart, best.net, best.points, best.moves, far)
    put = _on(mesh, chart, replace(best, points=points, moves=moves))
    better = _most(mesh, chart, put) < _most(mesh, chart, best) and _rms(mesh, chart, put) <= enough
    return put if better else best


def _rms(mesh: FitMesh, chart: Chart, fitted: Fitted) -> float:
    """RMS (mm) of the neutral face outside folds, at the chart's samples and between them: where there are more points
    than samples, these alone are met at the cost of what lies between."""
    between = dense_errors(mesh, chart, fitted.net, fitted.points, fitted.moves[:0]).neutral
    off = np.concatenate([fitted.error[~chart.folded], between[~places_of(chart, mesh).folded]])
    return float(np.sqrt((off**2).mean())) if len(off) else 0.0


def _most(mesh: FitMesh, chart: Chart, fitted: Fitted) -> float:
    """The largest error (mm) of a chart in neutral and all shapes, at its samples and between them, outside folds."""
    samples = np.vstack([fitted.error[None], fitted.shape_error])[:, ~chart.folded].max(initial=0.0)
    return max(float(samples), dense_errors(mesh, chart, fitted.net, fitted.points, fitted.moves).most)


def _strays(mesh: FitMesh, chart: Chart, fitted: Fitted, most_mm: float) -> Bools:
    """(d,) places between samples where the surface is too far from the mesh, there or at a sample beside."""
    off = dense_errors(mesh, chart, fitted.net, fitted.points, fitted.moves)
    worst = fitted.shape_error.max(axis=0) if len(fitted.shape_error) else np.zeros_like(fitted.error)
    samples = np.maximum(np.where(chart.folded, 0.0, fitted.error), worst) > most_mm
    here = np.maximum(off.neutral, off.worst) > most_mm
    return here | around(places_of(chart, mesh), chart.mix[np.flatnonzero(samples)])


def _on(mesh: FitMesh, chart: Chart, fitted: Fitted) -> Fitted:
    """The same control points, with the errors that they have at the chart's own samples."""
    x = np.concatenate([fitted.points[:, None], fitted.moves.transpose(1, 0, 2)], axis=1).reshape(len(fitted.net), -1)
    return _measured(fitted.net, basis(fitted.net, chart.uv), samples_of(mesh, chart.mix), x)


def _with_samples(chart: Chart, places: Places) -> Chart:
    """The chart with places as further samples, of full weight wherever they lie."""
    rows = {
        "uv": places.uv, "weight": np.ones(len(places.uv)), "spacing": places.spacing,
        "folded": np.zeros(len(places.uv), bool),
    }  # fmt: skip
    joined: dict[str, Any] = {k: np.concatenate([getattr(chart, k), v]) for k, v in rows.items()}
    if chart.importance is not None:
        joined["importance"] = np.concatenate([chart.importance, np.ones(len(places.uv))])
    return replace(chart, mix=vstack([chart.mix, places.mix]).tocsr(), **joined)


def _measured(net: Net, b: csr_matrix, targets: Floats, x: Floats) -> Fitted:
    off = np.linalg.norm((b @ x - targets).reshape(len(targets), -1, 3), axis=2)
    x3 = x.reshape(len(net), -1, 3)
    return Fitted(net, x3[:, 0].copy(), x3[:, 1:].transpose(1, 0, 2).copy(), off[:, 0], off[:, 1:].T)


def need(chart: Chart, fitted: Fitted, request: FitRequest) -> Floats:
    """(m,) error of each sample, 1 = just good enough; the worse of neutral and the worst shape."""
    worst = fitted.shape_error.max(axis=0) if len(fitted.shape_error) else np.zeros_like(fitted.error)
    importance = 1.0 if chart.importance is None else chart.importance
    return (
        importance
        * np.minimum(chart.weight, 1.0)
        * np.maximum(fitted.error / request.neutral_mm, worst / request.shape_mm)
    )


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
