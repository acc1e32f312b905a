"""The engine as a frame sees it: caches are cold, since the frame before drew a picture, and rows take turns.

A ratio is the median of the ratios of single rounds, in which every row is called once, so that what slows the machine
for a while slows both sides. Rounds go on until the median is known to ``WIDTH``, or time is up; a bound is kept only
where the whole confidence interval keeps it, so that noise cannot pass one.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from surface.base.arrays import Floats
from surface.dcp import DCPSurface
from surface.deform.deformation import Deformation
from surface.deform.lists import build_lists
from surface.mesh.domain import Domain
from surface.mesh.mesh import Mesh

from . import peers
from .bench import Measure, Report, no_report

WIDTH = 0.06  # of a median: how far apart the ends of its interval may lie
LEAST_ROUNDS = 12
MOST_SHARE = 12.0  # of the seconds for a row: what all rounds may take where medians stay unsteady
FLUSHED_BYTES = 1 << 26  # written between two calls: more than the caches of most processors hold
Call = Callable[[], object]
Body = tuple[DCPSurface, Mesh]
READ, FULL = "one read of the plain weights", "all positions"
REACH = "<= 2.0"
ZEROS = "weights that are zero"
RATIOS = (
    (FULL, (1, 0), READ, ""),
    (f"{FULL} and normals", (2, 1), FULL, ""),
    ("scipy CSR @ dense", (3, 1), FULL, ">= 5"),
    ("stencil table, row by row", (4, 1), FULL, ">= 2"),
)
"""Titles, which call is divided by which, what the second is, and the bound, which the first row is given."""


def cold_times(
    calls: Sequence[Call], seconds: float, flushed: int = FLUSHED_BYTES, pairs: Sequence[tuple[int, int]] = ()
) -> Floats:
    """(rounds, k) times in ms of k calls in turn, each after ``flushed`` bytes were written elsewhere.

    Rounds stop once the median ratios of all ``pairs`` of calls are known to :data:`WIDTH`, or after ``seconds``.
    """
    other, rounds = np.ones(max(flushed // 8, 1)), list[list[float]]()
    for call in calls:
        call()
    end = time.perf_counter() + seconds
    while len(rounds) < LEAST_ROUNDS or (time.perf_counter() < end and not _steady(np.array(rounds), pairs)):
        row = []
        for call in calls:
            other += 1.0
            begin = time.perf_counter()
            call()
            row.append(1e3 * (time.perf_counter() - begin))
        rounds.append(row)
    return np.array(rounds)


def median_interval(values: Floats) -> tuple[float, float, float]:
    """The median of ``values (n,)`` and the ends of its 95 % confidence interval, by ranks (Conover 1999, 3.2)."""
    ordered, n = np.sort(values), len(values)
    reach = 0.98 * np.sqrt(n)
    low, high = int(max(np.floor(n / 2 - reach), 0)), int(min(np.ceil(n / 2 + reach), n - 1))
    return float(np.median(ordered)), float(ordered[low]), float(ordered[high])


def _steady(times: Floats, pairs: Sequence[tuple[int, int]]) -> bool:
    """Are the median ratios of all pairs known well enough?"""
    for a, b in pairs:
        median, low, high = median_interval(times[:, a] / times[:, b])
        if high - low > WIDTH * median:
            return False
    return True


def cold_rows(
    name: str, bodies: Sequence[Body], seconds: float, reach: str = REACH, flushed: int = FLUSHED_BYTES,
    report: Report = no_report,
) -> list[Measure]:  # fmt: skip
    """All positions of surfaces together against a read of their plain weights, and two peers against all positions;
    what the weights take up.

    reach : the bound for the first of these.
    """
    report(name)
    weights = [build_lists(*body, False).value for body in bodies]
    plain, full = ([s.deformation(m, normals=wanted) for s, m in bodies] for wanted in (False, True))
    calls = [
        _each([w.sum for w in weights]), _each([d.refresh for d in plain]), _each([d.refresh for d in full]),
        _each([peers.sparse_matrix(*body) for body in bodies]), _each([peers.stencils(*body) for body in bodies]),
    ]  # fmt: skip
    with peers.one_thread():
        times = cold_times(calls, MOST_SHARE * seconds, flushed, [pair for _, pair, _, _ in RATIOS])
    rows = [Measure(f"{name}: {READ}", float(np.median(times[:, 0])))]
    for title, (a, b), against, bound in RATIOS:
        ratio, low, high = median_interval(times[:, a] / times[:, b])
        rows.append(
            Measure(
                f"{name}: {title}", float(np.median(times[:, a])), ratio, against, bound if b else reach, (low, high)
            )
        )
    nonzero = sum(4 * int(np.count_nonzero(w)) for w in weights)
    size = sum(d.nbytes for d in plain) / nonzero
    return [
        *rows,
        Measure(f"{name}: memory of weights and lists", 0.0, size, "the weights that are not zero"),
        Measure(f"{name}: {ZEROS}", 0.0, zeros(plain), "all that are kept one by one", "<= 0.2"),
    ]


def zeros(deformations: Sequence[Deformation[DCPSurface]]) -> float:
    """The part of the weights that are kept one by one, not as factors, that is zero; 0 where there are none."""
    kept = [table for d in deformations for table in (d.lists.value[: d.lists.used], d.storage.packed.packed)]
    total = sum(len(table) for table in kept)
    return 1.0 - sum(int(np.count_nonzero(table)) for table in kept) / total if total else 0.0


def _each(calls: Sequence[Call]) -> Call:
    """All calls, one after the other."""

    def run() -> None:
        for call in calls:
            call()

    return run


def hierarchical(vertices: int = 50_000) -> tuple[DCPSurface, Mesh]:
    """A bicubic surface of three nested levels, each half as wide as the one before, with about so many vertices.

    Functions of a level that lie wholly in the next one's region are left out, as in hierarchical B-splines.
    """
    points, knots_u, knots_v = list[tuple[float, float, float]](), list[Floats](), list[Floats]()
    for level, (low, high) in enumerate(((0.0, 1.0), (0.25, 0.75), (0.375, 0.625))):
        spans = 16 << level
        line = np.clip(np.arange(-3, spans + 4) / spans, 0.0, 1.0)
        inner = ((0.25, 0.75), (0.375, 0.625), (2.0, 2.0))[level]
        for i in range(spans + 3):
            for j in range(spans + 3):
                u, v = line[i : i + 5], line[j : j + 5]
                if min(u[0], v[0]) < low or max(u[-1], v[-1]) > high:
                    continue
                if min(u[0], v[0]) >= inner[0] and max(u[-1], v[-1]) <= inner[1]:
                    continue
                points.append(_hill(u[1:4].mean(), v[1:4].mean()))
                knots_u.append(u)
                knots_v.append(v)
    surface = DCPSurface(np.array(points), np.ones(len(points)), knots_u, knots_v)
    return surface, _meshed(surface, vertices)


def scattered(count: int = 2_000, vertices: int = 50_000) -> tuple[DCPSurface, Mesh]:
    """About ``count`` points at random places, each with knots of its own, over the unit square."""
    rng, side = np.random.default_rng(5), max(4, round(np.sqrt(count)))
    grid = np.stack(np.meshgrid(np.arange(-1, side + 1), np.arange(-1, side + 1), indexing="ij"), axis=-1)
    middle = (grid.reshape(-1, 2) + 0.5 + rng.uniform(-0.3, 0.3, (grid.size // 2, 2))) / side
    offsets = np.array([-2.0, -1.0, 0.0, 1.0, 2.0]) + rng.uniform(-0.3, 0.3, (len(middle), 2, 5))
    knots = middle[:, :, None] + np.sort(offsets, axis=-1) / side
    points = np.array([_hill(u, v) for u, v in middle])
    surface = DCPSurface(points, rng.uniform(0.5, 2.0, len(points)), list(knots[:, 0]), list(knots[:, 1]))
    return surface, _meshed(surface, vertices)


def _hill(u: float, v: float) -> tuple[float, float, float]:
    """A place on a bumpy square, 200 wide."""
    return 200.0 * u, 200.0 * v, float(20.0 * np.sin(10.0 * u) * np.cos(8.0 * v))


def _meshed(surface: DCPSurface, vertices: int) -> Mesh:
    """A mesh of the unit square by a quad tree, of about so many vertices, whose lists are about 40 points long."""
    level = max(1, round(np.log2(np.sqrt(vertices))))
    return surface.tessellate(max_points=40, min_depth=level, max_depth=level, domain=Domain((0.0, 1.0, 0.0, 1.0)))
