"""Benchmarks of ``omote bench``: the surface engine on heads and other surfaces, compared with other libraries."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from itertools import cycle
from pathlib import Path

import numpy as np

from controller.base.parameters import PARAMETERS, Floats
from controller.base.paths import find_config
from controller.layers.commands import CommandState
from surface.base.progress import Progress
from surface.bench import cold, growth
from surface.bench.bench import Measure, build_table, large_table, least, least_of, measure, sheet, speed_table
from surface.bench.comparison import Variant, compare, draw
from surface.bench.drift import drift
from surface.bench.savings import MEASURES, nine_surfaces, savings
from surface.head import Crowd, Head
from surface.head.model.meshes import domain_of

Log = Callable[[str], None]
Tables = list[tuple[str, list[Measure]]]

_MOVED_PARAMETERS = ("jawOpen", "eyeBlinkLeft", "browInnerUp")
_POSES = 8
_AREA_QUANTILE = 0.99
UNIFORM_LEVEL = 7  # subdivision levels of the uniform mesh with which adaptive ones are compared
VERTICES = 100_000  # size of the sheet for which the bounds hold


def bench_head(name: str, seconds: float, log: Log) -> Tables:
    """Return tables of a head: how long posing takes, and the engine on its largest surface."""
    log("loading")
    started = time.perf_counter()
    head = Head.load(find_config("heads", name))
    loading = 1e3 * (time.perf_counter() - started)
    largest = max(head.parts, key=lambda part: part.surface.n)
    vertices = sum(len(part.vertices) for part in head.parts)
    title = f"head {head.name}: {len(head.parts)} parts, {vertices} vertices, loaded in {loading:.0f} ms"
    about = f"{largest.name}: {largest.surface.n} control points, {len(largest.mesh.vertices)} vertices"
    engine = measure(largest.surface, largest.mesh, seconds=seconds, report=log)
    # The bounds hold for the large sheet; a small mesh fits into the cache, so its rows have none.
    return [(title, pose_rows(head, seconds, log)), (about, [replace(row, reach="") for row in engine])]


def bench_surface(seconds: float, log: Log, vertices: int = VERTICES, name: str = "ict") -> Tables:
    """Return tables of the engine with cold caches on several surfaces, one of them a head, and with warm caches.

    vertices : approximate number of vertices of each surface but the head; the warm table is of a plain sheet.
    """
    head = Head.load(find_config("heads", name))
    deforming = [(part.surface, part.mesh) for part in head.parts if part.follows == "skin"]
    subjects: list[tuple[str, list[cold.Case], str]] = [
        (f"head {head.name}", deforming, cold.FULL_BOUND),
        ("three levels", [cold.hierarchical(vertices // 2)], cold.FULL_BOUND),
        ("scattered points", [cold.scattered(vertices // 50, vertices // 2)], cold.FULL_BOUND),
        ("sheet", [sheet(vertices)], "<= 1.0"),
    ]
    rows = [row for s in subjects for row in cold.cold_rows(*s[:2], seconds, s[2], report=log)]
    title = f"about {vertices:,} vertices, 16 influences, one thread, caches warm"
    return [("caches cold, as in a frame; ratios with the ends of their 95 % interval", rows),
            (title, speed_table(vertices, seconds, log))]  # fmt: skip


def bench_large(seconds: float, log: Log, progress: Progress, vertices: int = VERTICES) -> Tables:
    """Return tables for ten times ``vertices``: cold caches, building trees and lists, two threads against one."""
    large = 10 * vertices
    level = max(0, round(np.log2(np.sqrt(large) / 8)))  # under 8 x 8 roots
    built = build_table(vertices, level, progress)
    cool = cold.cold_rows(f"sheet of {large:,}", [sheet(large)], seconds, "<= 0.8", report=log)
    return [(f"about {large:,} vertices, caches cold", cool),
            (f"about {large:,} vertices", built + large_table(large, seconds, log))]  # fmt: skip


def bench_growth(seconds: float, log: Log, out: Path, vertices: int = VERTICES) -> Tables:
    """Return the slopes of time and memory against size on logarithmic scales; also draw the curves to ``out``.

    Sizes run from a tenth to ten times ``vertices``, and from a thousandth of it to as many control points.
    """
    scale = vertices / VERTICES
    sizes = tuple(max(256, round(scale * count)) for count in growth.VERTICES)
    points = tuple(max(25, round(scale * count)) for count in growth.POINTS)
    series = growth.growth(sizes, points, seconds, log)
    growth.plot(series, out)
    title = f"from {sizes[0]:,} to {sizes[-1]:,} vertices and from {points[0]:,} to {points[-1]:,} control points"
    return [(f"growth, {title}", growth.slopes(series))]


def bench_drift(name: str, updates: int, log: Log) -> Tables:
    """Return the error that random updates of every kind leave on a head's largest surface."""
    log("loading")
    head = Head.load(find_config("heads", name))
    part = max(head.parts, key=lambda part: part.surface.n)
    found = drift(part.surface, part.mesh, updates, report=log)
    title = (
        f"{part.name} of {name} after {found.moves} moves of one point, {found.groups} of a group, "
        f"{found.weights} changes of a weight and {found.knots} of knots"
    )
    rows = [
        Measure("greatest error of a vertex, in millionths of the size", 0.0, 1e6 * found.error, "", "<= 1"),
        Measure("greatest error of a normal, in millionths", 0.0, 1e6 * found.normal_error),
    ]
    return [(title, rows)]


