"""The surface engine at its memory limit: ratios to what memory allows and to other ways, and how cost grows.

Run ``python benchmarks/surface_speed.py [--growth GROWTH.svg] [--large]``. splinepy and geomdl stand in the table where
they are installed. Ratios are from one run on one machine; times alone say little.
"""

from __future__ import annotations

import argparse
import importlib.util
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from surface import DCPSurface, Mesh, bench

console = Console()
VERTICES = (10_000, 30_000, 100_000, 300_000, 1_000_000)
POINTS = (100, 1_000, 10_000, 100_000)
Series = list[tuple[float, float]]


def show(rows: list[bench.Measure], title: str) -> None:
    """A table of measures."""
    table = Table("measure", "ms", "ratio", "to", "reach", "", title=title, title_justify="left")
    for row in rows:
        mark = {None: "", True: "kept", False: "missed"}[row.kept]
        took = f"{row.milliseconds:.3f}" if row.milliseconds else ""
        table.add_row(row.name, took, f"{row.ratio:.2f}" if row.ratio else "", row.against, row.reach, mark)
    console.print(table)


def optional_peers(surface: DCPSurface, mesh: Mesh, full: float) -> Iterator[bench.Measure]:
    """splinepy and geomdl on the same sheet, where they are installed."""
    for name, prepare in (("splinepy", _splinepy), ("geomdl", _geomdl)):
        if importlib.util.find_spec(name) is None:
            console.print(f"{name}: not installed, left out")
            continue
        took = bench.least(prepare(surface, mesh), 0.0)
        yield bench.Measure(f"{name}, positions", took, took / full, "all positions")


def _net(surface: DCPSurface) -> tuple[int, np.ndarray, np.ndarray]:
    """Side of the square net, its points and its knot vector."""
    side = int(np.sqrt(surface.n))
    knots = np.concatenate([surface.padded[1][:side, 0], surface.padded[1][side - 1, 1:]])
    return side, surface.points, knots


def _splinepy(surface: DCPSurface, mesh: Mesh) -> Callable[[], object]:
    import splinepy

    side, points, knots = _net(surface)
    net = points.reshape(side, side, 3).transpose(1, 0, 2).reshape(-1, 3)  # u runs fastest there
    spline = splinepy.NURBS([3, 3], [knots, knots], net, np.ones(len(net)))
    uv = np.ascontiguousarray(mesh.uv)
    return lambda: spline.evaluate(uv, nthreads=1)


def _geomdl(surface: DCPSurface, mesh: Mesh) -> Callable[[], object]:
    from geomdl import NURBS

    side, points, knots = _net(surface)
    spline = NURBS.Surface()
    spline.degree_u = spline.degree_v = 3
    spline.set_ctrlpts(np.hstack([points, np.ones((len(points), 1))]).tolist(), side, side)
    spline.knotvector_u = spline.knotvector_v = knots.tolist()
    uv = mesh.uv[:1000].tolist()
    return lambda: spline.evaluate_list(uv)  # a thousand vertices: all would take minutes


def growth() -> dict[str, Series]:
    """Times against the number of vertices and of control points."""
    series: dict[str, Series] = {name: [] for name in ("all positions", "one point moved", "lists built", "memory, MB")}
    points: dict[str, Series] = {"all positions by points": [], "one point moved by points": []}
    with console.status("growth") as status:
        for count in VERTICES:
            status.update(f"{count} vertices")
            _grow(series, count, *bench.sheet(count))
        for count in POINTS:
            status.update(f"{count} control points")
            surface, mesh = bench.sheet(200_000, points=count)
            deformation = surface.deformation(mesh, normals=False)
            points["all positions by points"].append((surface.n, bench.least(deformation.refresh)))
            one = bench.shaker(deformation, bench.nearest(surface, 1))
            points["one point moved by points"].append((surface.n, bench.least(one)))
    return series | points


