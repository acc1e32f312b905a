"""Comparison of uniform and adaptive meshes at equal deviation from the surface (paper, 2.3, figures 2 and 3)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from surface.base.arrays import Floats
from surface.dcp import DCPSurface
from surface.mesh.domain import Domain
from surface.mesh.mesh import Mesh

from .bench import Report, no_report

SAMPLES_PER_EDGE = 4  # of the surface, per median edge of the uniform mesh
MAX_SAMPLES = 40  # along an edge of one large triangle
EXTRA_LEVELS = 2  # that adaptive meshes may be deeper than the uniform one, down to the spacing of the samples


@dataclass(frozen=True)
class Variant:
    """One way to tessellate: uniform, by control points (as in the paper) or by chord error.

    deviation : distance of the surface from the mesh, as :func:`deviation` measures it, in units of the points.
    saving : fraction of the uniform mesh's vertices that is saved; negative if more are needed.
    """

    name: str
    mesh: Mesh
    deviation: float
    saving: float


def compare(
    surface: DCPSurface,
    domain: Domain | None = None,
    *,
    level: int = 4,
    quantile: float | None = 1.0,
    report: Report = no_report,
) -> list[Variant]:
    """Return a uniform mesh, and of each kind of adaptive mesh the smallest found that deviates no more.

    A method that finds no such mesh is left out. The uniform mesh is quartered ``level`` times below the roots.
    ``quantile`` is that of :func:`deviation`.

    The surface itself is the reference; samples are a quarter of the uniform mesh's median edge apart, or less.
    """
    region = Domain.of(surface) if domain is None else domain
    size = float(np.linalg.norm(np.ptp(surface.points, axis=0)))
    report("uniform")
    uniform = surface.tessellate(
        chord_error=1e9, measured=False, min_depth=level, max_depth=level, domain=region, loop_error=1e9
    )
    spacing = _edge(uniform) / SAMPLES_PER_EDGE
    bound = deviation(surface, uniform, spacing, quantile)
    total = len(uniform.vertices)
    loop_error = max(bound, 0.1 * _edge(uniform))
    found = [Variant("uniform", uniform, bound, 0.0)]

    def measure_deviation(mesh: Mesh) -> float:
        if len(mesh.vertices) > 4 * total:
            return 0.0  # too large to be a candidate, so it is not measured; the search goes on with a coarser limit
        return deviation(surface, mesh, spacing, quantile)

    adaptive = partial(
        surface.tessellate, measured=False, max_depth=level + EXTRA_LEVELS, domain=region, loop_error=loop_error
    )
    methods: list[tuple[str, Callable[[float], Mesh], float, float]] = [
        ("by control points", lambda limit: adaptive(max_points=round(limit)), float(surface.n), 4.0),
        ("by chord error", lambda limit: adaptive(chord_error=limit), 0.1 * size, 1e-6 * size),
    ]
    for name, make, coarse, fine in methods:
        report(name)
        best = _search(make, measure_deviation, coarse, fine, bound)
        if best is not None:
            found.append(Variant(name, *best, 1.0 - len(best[0].vertices) / total))
    return found


def _search(
    make: Callable[[float], Mesh], measure: Callable[[Mesh], float], coarse: float, fine: float, bound: float
) -> tuple[Mesh, float] | None:
    """Bisect on a logarithmic scale for the coarsest limit whose mesh deviates no more than ``bound``.

    Return the smallest such mesh found and its deviation, or None.
    """
    best: tuple[Mesh, float] | None = None
    for _ in range(14):
        limit = float(np.sqrt(coarse * fine))
        mesh = make(limit)
        reached = measure(mesh)
        if reached <= bound:
            if reached > 0 and (best is None or len(mesh.vertices) < len(best[0].vertices)):
                best = mesh, reached
            fine = limit
        else:
            coarse = limit
        if coarse / fine < 1.03:
            break
    return best


def _edge(mesh: Mesh) -> float:
    """Return the median length of the first edges of a mesh's triangles."""
    a, b = (mesh.vertices[mesh.triangles[:, k]] for k in (0, 1))
    return float(np.median(np.linalg.norm(b - a, axis=1)))


