"""Measures of the engine beside its peers, all in one run on one machine. Prints nothing.

Times are the least of many calls: on a machine with other work that is the steadiest figure.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from .basis import Floats
from .dcp import DCPSurface
from .deformation import Deformation
from .mesh import Mesh

BLENDSHAPES = 52
Tell = Callable[[str], None]


@dataclass(frozen=True)
class Measure:
    """One row of a table.

    Attributes
    ----------
    name : what was measured
    milliseconds : least time of one call; 0 for rows that are a ratio of sizes
    ratio : against what ``against`` names, or None
    against : the other side of the ratio
    reach : the bound the ratio shall keep, as text (``"<= 1.8"``), or empty
    kept : does it keep the bound? None without one
    """

    name: str
    milliseconds: float
    ratio: float | None = None
    against: str = ""
    reach: str = ""

    @property
    def kept(self) -> bool | None:
        """Whether the ratio keeps its bound; None without one."""
        if not self.reach or self.ratio is None:
            return None
        sign, bound = self.reach.split()
        return self.ratio <= float(bound) if sign == "<=" else self.ratio >= float(bound)


def least(call: Callable[[], object], seconds: float = 0.3) -> float:
    """Least time of a call in milliseconds, over at least five calls and ``seconds``."""
    call()
    best, count, end = np.inf, 0, time.perf_counter() + seconds
    while count < 5 or time.perf_counter() < end:
        begin = time.perf_counter()
        call()
        best = min(best, time.perf_counter() - begin)
        count += 1
    return 1e3 * float(best)


def measure(surface: DCPSurface, mesh: Mesh, *, seconds: float = 0.3, tell: Tell = lambda text: None) -> list[Measure]:
    """Full evaluation, updates of a point, a group and everything, and peers, for any surface and mesh.

    Parameters
    ----------
    surface, mesh : what to measure
    seconds : how long each row is repeated
    tell : is told the name of each row before it is measured
    """
    rows: list[Measure] = []
    shaded, bare = surface.deformation(mesh), surface.deformation(mesh, normals=False)
    weights = bare._lists.value

    def add(name: str, call: Callable[[], object], against: str = "", reach: str = "", base: float = 0.0) -> float:
        tell(name)
        took = least(call, seconds)
        rows.append(Measure(name, took, took / base if base else None, against if base else "", reach))
        return took

    read = add("one read of the weights", weights.sum)
    full = add("all positions", bare.refresh, "one read of the weights", "<= 1.8", read)
    add("all positions and normals", shaded.refresh, "all positions", "<= 3.5", full)
    everything = shaker(shaded, np.arange(surface.n))
    add("every point moved, with normals", everything, "all positions", "", full)
    middle = nearest(surface, 1)
    add("one point moved, with normals", shaker(shaded, middle), "all positions", "", full)
    for share in (0.02, 0.1):
        ids, reached = _group(surface, bare, share)
        name = f"group that reaches {100 * reached:.1f} % moved"
        add(name, shaker(bare, ids), "its part of all positions", "<= 1.5", reached * full)
    rows += peers(surface, mesh, full, seconds, tell)
    return rows


def peers(surface: DCPSurface, mesh: Mesh, full: float, seconds: float, tell: Tell) -> list[Measure]:
    """Other ways to the same vertices; their ratios say how many times longer they take than ``full``."""
    tell("scipy CSR @ dense")
    matrix = surface.basis_matrix(mesh.uv, side=mesh.side).astype(np.float32)
    points = surface.points.astype(np.float32)
    csr = least(lambda: matrix @ points, seconds)
    tell(f"numpy {BLENDSHAPES} blendshapes")
    shapes = np.ones((BLENDSHAPES, 3 * len(mesh.vertices)), dtype=np.float32)
    amounts = np.ones(BLENDSHAPES, dtype=np.float32)
    blend = least(lambda: amounts @ shapes, seconds)
    return [
        Measure("scipy CSR @ dense, positions", csr, csr / full, "all positions", ">= 12"),
        Measure(f"numpy {BLENDSHAPES} blendshapes, positions", blend, blend / full, "all positions", ">= 3"),
    ]


def sheet(vertices: int = 100_000, points: int | None = None) -> tuple[DCPSurface, Mesh]:
    """A bicubic sheet whose cells are knot spans of about 8 x 8 vertices, so that 16 points reach each.

    Parameters
    ----------
    vertices : about how many
    points : about how many control points instead of one per 64 vertices
    """
    wanted = vertices / 64 if points is None else points
    spans = max(2, round(np.sqrt(wanted) - (0 if points is None else 3)))
    level = max(0, round(np.log2(np.sqrt(vertices) / spans)))
    if points is None:
        spans = max(2, round(np.sqrt(vertices) / 2**level))
    knots = np.concatenate([[0.0] * 3, np.linspace(0, 1, spans + 1), [1.0] * 3])
    x, y = np.meshgrid(np.linspace(0, 200, spans + 3), np.linspace(0, 200, spans + 3), indexing="ij")
    net = np.stack([x, y, 20 * np.sin(x / 20) * np.cos(y / 25)], axis=-1)
    surface = DCPSurface.from_nurbs(3, 3, knots, knots, net)
    mesh = surface.tessellate(max_points=surface.n + 1, min_depth=level, max_depth=level, roots=(spans, spans))
    return surface, mesh


def speed_table(vertices: int = 100_000, seconds: float = 0.3, tell: Tell = lambda text: None) -> list[Measure]:
    """The engine at its memory limit: about 100,000 vertices, 16 influences, one thread, float32."""
    surface, mesh = sheet(vertices)
    return measure(surface, mesh, seconds=seconds, tell=tell)


def large_table(vertices: int = 1_000_000, seconds: float = 0.5, tell: Tell = lambda text: None) -> list[Measure]:
    """Two threads against one, and memory, for a million vertices."""
    tell(f"{vertices} vertices")
    surface, mesh = sheet(vertices)
    one = surface.deformation(mesh, normals=False)
    two = surface.deformation(mesh, normals=False, threads=2)
    alone, together = least(one.refresh, seconds), least(two.refresh, seconds)
    weights = one._lists.value
    read, shared = least(weights.sum, seconds), _shared_read(weights, seconds)
    ideal = 4 * one._lists.value.size
    bound = max(0.7, 1.15 * shared / read)  # where two readers gain little, two threads cannot gain more
    name = f"all positions, {len(mesh.vertices)} vertices"
    return [
        Measure(name, alone, alone / read, "one read of the weights", "<= 1.8"),
        Measure(f"{name}, two threads", together, together / alone, "one thread", f"<= {bound:.2f}"),
        Measure("one read of the weights, two threads", shared, shared / read, "one thread"),
        Measure("memory of weights and lists", 0.0, one.nbytes / ideal, "bytes of the weights alone", "<= 1.3"),
    ]


def _shared_read(weights: np.ndarray, seconds: float) -> float:
    """Least time of summing an array, half by half in two threads."""
    half = len(weights) // 2
    with ThreadPoolExecutor(1) as pool:

        def call() -> None:
            other = pool.submit(weights[half:].sum)
            weights[:half].sum()
            other.result()

        return least(call, seconds)


def shaker(deformation: Deformation, ids: np.ndarray) -> Callable[[], object]:
    """A call that moves the points there and back in turn."""
    here = deformation.points[ids].copy()
    places = (here + 0.01 * np.ptp(deformation.points, axis=0).max(), here)
    turn = [0]

    def call() -> None:
        turn[0] ^= 1
        deformation.set_positions(ids, places[1 - turn[0]])

    return call


def nearest(surface: DCPSurface, count: int) -> np.ndarray:
    """The ``count`` points whose subdomains lie nearest to the middle of all."""
    supports: Floats = surface.supports
    centre = np.stack([supports[:, :2].mean(axis=1), supports[:, 2:].mean(axis=1)], axis=1)
    distance = np.linalg.norm(centre - np.median(centre, axis=0), axis=1)
    return np.sort(np.argsort(distance, kind="stable")[:count])


def _group(surface: DCPSurface, deformation: Deformation, share: float) -> tuple[np.ndarray, float]:
    """Neighbouring points that reach about ``share`` of the vertices, and the share they really reach."""
    lists = deformation._lists
    size = np.diff(lists.cell_start)
    low, high = 1, surface.n
    while low < high:
        count = (low + high) // 2
        if _reached(surface, deformation, count, size) < share:
            low = count + 1
        else:
            high = count
    return nearest(surface, low), _reached(surface, deformation, low, size)


def _reached(surface: DCPSurface, deformation: Deformation, count: int, size: np.ndarray) -> float:
    lists = deformation._lists
    cells = [
        lists.back_cell[lists.back_start[i] : lists.back_start[i] + lists.back_count[i]]
        for i in nearest(surface, count)
    ]
    return float(size[np.unique(np.concatenate(cells))].sum() / size.sum())
