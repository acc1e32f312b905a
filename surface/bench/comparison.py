"""Uniform against adaptive meshes at equal deviation (paper, 2.3, figures 2 and 3)."""

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

FINER = 4  # samples of the reference per edge of the uniform mesh
MOST_SAMPLES = 40  # along an edge of one large triangle
DEEPER = 2  # levels the adaptive meshes may go below the uniform one: to the reference's samples


@dataclass(frozen=True)
class Variant:
    """One way to tessellate: uniform, by control points (as in the paper) or by chord error.

    ``deviation`` is the greatest distance of the reference samples from the mesh, in units of the points; ``saving``
    the part of the uniform mesh's vertices that is not needed.
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
    """A uniform mesh, and the smallest adaptive ones that deviate no more.

    The uniform mesh is quartered ``level`` times below the roots. A ``quantile`` of 1 compares greatest deviations,
    0.99 those that 99 % of the area keep, None root mean squares over the area.

    The reference is the surface itself, sampled everywhere at a spacing of a quarter of the uniform mesh's edges.
    """
    where = Domain.of(surface) if domain is None else domain
    size = float(np.linalg.norm(np.ptp(surface.points, axis=0)))
    report("uniform")
    uniform = surface.tessellate(
        chord_error=1e9, measured=False, min_depth=level, max_depth=level, domain=where, loop_error=1e9
    )
    spacing = _edge(uniform) / FINER
    bound = deviation(surface, uniform, spacing, quantile)
    total = len(uniform.vertices)
    loop_error = max(bound, 0.1 * _edge(uniform))
    found = [Variant("uniform", uniform, bound, 0.0)]

    def off(mesh: Mesh) -> float:
        if len(mesh.vertices) > 4 * total:
            return 0.0  # so fine that it need not be measured, and no candidate
        return deviation(surface, mesh, spacing, quantile)

    adaptive = partial(
        surface.tessellate, measured=False, max_depth=level + DEEPER, domain=where, loop_error=loop_error
    )
    ways: list[tuple[str, Callable[[float], Mesh], float, float]] = [
        ("by control points", lambda limit: adaptive(max_points=round(limit)), float(surface.n), 4.0),
        ("by chord error", lambda limit: adaptive(chord_error=limit), 0.1 * size, 1e-6 * size),
    ]
    for name, make, coarse, fine in ways:
        report(name)
        best = _search(make, off, coarse, fine, bound)
        if best is not None:
            found.append(Variant(name, *best, 1.0 - len(best[0].vertices) / total))
    return found


def _search(
    make: Callable[[float], Mesh], off: Callable[[Mesh], float], coarse: float, fine: float, bound: float
) -> tuple[Mesh, float] | None:
    """Bisect (by ratio) for the coarsest limit whose mesh deviates no more than ``bound``."""
    best: tuple[Mesh, float] | None = None
    for _ in range(14):
        limit = float(np.sqrt(coarse * fine))
        mesh = make(limit)
        reached = off(mesh)
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
    """Median length of a mesh's edges."""
    a, b = (mesh.vertices[mesh.triangles[:, k]] for k in (0, 1))
    return float(np.median(np.linalg.norm(b - a, axis=1)))


def deviation(surface: DCPSurface, mesh: Mesh, spacing: float, quantile: float | None = 1.0) -> float:
    """Distance between a surface and a mesh of it: of the surface's points from the planes of their triangles.

    Samples are at most ``spacing`` apart. ``quantile`` 1 asks for the greatest distance, 0.99 for the one that 99 % of
    the area do not exceed, None for the root mean square over the area.
    """
    corner, uv, side = mesh.vertices[mesh.triangles], mesh.uv[mesh.triangles], mesh.side[mesh.triangles]
    longest = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max(axis=1)
    parts = np.clip(np.ceil(longest / spacing).astype(np.int64), 2, MOST_SAMPLES)
    found, weight = [np.zeros(0)], [np.zeros(0)]
    for n in np.unique(parts):
        at = np.flatnonzero(parts == n)
        share = _lattice(int(n))
        points = surface.evaluate(
            np.einsum("sk,tkc->tsc", share, uv[at]).reshape(-1, 2),
            side=np.repeat(np.bitwise_or.reduce(side[at], axis=1), len(share)),
        )
        offset = points.reshape(len(at), -1, 3) - np.einsum("sk,tkc->tsc", share, corner[at])
        normal = np.cross(corner[at, 1] - corner[at, 0], corner[at, 2] - corner[at, 0])
        area = np.maximum(np.linalg.norm(normal, axis=1), 1e-300)
        found.append(np.abs(np.einsum("tsc,tc->ts", offset, normal / area[:, None])).ravel())
        weight.append(np.repeat(area / len(share), len(share)))
    return _quantile(np.concatenate(found), np.concatenate(weight), quantile)


def _quantile(values: Floats, weights: Floats, quantile: float | None) -> float:
    """The value that the given part of the weight does not exceed, or the root mean square; NaN values are left out."""
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
    """(s, 3): barycentric coordinates that divide every edge in n, without the corners."""
    i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
    keep = i + j <= n
    share = np.stack([i[keep], j[keep], n - i[keep] - j[keep]], axis=1) / n
    inner: Floats = share[share.max(axis=1) < 1]
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
    """Triangles from the farthest to the nearest, shaded, with their edges."""
    corner = mesh.vertices[mesh.triangles]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    light = np.abs(normal @ [0.3, 0.3, 0.9]) / np.maximum(np.linalg.norm(normal, axis=1), 1e-300)
    for t in np.argsort(corner[:, :, 2].mean(axis=1)):
        grey = int(150 + 95 * min(light[t], 1.0))
        points = [tuple(place[k]) for k in mesh.triangles[t]]
        pen.polygon(points, fill=(grey, grey, grey), outline=(40, 60, 90))  # type: ignore[attr-defined]
