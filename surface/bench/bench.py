"""Benchmarks of the surface engine and of other libraries with warm caches, all in one run on one machine.

Nothing is printed. Times are the minimum of many calls, the most repeatable figure on a machine that does other work.
"""

from __future__ import annotations

import time
from bisect import bisect_left
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import cycle

import numpy as np

from surface.base.arrays import Floats
from surface.base.progress import Progress, no_progress, part_of
from surface.dcp import DCPSurface
from surface.deform.deformation import Deformation
from surface.deform.lists import build_lists
from surface.mesh.mesh import Mesh

from . import peers

GROUP_FRACTIONS = (0.02, 0.1)  # of all vertices that the measured groups influence
MAX_BUILD_S = 10.0  # bound for building a large tree and its lists
Report = Callable[[str], None]


def no_report(text: str) -> None:
    """Report nothing."""


@dataclass(frozen=True)
class Measure:
    """One row of a table.

    name : what was measured
    milliseconds : minimum time of one call, with cold caches the median; 0 if the row is no time
    ratio, against : a ratio, or None, and the name of what it is relative to
    reach : bound of the ratio, as text (``"<= 1.8"``, ``"0.9 to 1.1"``), or empty
    interval : 95 % confidence interval of the ratio, if it was measured; then all of it must meet the bound
    """

    name: str
    milliseconds: float
    ratio: float | None = None
    against: str = ""
    reach: str = ""
    interval: tuple[float, float] | None = None

    @property
    def kept(self) -> bool | None:
        """Whether the ratio meets its bound; None if there is no bound or no ratio."""
        if not self.reach or self.ratio is None:
            return None
        low, high = self.interval or (self.ratio, self.ratio)
        first, *_, bound = self.reach.split()
        if first == "<=":
            return high <= float(bound)
        return low >= float(bound) if first == ">=" else float(first) <= low and high <= float(bound)


def least(call: Callable[[], object], seconds: float = 0.3) -> float:
    """Return the minimum time of a call, ms, over at least five calls and ``seconds``."""
    return least_of([call], seconds)[0]


def least_of(calls: list[Callable[[], object]], seconds: float = 0.3) -> list[float]:
    """Do the same as :func:`least` for several calls in turn, so that a disturbance affects all of them."""
    for call in calls:
        call()
    best, count, end = np.full(len(calls), np.inf), 0, time.perf_counter() + seconds * len(calls)
    while count < 5 or time.perf_counter() < end:
        for k, call in enumerate(calls):
            begin = time.perf_counter()
            call()
            best[k] = min(best[k], time.perf_counter() - begin)
        count += 1
    return [1e3 * float(x) for x in best]


def measure(surface: DCPSurface, mesh: Mesh, *, seconds: float = 0.3, report: Report = no_report) -> list[Measure]:
    """Measure full evaluation, updates of a point, of groups and of all points, and reference implementations.

    Each row is repeated for ``seconds``; ``report`` is called with its name first.
    """
    rows: list[Measure] = []
    with_normals, plain = surface.deformation(mesh), surface.deformation(mesh, normals=False)

    def add(name: str, call: Callable[[], object], against: str = "", reach: str = "", base: float = 0.0) -> float:
        report(name)
        took = least(call, seconds)
        rows.append(Measure(name, took, took / base if base else None, against if base else "", reach))
        return took

    read = add("one read of the weights", build_lists(surface, mesh, False).value.sum)
    full = add("all positions", plain.refresh, "one read of the weights", "<= 1.8", read)
    add("all positions and normals", with_normals.refresh, "all positions", "<= 3.5", full)
    for name, ids in (("every point", np.arange(surface.n)), ("one point", nearest(surface, 1))):
        add(f"{name} moved, with normals", alternating(with_normals, ids), "all positions", "", full)
    groups = {len(ids): (ids, part) for ids, part in (group(surface, mesh, share) for share in GROUP_FRACTIONS)}
    for count, (ids, part) in groups.items():  # only one row if a single point influences more than either fraction
        name = f"group of {count} moved, which reaches {100 * part:.1f} %"
        add(name, alternating(plain, ids), "its part of all positions", "<= 1.5", part * full)
    return rows + peer_rows(peers.vertex_sums(mesh), surface, mesh, full, seconds, report)


def peer_rows(
    implementations: Iterable[peers.Peer], surface: DCPSurface, mesh: Mesh, full: float, seconds: float, report: Report
) -> list[Measure]:
    """Measure reference implementations that compute the same vertices; ratios are their times over ``full``, ms."""
    rows = []
    for peer in implementations:
        report(peer.name)
        with peers.one_thread():
            took = peer.time_factor * least(peer.prepare(surface, mesh), seconds)
        rows.append(Measure(f"{peer.name}, positions", took, took / full, "all positions", peer.reach))
    return rows


def sheet(vertices: int = 100_000) -> tuple[DCPSurface, Mesh]:
    """Return a bicubic sheet and a mesh of about so many vertices.

    A cell of the mesh is a knot span: 16 control points influence its 8 x 8 vertices or so.
    """
    spans = max(2, round(np.sqrt(vertices / 64)))
    level = max(0, round(np.log2(np.sqrt(vertices) / spans)))
    spans = max(2, round(np.sqrt(vertices) / 2**level))
    surface = bumpy((spans + 3) ** 2)
    mesh = surface.tessellate(max_points=surface.n + 1, min_depth=level, max_depth=level, roots=(spans, spans))
    return surface, mesh


