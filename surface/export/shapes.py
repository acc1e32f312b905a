"""Meshes of a head's parts for export: at rest or posed, with the displacements of every shape."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Floats, Floats32, Ints
from surface.export.head_texture import ShownTexture, texture_of, tinted
from surface.head import Head
from surface.head.model.accessories import Accessory
from surface.head.model.parameters import SHAPES, TONGUE_JAW

MIN_MOVE_MM = 0.002  # smaller displacements are zero
MIN_NORMAL = 1e-4  # smaller changes of normals are zero
# Shapes that make sense only together with another one: exported is what they add to it.
BASE_POSES = {"mouthClose": {"jawOpen": 1.0}, "tongueOut": {"jawOpen": TONGUE_JAW}}
_EYES = ("left_eye", "right_eye")
_PAINTED = ("iris", "sclera", "iris_radius")


@dataclass(frozen=True)
class ExportPart:
    """One part for other programs.

    vertices, normals : (m, 3) float32, mm; uv : (m, 2) float32 inside the unit square, v up.
    triangles : (t, 3) int32. pivot : (3,) centre of rotation of an eyeball, else zero.
    colours : (m, 3) float32 linear RGB, or None for a part that is not painted.
    painted : what is painted all over an eyeball, by name: "iris" and "sclera", linear RGB, and "iris_radius".
    displacements, normal_changes : by shape, (m, 3) float32: what it adds to vertices and normals.
    worn : the accessory that this is; None for a part of the head.
    texture : what it shows of its head's texture, at ``uv``; None where it shows nothing.
    """

    name: str
    material: str
    vertices: Floats32
    normals: Floats32
    uv: Floats32
    triangles: NDArray[np.int32]
    pivot: Floats
    colours: Floats32 | None
    displacements: dict[str, Floats32] = field(default_factory=dict)
    normal_changes: dict[str, Floats32] = field(default_factory=dict)
    painted: dict[str, Floats32] = field(default_factory=dict)
    worn: Accessory | None = None
    texture: ShownTexture | None = None


def export_parts(head: Head, pose: Mapping[str, float] | None = None, *, shapes: bool = True) -> list[ExportPart]:
    """Return all parts in a pose (at rest without one), and what every shape adds to the face at rest."""
    head.pose(head.values(pose or {}))
    out = []
    for part in head.parts:
        pivot = head.data.eyes[_EYES.index(part.follows)].copy() if part.follows in _EYES else np.zeros(3)
        colours, texture = part.attributes.get("albedo"), texture_of(head, part)
        if colours is not None:
            occlusion = part.attributes.get("occlusion", np.float32(1.0))
            colours = np.clip(tinted(colours, texture) * np.sqrt(occlusion), 0.0, 1.0).astype(np.float32)
        vertices, normals = part.vertices.copy(), unit(part.normals)
        uv = _in_unit_square(part.uv if texture is None else texture.uv)
        out.append(
            ExportPart(
                part.name,
                part.material,
                vertices,
                normals,
                uv,
                _manifold(vertices, part.triangles),
                pivot,
                colours,
                painted={key: part.attributes[key][0] for key in _PAINTED if key in part.attributes},
                texture=texture,
            )
        )
    for name, base in shapes_of(head).items() if shapes else ():
        _add_shape(head, name, base, out)
    head.pose(head.values({}))
    return out


def is_posed(head: Head, pose: Mapping[str, float]) -> bool:
    """Whether a pose has more than a user's own groups, which may be there in the face at rest, too."""
    own = {group.name for group in head.own_groups}
    return any(value and name not in own for name, value in pose.items())


def shapes_of(head: Head) -> dict[str, Mapping[str, float]]:
    """Return shapes that move anything, each with the face that it is added to: those of groups, of turning eyes and
    jaw, and a user's own behind them."""
    follow = {part.follows for part in head.parts}
    names = set(head.groups)
    if follow & set(_EYES):
        names |= {name for name in SHAPES if name.startswith("eyeLook")}
    if "jaw" in follow:
        names |= {"jawOpen", *head.data.jaw.tilts}
    own = {group.name: dict.fromkeys(group.times, 1.0) for group in head.own_groups}
    return {**{name: BASE_POSES.get(name, {}) for name in SHAPES if name in names}, **own}


def _add_shape(head: Head, name: str, base: Mapping[str, float], parts: list[ExportPart]) -> None:
    head.pose(head.values(base))
    before = [(part.vertices.copy(), unit(part.normals)) for part in head.parts]
    head.pose(head.values({**base, name: 1.0}))
    for out, part, (vertices, normals) in zip(parts, head.parts, before, strict=True):
        moved = _zero_noise(part.vertices - vertices, MIN_MOVE_MM)
        if moved.any():
            out.displacements[name] = moved
            out.normal_changes[name] = _zero_noise(unit(part.normals) - normals, MIN_NORMAL)


def _zero_noise(rows: Floats32, least: float) -> Floats32:
    """Return rows, zero where all components are smaller than ``least``."""
    return np.where(np.abs(rows).max(axis=1, keepdims=True) < least, np.float32(0), rows)


def unit(normals: Floats32) -> Floats32:
    """Return rows scaled to length 1; zero rows become +z."""
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(length > 1e-6, normals / np.maximum(length, 1e-6), np.array([0.0, 0.0, 1.0])).astype(np.float32)


def _manifold(vertices: Floats32, triangles: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return triangles without the slivers by which more than two meet in an edge: a tessellation has a few at its
    seams, and other programs refuse them."""
    kept = np.array(triangles)
    for _ in range(8):
        start, end = kept.ravel().astype(np.int64), kept[:, [1, 2, 0]].ravel().astype(np.int64)
        _, edge, count = np.unique(start * len(vertices) + end, return_inverse=True, return_counts=True)
        crowded = (count[edge.ravel()] > 1).reshape(-1, 3).any(axis=1)
        if not crowded.any():
            break
        a, b, c = (vertices[kept[:, k]].astype(float) for k in range(3))
        area = np.where(crowded, np.linalg.norm(np.cross(b - a, c - a), axis=1), np.inf)
        kept = np.delete(kept, _smallest(kept, area, edge.reshape(-1, 3), count), axis=0)
    return kept


def _smallest(triangles: NDArray[np.int32], area: Floats, edge: Ints, count: Ints) -> Ints:
    """Return the smallest triangle at each directed edge that several have."""
    out = []
    for k in np.flatnonzero(count > 1):
        at = np.flatnonzero((edge == k).any(axis=1))
        out.append(at[np.argmin(area[at])])
    return np.unique(np.array(out, np.int64))


def _in_unit_square(uv: Floats32) -> Floats32:
    """Return texture coordinates; where any lies outside of the unit square, all are scaled evenly into it."""
    low, high = uv.min(axis=0), uv.max(axis=0)
    if low.min() >= 0 and high.max() <= 1:
        return uv.copy()
    scaled: Floats32 = ((uv - low) / max(float((high - low).max()), 1e-9)).astype(np.float32)
    return scaled
