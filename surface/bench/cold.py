"""Benchmarks with cold caches, as in a real frame, where drawing the previous picture has evicted the engine's data.

Every round calls each function once, and a ratio is the median of the ratios of the single rounds, so that a temporary
slowdown of the machine affects both sides of it. Rounds are repeated until the confidence interval of each median is
narrower than ``MAX_RELATIVE_WIDTH``, or until time is up. A bound counts as met only if the whole interval meets it, so
that noise cannot make a row pass.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from surface.base.arrays import Floats, Floats32
from surface.dcp import DCPSurface
from surface.deform.deformation import Deformation
from surface.deform.fixed import take_all
from surface.deform.lists import build_lists
from surface.mesh.domain import Domain
from surface.mesh.mesh import Mesh

from . import peers
from .bench import Measure, Report, no_report

MAX_RELATIVE_WIDTH = 0.06  # of a median's confidence interval, relative to the median
MIN_ROUNDS = 12
MAX_TIME_FACTOR = 12.0  # all rounds together take at most this many times the seconds given for one row
FLUSHED_BYTES = 1 << 26  # written between two calls: more than the caches of most processors hold
Call = Callable[[], object]
Case = tuple[DCPSurface, Mesh]
"""A surface and a mesh of it."""
READ, FULL = "one read of the plain weights", "all positions"
FULL_BOUND = "<= 2.0"  # default bound for all positions, as a multiple of one read of the weights
ZEROS = "weights that are zero"


class Ratio(NamedTuple):
    """One row: the time of one call of :func:`cold_rows` divided by that of another, both given by their index.

    against : name of the divisor. bound : as of a ``Measure``; None for the bound that :func:`cold_rows` is given.
    """

    title: str
    dividend: int
    divisor: int
    against: str
    bound: str | None


RATIOS = (
    Ratio(FULL, 1, 0, READ, None),
    Ratio(f"{FULL} and normals", 2, 1, FULL, ""),
    Ratio("scipy CSR @ dense", 3, 1, FULL, ">= 5"),
    Ratio("stencil table, row by row", 4, 1, FULL, ">= 2"),
)


def cold_times(
    calls: Sequence[Call], seconds: float, flushed: int = FLUSHED_BYTES, pairs: Sequence[tuple[int, int]] = ()
) -> Floats:
    """Return the times (rounds, k), ms, of k calls in turn; ``flushed`` bytes are written elsewhere before each call.

    Rounds stop once the median ratios of all ``pairs`` of calls are known well enough (:data:`MAX_RELATIVE_WIDTH`), or
    after ``seconds``, but not before :data:`MIN_ROUNDS`.
    """
    flush_buffer, rounds = np.ones(max(flushed // 8, 1)), list[list[float]]()
    for call in calls:
        call()
    end = time.perf_counter() + seconds
    while len(rounds) < MIN_ROUNDS or (time.perf_counter() < end and not _are_steady(np.array(rounds), pairs)):
        row = []
        for call in calls:
            flush_buffer += 1.0
            begin = time.perf_counter()
            call()
            row.append(1e3 * (time.perf_counter() - begin))
        rounds.append(row)
    return np.array(rounds)


def median_interval(values: Floats) -> tuple[float, float, float]:
    """Return the median of (n,) values and the ends of its 95 % confidence interval, by ranks (Conover 1999, 3.2)."""
    ordered, n = np.sort(values), len(values)
    half_width = 0.98 * np.sqrt(n)  # in ranks: 1.96 standard deviations of a binomial variable, sqrt(n) / 2 each
    low, high = int(max(np.floor(n / 2 - half_width), 0)), int(min(np.ceil(n / 2 + half_width), n - 1))
    return float(np.median(ordered)), float(ordered[low]), float(ordered[high])


def _are_steady(times: Floats, pairs: Sequence[tuple[int, int]]) -> bool:
    """Whether the confidence intervals of all pairs' median ratios are narrow enough."""
    for a, b in pairs:
        median, low, high = median_interval(times[:, a] / times[:, b])
        if high - low > MAX_RELATIVE_WIDTH * median:
            return False
    return True


