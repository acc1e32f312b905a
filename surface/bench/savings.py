"""Benchmark of the vertices that a quad tree saves on different surfaces, compared with a uniform mesh.

The meshes compared have equal deviation over 99 % of the area, or equal root mean square (RMS) deviation. The saving
depends on how curvature is distributed, so a single surface would favour one method. The surfaces here range from a
sheet with one small hill to surfaces that are equally curved everywhere, on which a quad tree can save nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats
from surface.dcp import DCPSurface
from surface.mesh.domain import Domain

from .bench import Report, no_report
from .comparison import compare

Subject = tuple[str, DCPSurface, Domain | None]
"""Name, surface, and the domain to tessellate; None for all of it."""
MEASURES: dict[str, float | None] = {"deviation of 99 % of the area": 0.99, "RMS": None}
METHODS = ("by control points", "by chord error")


@dataclass(frozen=True)
class Saving:
    """Fractions of a uniform mesh's vertices that two kinds of quad tree save on one surface at an equal measure.

    NaN if no mesh of up to four times the uniform mesh's size is as good.
    """

    name: str
    measure: str
    by_points: float
    by_chord: float


def savings(subjects: Sequence[Subject], level: int, report: Report = no_report) -> list[Saving]:
    """Return the savings on every surface, measure by measure, sorted by ascending saving by chord error.

    The uniform mesh is quartered ``level`` times below its roots.
    """
    found = []
    for measure, quantile in MEASURES.items():
        rows = []
        for name, surface, domain in subjects:
            report(f"{name}: {measure}")
            best = {v.name: v.saving for v in compare(surface, domain, level=level, quantile=quantile)}
            rows.append(Saving(name, measure, *(best.get(method, np.nan) for method in METHODS)))
        found += sorted(rows, key=lambda row: np.nan_to_num(row.by_chord, nan=-np.inf))
    return found


def nine_surfaces() -> list[Subject]:
    """Return nine surfaces about 100 units in size, each curved in a different way."""
    sheets: list[Subject] = [(name, _sheet(shape), None) for name, shape in SHEETS.items()]
    return [*sheets, ("ball", _revolve(_half_circle), None), ("vase", _revolve(_vase), None), ("ring", _ring(), None)]


def _half_circle(t: Floats) -> tuple[Floats, Floats]:
    return np.sin(np.pi * t), -np.cos(np.pi * t)


def _vase(t: Floats) -> tuple[Floats, Floats]:
    return 0.5 + 0.25 * np.sin(7 * t) + 0.15 * np.exp(-(((t - 0.9) / 0.05) ** 2)), 3 * t


def _hills(x: Floats, y: Floats) -> Floats:
    return 10 * np.sin(8 * x) * np.cos(11 * y)


def _one_hill(x: Floats, y: Floats) -> Floats:
    return 20 * np.exp(-((x - 0.7) ** 2 + (y - 0.3) ** 2) / 0.004)


def _saddle(x: Floats, y: Floats) -> Floats:
    return 60 * (x - 0.5) * (y - 0.5)


def _crease(x: Floats, y: Floats) -> Floats:
    return 30 * np.tanh(25 * (y - 0.4 - 0.2 * x))


def _ripples(x: Floats, y: Floats) -> Floats:
    r: Floats = np.hypot(x - 0.2, y - 0.2)
    heights: Floats = 6 * np.cos(40 * r) * np.exp(-4 * r)
    return heights


def _terrain(x: Floats, y: Floats) -> Floats:
    rng = np.random.default_rng(4)
    waves = [(2.0**k, *rng.uniform(0, 2 * np.pi, 3)) for k in range(1, 6) for _ in range(3)]
    heights: Floats = sum(
        (30 / f**1.3 * np.sin(f * (np.cos(a) * x + np.sin(a) * y) * 2 + b + c) for f, a, b, c in waves), 0 * x
    )
    return heights


SHEETS: dict[str, Callable[[Floats, Floats], Floats]] = {
    "hills": _hills, "one small hill": _one_hill, "saddle": _saddle, "crease": _crease, "ripples": _ripples,
    "terrain": _terrain,
}  # fmt: skip


def _clamped_knots(count: int) -> Floats:
    """Return the clamped, uniform cubic knot vector of ``count`` control points."""
    return np.concatenate([[0.0] * 3, np.linspace(0.0, 1.0, count - 2), [1.0] * 3])


def _sheet(height: Callable[[Floats, Floats], Floats], count: int = 40) -> DCPSurface:
    """Return a bicubic surface 100 x 100 whose control points are at ``height(x, y)``, x and y from 0 to 1."""
    knots = _clamped_knots(count)
    place = np.array([knots[k + 1 : k + 4].mean() for k in range(count)])
    x, y = np.meshgrid(place, place, indexing="ij")
    return DCPSurface.from_nurbs(3, 3, knots, knots, np.stack([100 * x, 100 * y, height(x, y)], axis=-1))


def _revolve(profile: Callable[[Floats], tuple[Floats, Floats]], count: int = 24) -> DCPSurface:
    """Return the surface of revolution about z of a profile: radius and height in units of 50, for t from 0 to 1.

    Its circles are exact, of degree 2 (Piegl and Tiller, The NURBS Book, 8.5).
    """
    knots = _clamped_knots(count)
    t = np.array([knots[k + 1 : k + 4].mean() for k in range(count)])
    radius, height = profile(t)
    circle = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]])
    flat = circle[:, None] * radius[None, :, None]
    net = 50 * np.dstack([flat, np.broadcast_to(height, flat.shape[:2])])
    weights = np.repeat([[1.0], [np.sqrt(0.5)]] * 4 + [[1.0]], count, axis=1)
    around = [0, 0, 0, 0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 1, 1, 1]
    return DCPSurface.from_nurbs(2, 3, around, knots, net, weights)


def _ring(around: int = 24, across: int = 12) -> DCPSurface:
    """Return a cubic torus, closed in both directions."""
    a, b = 2 * np.pi * np.arange(around) / around, 2 * np.pi * np.arange(across) / across
    radius = 35 + 15 * np.cos(b)
    net = np.stack([np.outer(np.cos(a), radius), np.outer(np.sin(a), radius), np.tile(15 * np.sin(b), (around, 1))], -1)
    u, v = ((np.arange(n)[:, None] + np.arange(-2, 3)) / n for n in (around, across))
    knots_u, knots_v = np.repeat(u, across, axis=0), np.tile(v, (around, 1))
    ends = (0.0, 1.0)
    return DCPSurface(net.reshape(-1, 3), np.ones(around * across), knots_u, knots_v, closed_u=ends, closed_v=ends)