def bench_quadtree(name: str, log: Log, level: int = UNIFORM_LEVEL, out: Path | None = None) -> Tables:
    """Repeat the paper's figures 2 and 3 on a head's face: a uniform mesh, and adaptive ones that deviate no more.

    One table compares meshes by their greatest deviation, as in the paper. The other compares them by the deviation
    that 99 % of the area keeps; the picture ``out`` shows these. A method that finds no mesh within the bound is
    omitted. The uniform mesh is subdivided ``level`` times.
    """
    log("loading")
    head = Head.load(find_config("heads", name))
    domain = domain_of(next(part for part in head.data.parts if part.name == "face"))
    tables = []
    by_area = _AREA_QUANTILE, f"deviation of {_AREA_QUANTILE:.0%} of the area"
    for quantile, title in ((1.0, "greatest deviation"), by_area):
        log(title)
        face = head.part("face").surface
        variants = compare(face, domain, level=level, quantile=quantile, report=log)
        tables.append((f"quad tree on the face of {name}, at equal {title}", [_saving(v) for v in variants]))
    if out is not None:
        draw(variants, out)
    return tables


def bench_savings(name: str, log: Log, level: int = UNIFORM_LEVEL) -> Tables:
    """Return what quad trees save on a face and nine other surfaces, least first; uniform meshes have level - 2."""
    log("loading")
    head = Head.load(find_config("heads", name))
    domain = domain_of(next(part for part in head.data.parts if part.name == "face"))
    subjects = [*nine_surfaces(), (f"face of {name}", head.part("face").surface, domain)]
    rows = savings(subjects, max(0, level - 2), log)
    return [
        (f"quad trees on ten surfaces, at equal {measure}",
         [Measure(f"{row.name}: {way}", 0.0, saved, "the uniform mesh is saved")
          for way, key in (("by control points", "by_points"), ("by chord error", "by_chord"))
          for row in rows if row.measure == measure and np.isfinite(saved := getattr(row, key))])
        for measure in MEASURES
    ]  # fmt: skip


def _saving(variant: Variant) -> Measure:
    name = f"{variant.name}: {len(variant.mesh.vertices)} vertices, {variant.deviation:.3f} mm"
    if variant.name == "uniform":
        return Measure(name, 0.0)
    reach = ">= 0.75" if "chord" in variant.name else ">= 0.502"
    return Measure(name, 0.0, variant.saving, "the uniform mesh is saved", reach)


def pose_rows(head: Head, seconds: float, log: Log) -> list[Measure]:
    """Measure posing when every parameter changes, when one changes and when nothing changes."""
    count = len(head.parameters)
    rng = np.random.default_rng(1)
    log("every parameter")
    whole = least(poser(head, rng.uniform(0, 0.5, (_POSES, count))), seconds)
    rows = [Measure("pose, every parameter changed", whole)]
    for parameter in _MOVED_PARAMETERS:
        log(parameter)
        poses = np.zeros((_POSES, count))
        poses[:, head.parameters.index(parameter)] = np.arange(_POSES) / _POSES
        took = least(poser(head, poses), seconds)
        rows.append(Measure(f"pose, only {parameter} changed", took, took / whole, "every parameter"))
    still = least(poser(head, np.zeros((1, count))), seconds)
    return [*rows, Measure("pose, nothing changed", still, still / whole, "every parameter")]


def bench_crowd(name: str, count: int, seconds: float, log: Log) -> Tables:
    """Compare posing a crowd of ``count`` heads, every parameter changed, with posing one head; measure its memory."""
    log("loading")
    folder = find_config("heads", name)
    alone, crowd = Head.load(folder), Crowd(Head.load(folder), count)
    poses = np.random.default_rng(1).uniform(0, 0.5, (_POSES, count, len(alone.parameters)))
    each = cycle(poses)
    log(f"{count} heads")
    calls = [poser(alone, poses[:, 0]), lambda: crowd.pose(next(each)), ticker(count)]
    one, together, ticks = least_of(calls, seconds)
    per_head = together / count
    arrays = sum(part.vertices.nbytes + part.normals.nbytes for part in alone.parts)
    rows = [
        Measure("one head alone, every parameter changed", one),
        Measure("a head of the crowd, every parameter changed", per_head, per_head / one, "one alone"),
        Measure("its tick: layers, idle motion, limits", ticks / count, ticks / together, "posing it"),
        Measure("memory per head", 0.0, crowd.nbytes / count / arrays, "its vertices and normals", "<= 3"),
    ]
    return [(f"{count} heads like {alone.name}, {arrays / 1e6:.1f} MB of vertices and normals each", rows)]


def ticker(count: int) -> Callable[[], object]:
    """Return a function that ticks the layers of ``count`` heads, each with its own idle motion, by 10 ms per call."""
    states = [CommandState(PARAMETERS, seed=seed) for seed in range(count)]
    for state in states:
        state.live(1.0, 0)
    values, times = PARAMETERS.neutral(), iter(range(10**9, 10**15, 10**7))

    def tick() -> None:
        now_ns = next(times)
        for state in states:
            state.tick(now_ns, 0.01, values)

    return tick


def poser(head: Head, poses: Floats) -> Callable[[], object]:
    """Return a function that poses ``head`` with the next of ``poses`` : (n, h), again and again."""
    each = cycle(poses)
    return lambda: head.pose(next(each))