def deviation(surface: DCPSurface, mesh: Mesh, spacing: float, quantile: float | None = 1.0) -> float:
    """Return the deviation of a mesh from its surface: distances of surface points from the planes of their triangles.

    Samples are about ``spacing`` apart, but at most :data:`MAX_SAMPLES` lie along an edge. A ``quantile`` of 1 gives
    the maximum distance, 0.99 the one that 99 % of the area do not exceed, None the root mean square over the area.
    """
    corner, uv, side = mesh.vertices[mesh.triangles], mesh.uv[mesh.triangles], mesh.side[mesh.triangles]
    longest = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max(axis=1)
    parts = np.clip(np.ceil(longest / spacing).astype(np.int64), 2, MAX_SAMPLES)
    found, weight = [np.zeros(0)], [np.zeros(0)]
    for n in np.unique(parts):
        rows = np.flatnonzero(parts == n)
        lattice = _lattice(int(n))
        points = surface.evaluate(
            np.einsum("sk,tkc->tsc", lattice, uv[rows]).reshape(-1, 2),
            side=np.repeat(np.bitwise_or.reduce(side[rows], axis=1), len(lattice)),
        )
        offset = points.reshape(len(rows), -1, 3) - np.einsum("sk,tkc->tsc", lattice, corner[rows])
        normal = np.cross(corner[rows, 1] - corner[rows, 0], corner[rows, 2] - corner[rows, 0])
        area = np.maximum(np.linalg.norm(normal, axis=1), 1e-300)
        found.append(np.abs(np.einsum("tsc,tc->ts", offset, normal / area[:, None])).ravel())
        weight.append(np.repeat(area / len(lattice), len(lattice)))
    return _quantile(np.concatenate(found), np.concatenate(weight), quantile)


def _quantile(values: Floats, weights: Floats, quantile: float | None) -> float:
    """Return the weighted quantile, or for None the weighted root mean square; NaN values are left out."""
    good = np.isfinite(values)
    if quantile is None:
        whole = float(weights[good].sum())
        return float(np.sqrt((weights[good] * values[good] ** 2).sum() / whole)) if whole > 0 else 0.0
    order = np.argsort(values[good])
    total = np.cumsum(weights[good][order])
    if not len(total):
        return 0.0
    place = min(int(np.searchsorted(total, quantile * total[-1])), len(total) - 1)
    return float(values[good][order][place if quantile < 1 else -1])


def _lattice(n: int) -> Floats:
    """Return barycentric coordinates (s, 3) of a lattice that divides every edge in n parts, without the corners."""
    i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
    keep = i + j <= n
    lattice = np.stack([i[keep], j[keep], n - i[keep] - j[keep]], axis=1) / n
    inner: Floats = lattice[lattice.max(axis=1) < 1]
    return inner


def draw(variants: list[Variant], path: str | Path, *, height: int = 900) -> None:
    """Draw the meshes of :func:`compare` side by side, seen along -z, as a PNG or another format that pillow writes."""
    from PIL import Image, ImageDraw  # optional: the extra view

    low = np.min([v.mesh.vertices.min(axis=0) for v in variants], axis=0)
    high = np.max([v.mesh.vertices.max(axis=0) for v in variants], axis=0)
    zoom = 2 * 0.86 * height / (high[1] - low[1])
    width = int(zoom * (high[0] - low[0]) + 0.1 * height)
    picture = Image.new("RGB", (width * len(variants), 2 * height), "white")
    pen = ImageDraw.Draw(picture)
    for column, variant in enumerate(variants):
        offset = np.array([column * width + 0.05 * height, 0.12 * height])
        place = np.array([1, -1]) * (variant.mesh.vertices[:, :2] - [low[0], high[1]]) * zoom + offset
        _draw_mesh(pen, variant.mesh, place)
        text = f"{variant.name}\n{len(variant.mesh.vertices)} vertices"
        if variant.saving:
            text += f", {100 * abs(variant.saving):.1f} % {'saved' if variant.saving > 0 else 'more'}"
        pen.multiline_text((offset[0], 0.01 * height), text, fill="black", font_size=0.045 * height)
    picture.resize((picture.width // 2, height), Image.Resampling.LANCZOS).save(path)


def _draw_mesh(pen: object, mesh: Mesh, place: Floats) -> None:
    """Draw shaded triangles with their edges, from the farthest to the nearest."""
    corner = mesh.vertices[mesh.triangles]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    light = np.abs(normal @ [0.3, 0.3, 0.9]) / np.maximum(np.linalg.norm(normal, axis=1), 1e-300)
    for t in np.argsort(corner[:, :, 2].mean(axis=1)):
        grey = int(150 + 95 * min(light[t], 1.0))
        points = [tuple(place[k]) for k in mesh.triangles[t]]
        pen.polygon(points, fill=(grey, grey, grey), outline=(40, 60, 90))  # type: ignore[attr-defined]
