"""Convert a recipe's paint, given by mesh vertices, to lines in (u, v) of the fitted part."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from surface.base.arrays import Floats, Ints
from surface.fit.source.chart import Chart
from surface.fit.source.mesh import FitMesh

PIECES = 6  # points per vertex of a smooth line


def make_paint(layers: list[dict[str, Any]], charts: dict[str, Chart], mesh: FitMesh) -> list[dict[str, Any]]:
    """Layers for head.toml; those of parts that were not fitted are left out."""
    return [_layer(layer, charts[layer["part"]], mesh) for layer in layers if layer["part"] in charts]


def _layer(layer: dict[str, Any], chart: Chart, mesh: FitMesh) -> dict[str, Any]:
    out = {k: v for k, v in layer.items() if k not in ("lines", "mirror", "hole")}
    if layer["kind"] == "hole":
        out["kind"] = "region"
        lines = [chart.loops[1 + layer["hole"]]]
    elif layer["kind"] == "all":
        return out
    else:
        ids = [np.array(line) for line in layer["lines"]]
        if layer.get("mirror"):
            ids += [mirrored(chart, mesh, line) for line in ids]
        lines = [vertex_line(chart, mesh, line, closed=layer["kind"] == "region") for line in ids]
    return out | {"lines": [np.round(line, 5).tolist() for line in lines]}


def mirrored(chart: Chart, mesh: FitMesh, ids: Ints) -> Ints:
    """The chart's vertices on the other side of the face."""
    own = np.unique(chart.mix.indices)
    nearest: Ints = own[cKDTree(mesh.vertices[own]).query(mesh.vertices[ids] * [-1.0, 1.0, 1.0])[1]]
    return nearest


def vertex_line(chart: Chart, mesh: FitMesh, ids: Ints, *, closed: bool) -> Floats:
    """A smooth line through vertices, in (u, v)."""
    if len(ids) > 2 and not closed:
        return uv_of(chart, mesh, smooth_line(mesh.vertices[ids], closed=False))
    uv = np.array([chart.uv[vertex_row(chart, int(v))] for v in ids])
    return smooth_line(uv, closed=True) if closed else uv


def uv_of(chart: Chart, mesh: FitMesh, points: Floats) -> Floats:
    """(m, 2) places in (u, v) of points (m, 3) near the mesh, from the samples around each."""
    samples = chart.mix @ mesh.vertices
    distance, nearest = cKDTree(samples).query(points, k=6)
    weight = 1.0 / (distance**2 + 0.05)
    uv: Floats = (weight[..., None] * chart.uv[nearest]).sum(axis=1) / weight.sum(axis=1, keepdims=True)
    return uv


def vertex_row(chart: Chart, vertex: int) -> int:
    """The chart's sample that is a mesh vertex."""
    column = chart.mix.getcol(vertex).tocoo()
    return int(column.row[np.argmax(column.data)])


def smooth_line(points: Floats, *, closed: bool) -> Floats:
    """Catmull-Rom spline through points (n, k), PIECES points per step."""
    n = len(points)
    steps = n if closed else n - 1
    padded = points if closed else np.vstack([2 * points[0] - points[1], points, 2 * points[-1] - points[-2]])
    t = np.linspace(0.0, 1.0, PIECES, endpoint=False)[:, None]
    out = []
    for i in range(steps):
        a, b, c, d = (padded[(i + k - closed) % len(padded)] for k in range(4))
        out.append(0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * (b - c) + d - a) * t**3))
    return np.vstack(out if closed else [*out, points[-1:]])


def arc_length(line: Floats) -> Floats:
    """How far each point of a line of points (k, n) lies along it, (k,), from 0, in their unit."""
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))


def evenly(line: Floats, count: int) -> Floats:
    """(count, n) points along a line of points (k, n), as far apart along it."""
    length = arc_length(line)
    at = np.linspace(0.0, length[-1], count)
    return np.column_stack([np.interp(at, length, x) for x in line.T])
