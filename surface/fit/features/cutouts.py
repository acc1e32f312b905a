"""Cards of brows, lashes and hair: what their texture leaves clear is cut off.

Such hair is painted on flat cards, whose texture is clear beside it. Without it each card would be drawn whole, as a
trapezoid on the skin. The outline of what is opaque, traced in (u, v), becomes the outline of the part.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.features.contours import contours
from surface.fit.source.islands import FaceNumbers, Island, face_numbers, faces_of, texture_corners
from surface.fit.source.mesh import FitMesh, triangles
from surface.fit.source.textures import opacity_at
from surface.head.model.data import PartData
from surface.readers.meshdata import Material

MATERIALS = "brow", "lash"
SIDE = 200  # places along the longer side of an island at which its opacity is looked up
HALF = 0.5  # of BLEND: opacity from which on a place is drawn
MIN_OPAQUE, MAX_OPAQUE = 0.02, 0.98  # opaque fraction of an island; outside of this range it is drawn whole
MIN_AREA = 12  # places that an outline must enclose


def cut_out(part: PartData, mesh: FitMesh, islands: list[Island]) -> PartData:
    """The part with outlines around what its textures draw; itself where they draw all of it, or nothing is known.

    islands : those that the part was made of, in its (u, v).
    """
    if part.material not in MATERIALS:
        return part
    face_of = face_numbers(mesh)
    found = [_outlines(mesh, island, face_of) for island in islands]
    if all(f is None for f in found) or len(part.loops) != len(islands):  # a card with holes keeps them
        return part
    loops = [x for f, loop in zip(found, part.loops, strict=True) for x in ([loop] if f is None else f)]
    return replace(part, loops=loops)


def _outlines(mesh: FitMesh, island: Island, face_of: FaceNumbers) -> list[Floats] | None:
    """Closed lines (k, 2) around what is opaque of an island; None where that is all of it, hardly any, or unknown."""
    faces = faces_of(island, face_of)
    material = mesh.material_of(int(faces[0])) if len(faces) and (faces >= 0).all() else None
    if material is None or material.texture is None or material.alpha == "OPAQUE":
        return None
    low, high = island.uv.min(axis=0), island.uv.max(axis=0)
    step = float((high - low).max()) / SIDE
    opacity, within = _raster(mesh, island, faces, material, low, step, np.ceil((high - low) / step).astype(int) + 1)
    level = material.cutoff if material.alpha == "MASK" else HALF
    share = float((opacity[within] >= level).mean()) if within.any() else 0.0
    if not MIN_OPAQUE < share < MAX_OPAQUE:
        return None
    lines = contours(np.pad(np.where(within, opacity, 0.0), 1), min(max(level, 1e-3), 1.0 - 1e-3))
    return [low + step * (line - 1.0) for line in lines if _area(line) > MIN_AREA] or None


def _raster(
    mesh: FitMesh, island: Island, faces: Ints, material: Material, low: Floats, step: float, size: Ints
) -> tuple[Floats, Bools]:  # fmt: skip
    """Opacity (w, h) at places ``step`` apart from ``low`` on in (u, v), and which of them the island covers."""
    texture_at = np.full((*size, 2), np.nan)
    corner = island.uv[triangles(island.faces)]
    texture = mesh.uv[texture_corners(mesh, island, faces)]
    for tri, own in zip(corner, texture, strict=True):
        first = np.maximum(np.floor((tri.min(axis=0) - low) / step).astype(int), 0)
        last = np.minimum(np.ceil((tri.max(axis=0) - low) / step).astype(int) + 1, size)
        i, j = np.meshgrid(np.arange(first[0], last[0]), np.arange(first[1], last[1]), indexing="ij")
        share = _shares(tri, low + step * np.stack([i, j], axis=-1).reshape(-1, 2))
        inside = (share > -1e-6).all(axis=1)
        texture_at[i.ravel()[inside], j.ravel()[inside]] = share[inside] @ own
    within = np.isfinite(texture_at[..., 0])
    opacity = np.zeros(size)
    opacity[within] = opacity_at(material, texture_at[within])
    return opacity, within


def _shares(tri: Floats, at: Floats) -> Floats:
    """(m, 3) barycentric coordinates of places (m, 2) in a triangle (3, 2); all -1 where it has no area."""
    sides = np.column_stack([tri[1] - tri[0], tri[2] - tri[0]])
    if abs(np.linalg.det(sides)) < 1e-18:
        return np.full((len(at), 3), -1.0)
    rest = np.linalg.solve(sides, (at - tri[0]).T).T
    return np.column_stack([1.0 - rest.sum(axis=1), rest])


def _area(line: Floats) -> float:
    after = np.roll(line, -1, axis=0)
    return 0.5 * abs(float((line[:, 0] * after[:, 1] - line[:, 1] * after[:, 0]).sum()))
