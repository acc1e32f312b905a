"""Benchmark of how time and memory grow with the numbers of vertices and control points, and its log-log plot."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from surface.dcp import DCPSurface
from surface.deform.lists import build_lists

from .bench import Measure, Report, alternating, bumpy, least, least_of, nearest, no_report, sheet

VERTICES = (10_000, 30_000, 100_000, 300_000, 1_000_000)
POINTS = (100, 1_000, 10_000, 100_000)
AXES = ("vertices", "control points")
READ, FULL, MOVE, LISTS, MEMORY = (
    "one read of the weights, ms",
    "all positions, ms",
    "one point moved, ms",
    "tree and lists built, ms",
    "weights and lists, MB",
)
SLOPE_BOUNDS = {(0, FULL): "0.9 to 1.1", (0, MEMORY): "0.9 to 1.1", (0, MOVE): "-0.1 to 0.1"}
"""Bounds of slopes, by axis (index in ``AXES``) and name of a series."""


@dataclass
class Series:
    """One quantity, named with its unit, at ascending numbers of vertices (axis 0) or control points (axis 1)."""

    name: str
    axis: int
    size: list[int]
    amount: list[float]

    @property
    def slope(self) -> float:
        """Exponent of the power law fitted to the points, which is the slope on logarithmic scales."""
        return float(np.polyfit(np.log(self.size), np.log(self.amount), 1)[0])


def growth(
    vertices: tuple[int, ...] = VERTICES,
    points: tuple[int, ...] = POINTS,
    seconds: float = 0.3,
    report: Report = no_report,
) -> list[Series]:
    """Measure sheets of ascending size; times are the minimum of calls repeated for ``seconds``.

    vertices : numbers of vertices, with one control point per 64 vertices, so that 16 influence each vertex.
    points : numbers of control points, each with a mesh of equal cells that is the same for all of them.
    """
    found: list[tuple[int, int, dict[str, float]]] = []
    for count in vertices:
        report(f"growth: {count} vertices")
        surface, mesh = sheet(count)
        found.append((0, len(mesh.vertices), _measure_amounts(surface, mesh.leaves, seconds)))
    cells = max(16, round(np.sqrt(max(vertices)) / 2))
    for count in points:
        report(f"growth: {count} control points")
        surface = bumpy(count)
        found.append((1, surface.n, _measure_amounts(surface, cells * cells, seconds)))
    of_axis = [[(size, amounts) for axis, size, amounts in found if axis == k] for k in range(2)]
    return [
        Series(name, axis, [size for size, _ in rows], [amounts[name] for _, amounts in rows])
        for axis, rows in enumerate(of_axis)
        for name in (READ, FULL, MOVE, LISTS, MEMORY)
    ]


def _measure_amounts(surface: DCPSurface, leaves: int, seconds: float) -> dict[str, float]:
    """Measure one surface with a mesh of ``leaves`` equal cells; return amounts by name of the series."""
    side = round(np.sqrt(leaves))
    level = max(k for k in range(4) if side % (1 << k) == 0)
    begin = time.perf_counter()
    mesh = surface.tessellate(chord_error=1e9, roots=(side >> level, side >> level), min_depth=level, max_depth=level)
    deformation = surface.deformation(mesh, normals=False)
    built = 1e3 * (time.perf_counter() - begin)
    one = alternating(deformation, nearest(deformation.surface, 1))
    read, full = least_of([build_lists(surface, mesh, False).value.sum, deformation.refresh], seconds)
    return {READ: read, FULL: full, MOVE: least(one, seconds), LISTS: built, MEMORY: deformation.nbytes / 1e6}


def slopes(series: list[Series]) -> list[Measure]:
    """Return the exponents as rows of a table."""
    return [
        Measure(f"{line.name}: {line.amount[0]:.3g} to {line.amount[-1]:.3g}", 0.0, line.slope,
                f"slope in {AXES[line.axis]}", SLOPE_BOUNDS.get((line.axis, line.name), ""))
        for line in series
    ]  # fmt: skip


COLOURS = ("#9aa2ad", "#1b6ca8", "#c0392b", "#27865b", "#8e44ad")
PANEL, MARGIN, GAP = (400, 420), (70, 50), 250  # px: width and height of a panel and margins; room for labels


def plot(series: list[Series], path: str | Path) -> None:
    """Write two log-log plots, over vertices and over control points, as SVG; labels of lines give their slopes."""
    width = 2 * (PANEL[0] + GAP) + MARGIN[0]
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{PANEL[1] + 2 * MARGIN[1] + 20}" '
        'font-family="sans-serif" font-size="12"><rect width="100%" height="100%" fill="white"/>'
    ]
    amounts = np.log10([y for line in series for y in line.amount])
    low, high = np.floor(amounts.min()), np.ceil(amounts.max())
    for axis in range(2):
        lines = [line for line in series if line.axis == axis]
        sizes = np.log10([x for line in lines for x in line.size])
        frame = np.floor(sizes.min() + 0.1), np.ceil(sizes.max() - 0.1), low, high
        parts += _panel(lines, frame, MARGIN[0] + axis * (PANEL[0] + GAP), AXES[axis])
    Path(path).write_text("\n".join([*parts, "</svg>"]), encoding="utf-8")


def _panel(lines: list[Series], frame: tuple[float, float, float, float], left: float, title: str) -> list[str]:
    """Return the SVG elements of one panel: grid, lines and labels.

    frame : exponents of ten at the left, right, lower and upper border. left : px.
    """
    x0, x1, y0, y1 = frame

    def place(x: float, y: float) -> tuple[float, float]:
        return left + (x - x0) / (x1 - x0) * PANEL[0], MARGIN[1] + (y1 - y) / (y1 - y0) * PANEL[1]

    parts = []
    for power in range(int(x0), int(x1) + 1):
        (x, top), (_, bottom) = place(power, y1), place(power, y0)
        parts.append(f'<path d="M{x:.1f} {top:.1f}V{bottom:.1f}" stroke="#ddd"/>')
        parts.append(f'<text x="{x:.1f}" y="{bottom + 18:.1f}" text-anchor="middle">1e{power}</text>')
    for power in range(int(y0), int(y1) + 1):
        (start, y), (end, _) = place(x0, power), place(x1, power)
        parts.append(f'<path d="M{start:.1f} {y:.1f}H{end:.1f}" stroke="#ddd"/>')
        parts.append(f'<text x="{start - 8:.1f}" y="{y + 4:.1f}" text-anchor="end">1e{power}</text>')
    x, y = place((x0 + x1) / 2, y0)
    parts.append(f'<text x="{x:.1f}" y="{y + 40:.1f}" text-anchor="middle" font-size="14">{title}</text>')
    ends = [place(*np.log10([line.size[-1], line.amount[-1]])) for line in lines]
    for colour, line, (x, _), label in zip(COLOURS, lines, ends, _spread([y for _, y in ends]), strict=True):
        path = "L".join(
            "{:.1f} {:.1f}".format(*place(*np.log10(pair))) for pair in zip(line.size, line.amount, strict=True)
        )
        parts.append(f'<path d="M{path}" fill="none" stroke="{colour}" stroke-width="2"/>')
        words = f"{line.name}, slope {line.slope:.2f}"
        parts.append(f'<text x="{x + 8:.1f}" y="{label + 4:.1f}" fill="{colour}">{words}</text>')
    return parts


def _spread(heights: list[float], step: float = 15.0) -> list[float]:
    """Return heights of labels, px, moved down where they would overlap."""
    out, last = list(heights), -np.inf
    for k in np.argsort(heights):
        last = out[k] = max(heights[k], last + step)
    return out