def bumpy(points: int) -> DCPSurface:
    """Return a bumpy bicubic sheet, 200 x 200, over the unit square, with about so many control points."""
    side = max(5, round(np.sqrt(points)))
    knots = np.concatenate([[0.0] * 3, np.linspace(0, 1, side - 2), [1.0] * 3])
    x, y = np.meshgrid(np.linspace(0, 200, side), np.linspace(0, 200, side), indexing="ij")
    return DCPSurface.from_nurbs(3, 3, knots, knots, np.stack([x, y, 20 * np.sin(x / 20) * np.cos(y / 25)], axis=-1))


def speed_table(vertices: int = 100_000, seconds: float = 0.3, report: Report = no_report) -> list[Measure]:
    """Measure the engine and all reference implementations on :func:`sheet`: one thread, float32."""
    surface, mesh = sheet(vertices)
    rows = measure(surface, mesh, seconds=seconds, report=report)
    full = next(row.milliseconds for row in rows if row.name == "all positions")
    return rows + peer_rows(peers.libraries(mesh), surface, mesh, full, seconds, report)


def large_table(vertices: int = 1_000_000, seconds: float = 0.5, report: Report = no_report) -> list[Measure]:
    """Compare two threads with one, and measure memory, on a sheet of about so many vertices."""
    report(f"{vertices} vertices")
    surface, mesh = sheet(vertices)
    one = surface.deformation(mesh, normals=False)
    two = surface.deformation(mesh, normals=False, threads=2)
    weights = build_lists(surface, mesh, False).value
    report("two threads")
    halves = np.array_split(weights, 2)
    with ThreadPoolExecutor(2) as pool:
        calls: list[Callable[[], object]] = [
            one.refresh,
            two.refresh,
            weights.sum,
            lambda: list(pool.map(np.sum, halves)),
        ]
        single, double, read, shared = least_of(calls, seconds)
    bound = max(0.7, 1.15 * shared / read)  # two threads cannot gain more than two readers of the memory do
    name = f"all positions, {len(mesh.vertices)} vertices"
    return [
        Measure(name, single, single / read, "one read of the weights", "<= 0.8"),
        Measure(f"{name}, two threads", double, double / single, "one thread", f"<= {bound:.2f}"),
        Measure("one read of the weights, two threads", shared, shared / read, "one thread"),
        Measure("memory of weights and lists", 0.0, one.nbytes / weights.nbytes, "the weights alone", "<= 0.6"),
    ]


def build_table(points: int = 100_000, level: int = 7, progress: Progress = no_progress) -> list[Measure]:
    """Measure building the quad tree and its lists, by either criterion for splitting cells.

    ``level`` is the deepest level of the tree under 8 x 8 roots, which bounds the vertices to (8 * 2**level + 1)**2.
    """
    bumpy(300).tessellate(max_points=16, chord_error=1.0)  # compiles the kernels before the clock starts
    surface, rows = bumpy(points), []
    for title, limits in (("16 points a cell", {"max_points": 16}), ("chord error", {"chord_error": 1e-9})):
        begin = time.perf_counter()
        mesh = surface.tessellate(roots=(8, 8), max_depth=level, **limits, progress=part_of(progress, 0.0, 0.85))
        surface.deformation(mesh, progress=part_of(progress, 0.85, 1.0))
        took = time.perf_counter() - begin
        name = f"tree and lists by {title}: {surface.n} points, {len(mesh.vertices)} vertices"
        rows.append(Measure(name, 1e3 * took, took / MAX_BUILD_S, f"{MAX_BUILD_S:.0f} s", "<= 1"))
    return rows


def alternating(deformation: Deformation[DCPSurface], ids: np.ndarray) -> Callable[[], object]:
    """Return a call that moves the points forth and back in turn."""
    original = deformation.points[ids].copy()
    positions = cycle((original + 0.01 * np.ptp(deformation.points, axis=0).max(), original))
    return lambda: deformation.set_positions(ids, next(positions))


def nearest(surface: DCPSurface, count: int) -> np.ndarray:
    """Return the sorted indices of the ``count`` points whose subdomains are nearest to the median centre."""
    supports: Floats = surface.supports
    centre = np.stack([supports[:, :2].mean(axis=1), supports[:, 2:].mean(axis=1)], axis=1)
    distance = np.linalg.norm(centre - np.median(centre, axis=0), axis=1)
    return np.sort(np.argsort(distance, kind="stable")[:count])


def group(surface: DCPSurface, mesh: Mesh, fraction: float) -> tuple[np.ndarray, float]:
    """Return the fewest neighbouring points that influence ``fraction`` of the vertices, and the actual fraction."""

    def reached_by(count: int) -> float:
        return fraction_reached(surface, mesh, nearest(surface, count))

    count = bisect_left(range(surface.n), fraction, lo=1, key=reached_by)
    return nearest(surface, count), reached_by(count)


def fraction_reached(surface: DCPSurface, mesh: Mesh, ids: np.ndarray) -> float:
    """Return the fraction of the vertices at which at least one of the points has weight."""
    hit = np.zeros(len(mesh.uv), dtype=bool)
    copies = surface.all_supports.reshape(-1, surface.n, 4)[:, ids].reshape(-1, 4)  # a closed surface repeats points
    u, v = mesh.uv.T
    for start, end, low, high in copies:
        hit |= (u > start) & (u < end) & (v > low) & (v < high)
    return float(hit.mean())