def cold_rows(
    name: str, cases: Sequence[Case], seconds: float, full_bound: str = FULL_BOUND, flushed: int = FLUSHED_BYTES,
    report: Report = no_report,
) -> list[Measure]:  # fmt: skip
    """Measure the evaluation of surfaces with cold caches, and the memory of their weights.

    The rows compare computing all positions with one read of the plain weights, and two reference implementations with
    computing all positions. Each row is the sum over all ``cases``.

    full_bound : bound for all positions, as a multiple of one read of the weights.
    """
    report(name)
    weights = [build_lists(*case, False).value for case in cases]
    plain, full = ([s.deformation(m, normals=wanted) for s, m in cases] for wanted in (False, True))
    calls = [
        _chain([w.sum for w in weights]), _chain([d.refresh for d in plain]), _chain([d.refresh for d in full]),
        _chain([peers.sparse_matrix(*case) for case in cases]), _chain([peers.stencils(*case) for case in cases]),
    ]  # fmt: skip
    with peers.one_thread():
        times = cold_times(calls, MAX_TIME_FACTOR * seconds, flushed, [(r.dividend, r.divisor) for r in RATIOS])
    rows = [Measure(f"{name}: {READ}", float(np.median(times[:, 0])))]
    for title, dividend, divisor, against, bound in RATIOS:
        ratio, low, high = median_interval(times[:, dividend] / times[:, divisor])
        took = float(np.median(times[:, dividend]))
        limit = full_bound if bound is None else bound
        rows.append(Measure(f"{name}: {title}", took, ratio, against, limit, (low, high)))
    nonzero = sum(4 * int(np.count_nonzero(w)) for w in weights)
    size = sum(d.nbytes for d in plain) / nonzero
    return [
        *rows,
        Measure(f"{name}: memory of weights and lists", 0.0, size, "the weights that are not zero"),
        Measure(f"{name}: {ZEROS}", 0.0, zero_fraction(plain), "all that are kept one by one", "<= 0.2"),
    ]


def zero_fraction(deformations: Sequence[Deformation[DCPSurface]]) -> float:
    """Return which fraction of the individually stored weights is zero; 0 if there are none.

    Weights that are stored as factors do not count.
    """
    kept = [t for d in deformations for t in (d.lists.value[: d.lists.used], _packed_weights(d))]
    total = sum(len(table) for table in kept)
    return 1.0 - sum(int(np.count_nonzero(table)) for table in kept) / total if total else 0.0


def _packed_weights(deformation: Deformation[DCPSurface]) -> Floats32:
    """Return (k,): all packed weights of a deformation, each times a power of two."""
    packed = deformation.storage.packed
    return take_all(packed.packed, 0, len(packed.entry_row)).ravel()


def _chain(calls: Sequence[Call]) -> Call:
    """Return a call that makes all ``calls``, one after the other."""

    def run() -> None:
        for call in calls:
            call()

    return run


def hierarchical(vertices: int = 50_000) -> tuple[DCPSurface, Mesh]:
    """Return a bicubic surface of three nested levels and a mesh of about so many vertices.

    The second level covers half the width of the first, the third a quarter, with half the knot spacing each. Blending
    functions of a level that lie wholly in the next one's region are left out, as in hierarchical B-splines.
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
    return surface, _tessellate(surface, vertices)


def scattered(count: int = 2_000, vertices: int = 50_000) -> tuple[DCPSurface, Mesh]:
    """Return a surface of about ``count`` scattered control points over the unit square, and a mesh of it.

    Every control point has knots of its own.
    """
    rng, side = np.random.default_rng(5), max(4, round(np.sqrt(count)))
    grid = np.stack(np.meshgrid(np.arange(-1, side + 1), np.arange(-1, side + 1), indexing="ij"), axis=-1)
    middle = (grid.reshape(-1, 2) + 0.5 + rng.uniform(-0.3, 0.3, (grid.size // 2, 2))) / side
    offsets = np.array([-2.0, -1.0, 0.0, 1.0, 2.0]) + rng.uniform(-0.3, 0.3, (len(middle), 2, 5))
    knots = middle[:, :, None] + np.sort(offsets, axis=-1) / side
    points = np.array([_hill(u, v) for u, v in middle])
    surface = DCPSurface(points, rng.uniform(0.5, 2.0, len(points)), list(knots[:, 0]), list(knots[:, 1]))
    return surface, _tessellate(surface, vertices)


def _hill(u: float, v: float) -> tuple[float, float, float]:
    """Return the point of a bumpy square, 200 wide, at (u, v)."""
    return 200.0 * u, 200.0 * v, float(20.0 * np.sin(10.0 * u) * np.cos(8.0 * v))


def _tessellate(surface: DCPSurface, vertices: int) -> Mesh:
    """Return a uniform mesh of the unit square with about so many vertices.

    The depth is the same everywhere, so the required limit of control points per cell has no effect.
    """
    level = max(1, round(np.log2(np.sqrt(vertices))))
    return surface.tessellate(max_points=40, min_depth=level, max_depth=level, domain=Domain((0.0, 1.0, 0.0, 1.0)))