def _grow(series: dict[str, Series], count: int, surface: DCPSurface, mesh: Mesh) -> None:
    begin = time.perf_counter()
    deformation = surface.deformation(mesh, normals=False)
    took = 1e3 * (time.perf_counter() - begin)
    size = len(mesh.vertices)
    one = bench.shaker(deformation, bench.nearest(surface, 1))
    series["all positions"].append((size, bench.least(deformation.refresh)))
    series["one point moved"].append((size, bench.least(one)))
    series["lists built"].append((size, took))
    series["memory, MB"].append((size, deformation.nbytes / 1e6))


def slope(series: Series) -> float:
    """Exponent of a power law through the points, on logarithmic scales."""
    x, y = np.log(np.array(series)).T
    return float(np.polyfit(x, y, 1)[0])


def plot(series: dict[str, Series], path: Path) -> None:
    """Log-log picture as SVG."""
    width, height, edge = 760, 520, 70
    every = np.log10(np.array([point for line in series.values() for point in line]))
    low, high = np.floor(every.min(axis=0)), np.ceil(every.max(axis=0))
    span = np.array([width - 2 * edge - 150, height - 2 * edge])

    def place(point: tuple[float, float]) -> tuple[float, float]:
        x, y = (np.log10(point) - low) / (high - low) * span
        return edge + float(x), height - edge - float(y)

    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" font-family="sans-serif">']
    parts.append('<rect width="100%" height="100%" fill="white"/>')
    parts += _grid(low, high, place)
    colours = ("#1b6ca8", "#c0392b", "#27865b", "#8e44ad", "#d68910", "#566573")
    for colour, (name, line) in zip(colours, series.items(), strict=False):
        path_d = "L".join("{:.1f} {:.1f}".format(*place(point)) for point in line)
        parts.append(f'<path d="M{path_d}" fill="none" stroke="{colour}" stroke-width="2"/>')
        x, y = place(line[-1])
        parts.append(f'<text x="{x + 6:.1f}" y="{y + 4:.1f}" font-size="12" fill="{colour}">{name}</text>')
    middle = edge + span[0] / 2 - 90
    parts.append(f'<text x="{middle}" y="{height - 20}" font-size="13">vertices, or control points</text>')
    parts.append(f'<text x="16" y="{edge - 20}" font-size="13">milliseconds, or MB</text></svg>')
    path.write_text("\n".join(parts))


def _grid(low: np.ndarray, high: np.ndarray, place: Callable) -> Iterator[str]:
    """Lines and labels at powers of ten."""
    for axis in (0, 1):
        for power in range(int(low[axis]), int(high[axis]) + 1):
            ends = [10.0**low, 10.0**high]
            ends[0][axis] = ends[1][axis] = 10.0**power
            (x0, y0), (x1, y1) = (place(tuple(end)) for end in ends)
            dx, dy = (-12, 20) if axis == 0 else (-48, 4)
            yield f'<path d="M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}" stroke="#ddd"/>'
            yield f'<text x="{x0 + dx:.1f}" y="{y0 + dy:.1f}" font-size="12">1e{power}</text>'


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--growth", type=Path, help="also measure growth and write this SVG")
    parser.add_argument("--large", action="store_true", help="also measure a million vertices")
    chosen = parser.parse_args()
    with console.status("measuring") as status:
        surface, mesh = bench.sheet(100_000)
        rows = bench.measure(surface, mesh, tell=status.update)
    full = next(row.milliseconds for row in rows if row.name == "all positions")
    show(rows + list(optional_peers(surface, mesh, full)), f"{len(mesh.vertices)} vertices, 16 influences, one thread")
    if chosen.large:
        show(bench.large_table(), "a million vertices")
    if chosen.growth:
        series = growth()
        for name, line in series.items():
            console.print(f"{name}: slope {slope(line):.2f}")
        plot(series, chosen.growth)


if __name__ == "__main__":
    main()
