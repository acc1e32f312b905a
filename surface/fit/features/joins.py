"""Find the seams between fitted charts: runs of mesh edges that occur in two border loops, or twice in one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.fit.source.chart import Chart
from surface.head.model.data import Seam


class _Loop(NamedTuple):
    part: str
    vertices: Ints
    uv: Floats


class _Pair(NamedTuple):
    """A mesh edge in two places: edge ``i`` of loop ``a`` is edge ``j`` of loop ``b``, in reverse if ``back``."""

    a: int
    i: int
    b: int
    j: int
    back: bool


def find_seams(charts: dict[str, Chart]) -> list[Seam]:
    """Seams between all parts, the part that comes first being the master; also within one part."""
    loops = [
        _Loop(name, vertices, uv)
        for name, chart in charts.items()
        for vertices, uv in zip(chart.loop_vertices, chart.loops, strict=True)
    ]
    runs: list[list[_Pair]] = []
    for pair in _pairs(loops):
        if runs and _follows(runs[-1][-1], pair, loops):
            runs[-1].append(pair)
        else:
            runs.append([pair])
    return [_seam(run, loops) for run in _closed(runs, loops)]


def _pairs(loops: list[_Loop]) -> list[_Pair]:
    """Edges that occur twice, in the order of the first loop they are in."""
    places: dict[tuple[int, ...], list[tuple[int, int]]] = {}
    for k, loop in enumerate(loops):
        edges = np.sort(np.column_stack([loop.vertices, np.roll(loop.vertices, -1)]), axis=1)
        for i, edge in enumerate(edges.tolist()):
            places.setdefault(tuple(edge), []).append((k, i))
    twice = [(*both[0], *both[1]) for both in places.values() if len(both) == 2]
    return sorted(_Pair(a, i, b, j, bool(loops[a].vertices[i] != loops[b].vertices[j])) for a, i, b, j in twice)


def _follows(before: _Pair, after: _Pair, loops: list[_Loop]) -> bool:
    """Is ``after`` the next edge of the same run on both sides?"""
    if (before.a, before.b, before.back) != (after.a, after.b, after.back):
        return False
    n_a, n_b = len(loops[before.a].vertices), len(loops[before.b].vertices)
    step = -1 if before.back else 1
    return (before.i + 1) % n_a == after.i and (before.j + step) % n_b == after.j


def _closed(runs: list[list[_Pair]], loops: list[_Loop]) -> list[list[_Pair]]:
    """Runs, those that go on over their loop's first point joined to the run that starts there."""
    out: list[list[_Pair]] = []
    for run in runs:
        other = next((k for k, o in enumerate(out) if _follows(run[-1], o[0], loops)), None)
        if other is None:
            out.append(run)
        else:
            out[other] = run + out[other]
    return out


def _seam(run: list[_Pair], loops: list[_Loop]) -> Seam:
    a, b = loops[run[0].a], loops[run[0].b]
    rows_a = np.array([p.i for p in run] + [(run[-1].i + 1) % len(a.vertices)])
    first, last = (1, 0) if run[0].back else (0, 1)
    rows_b = np.array([(p.j + first) % len(b.vertices) for p in run] + [(run[-1].j + last) % len(b.vertices)])
    return Seam(a.part, b.part, a.uv[rows_a], b.uv[rows_b])
