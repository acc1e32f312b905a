"""Find the seams between fitted charts: runs of border that two loops share."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from surface.fit.chart import Chart
from surface.head.data import Seam

SHORTEST = 2  # points a shared run must have


def find_seams(charts: dict[str, Chart]) -> list[Seam]:
    """Seams between all parts, the part that comes first being the master; also between islands of one part."""
    loops = [
        (name, vertices, uv)
        for name, chart in charts.items()
        for vertices, uv in zip(chart.loop_vertices, chart.loops, strict=True)
    ]
    seams = []
    for (name_a, va, ua), (name_b, vb, ub) in combinations(loops, 2):
        place_b = {int(v): i for i, v in enumerate(vb)}
        for run in _runs(va, vb, place_b):
            rows_b = np.array([place_b[int(va[i])] for i in run])
            seams.append(Seam(name_a, name_b, ua[run], ub[rows_b]))
    return seams


def _runs(va: NDArray[np.int64], vb: NDArray[np.int64], place_b: dict[int, int]) -> list[NDArray[np.int64]]:
    """Runs of rows of loop a whose steps are steps of loop b too."""
    n = len(va)
    joined = np.array([_adjacent(int(va[i]), int(va[(i + 1) % n]), place_b, len(vb)) for i in range(n)])
    if not joined.any():
        return []
    if joined.all():
        return [np.arange(n + 1) % n]
    first = int(np.flatnonzero(~joined)[0]) + 1
    order = (first + np.arange(n)) % n
    runs, current = [], [order[0]]
    for i in order:
        if joined[i]:
            current.append((i + 1) % n)
            continue
        runs.append(np.array(current))
        current = [(i + 1) % n]
    runs.append(np.array(current))
    return [r for r in runs if len(r) >= SHORTEST]


def _adjacent(a: int, b: int, place: dict[int, int], n: int) -> bool:
    if a not in place or b not in place:
        return False
    return abs(place[a] - place[b]) in (1, n - 1)
