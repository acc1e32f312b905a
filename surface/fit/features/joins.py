"""Find the seams between fitted charts: runs of border edges that stand in two loops, or twice in one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.fit.source.chart import Chart
from surface.head.model.data import Seam


@dataclass(frozen=True)
class _Loop:
    part: str
    vertices: Ints
    uv: Floats


@dataclass(frozen=True)
class _Pair:
    """One mesh edge in two places: edge ``i`` of loop ``a`` is edge ``j`` of loop ``b``, run through backwards if
    ``back``."""

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
    pairs = _pairs(loops)
    runs: list[list[_Pair]] = []
    for pair in pairs:
        if runs and _follows(runs[-1][-1], pair, loops):
            runs[-1].append(pair)
        else:
            runs.append([pair])
    return [_seam(run, loops) for run in _closed(runs, loops)]


def _pairs(loops: list[_Loop]) -> list[_Pair]:
    """Edges that occur twice, in the order of the first loop they stand in."""
    places: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for k, loop in enumerate(loops):
        for i, (p, q) in enumerate(zip(loop.vertices.tolist(), np.roll(loop.vertices, -1).tolist(), strict=True)):
            places.setdefault((min(p, q), max(p, q)), []).append((k, i))
    out = []
    for both in places.values():
        if len(both) == 2:
            (a, i), (b, j) = both
            out.append(_Pair(a, i, b, j, bool(loops[a].vertices[i] != loops[b].vertices[j])))
    return sorted(out, key=lambda p: (p.a, p.i))


def _follows(before: _Pair, after: _Pair, loops: list[_Loop]) -> bool:
    """Is ``after`` the next edge of the same run on both sides?"""
    if (before.a, before.b, before.back) != (after.a, after.b, after.back):
        return False
    n_a, n_b = len(loops[before.a].vertices), len(loops[before.b].vertices)
    step = -1 if before.back else 1
    return (before.i + 1) % n_a == after.i and (before.j + step) % n_b == after.j


def _closed(runs: list[list[_Pair]], loops: list[_Loop]) -> list[list[_Pair]]:
    """A run that goes on over its loop's first point is joined to the run that starts there."""
    starts = {(run[0].a, run[0].i): k for k, run in enumerate(runs)}
    gone = set()
    for k, run in enumerate(runs):
        other = starts.get((run[-1].a, (run[-1].i + 1) % len(loops[run[-1].a].vertices)))
        if other is not None and other < k and _follows(run[-1], runs[other][0], loops):
            runs[other] = run + runs[other]
            gone.add(k)
    return [run for k, run in enumerate(runs) if k not in gone]


def _seam(run: list[_Pair], loops: list[_Loop]) -> Seam:
    a, b = loops[run[0].a], loops[run[0].b]
    rows_a = np.array([p.i for p in run] + [(run[-1].i + 1) % len(a.vertices)])
    first, last = (1, 0) if run[0].back else (0, 1)
    rows_b = np.array([(p.j + first) % len(b.vertices) for p in run] + [(run[-1].j + last) % len(b.vertices)])
    return Seam(a.part, b.part, a.uv[rows_a], b.uv[rows_b])
