"""A head's parts at rest and what every shape adds to them, ready to be written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Floats32
from surface.head import Head
from surface.head.model.parameters import SHAPES, TONGUE_NEEDS

LEAST_MM = 0.002  # displacements smaller than this are none
# shapes that only mean something over another one: written is what they add to it
OVER = {"mouthClose": {"jawOpen": 1.0}, "tongueOut": {"jawOpen": TONGUE_NEEDS}}


@dataclass(frozen=True)
class Piece:
    """One part for other programs.

    Attributes
    ----------
    vertices, normals : (m, 3) float32, mm; uv : (m, 2) float32 inside the unit square, v up.
    triangles : (t, 3) int32. pivot : (3,) what an eyeball turns about, else zero.
    colours : (m, 3) float32 linear RGB, or None for a part that is not painted.
    moves, turns : by shape, (m, 3) float32: what it adds to vertices and normals.
    """

    name: str
    material: str
    vertices: Floats32
    normals: Floats32
    uv: Floats32
    triangles: NDArray[np.int32]
    pivot: NDArray[np.float64]
    colours: Floats32 | None
    moves: dict[str, Floats32] = field(default_factory=dict)
    turns: dict[str, Floats32] = field(default_factory=dict)


def pieces_of(head: Head, pose: Mapping[str, float] | None = None, *, shapes: bool = True) -> list[Piece]:
    """All parts in a pose (at rest without one), and what every shape adds to the face at rest."""
    head.pose(head.values(pose or {}))
    out = [_piece(head, k) for k in range(len(head.parts))]
    for name in _shapes(head) if shapes else ():
        _add_shape(head, name, out)
    head.pose(head.values({}))
    return out


def _shapes(head: Head) -> list[str]:
    """Shapes that anything follows: groups, and what turns eyes and jaw."""
    follow = {p.follows for p in head.parts}
    rigid = [n for n in SHAPES if n.startswith("eyeLook")] if {"left_eye", "right_eye"} & follow else []
    rigid += ["jawOpen", *head.data.jaw.tilts] if "jaw" in follow else []
    return [n for n in SHAPES if n in set(head.groups) | set(rigid)]


def _piece(head: Head, k: int) -> Piece:
    part = head.parts[k]
    side = {"left_eye": 0, "right_eye": 1}.get(part.follows)
    albedo = part.attributes.get("albedo")
    occlusion = part.attributes.get("occlusion", np.float32(1.0))
    return Piece(
        part.name, part.material, part.vertices.copy(), unit(part.normals), _in_square(part.uv), part.triangles.copy(),
        np.zeros(3) if side is None else head.data.eyes[side].copy(),
        None if albedo is None else np.clip(albedo * np.sqrt(occlusion), 0.0, 1.0).astype(np.float32),
    )  # fmt: skip


def _add_shape(head: Head, name: str, pieces: list[Piece]) -> None:
    below = OVER.get(name, {})
    head.pose(head.values(below))
    before = [(p.vertices.copy(), unit(p.normals)) for p in head.parts]
    head.pose(head.values({**below, name: 1.0}))
    for piece, part, (rest, normals) in zip(pieces, head.parts, before, strict=True):
        move = part.vertices - rest
        move[np.abs(move).max(axis=1) < LEAST_MM] = 0.0
        if move.any():
            turn = unit(part.normals) - normals
            turn[np.abs(turn).max(axis=1) < 1e-4] = 0.0
            piece.moves[name], piece.turns[name] = move, turn


def unit(normals: Floats32) -> Floats32:
    """Rows of length 1; where there is no direction, +z."""
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(length > 1e-6, normals / np.maximum(length, 1e-6), np.array([0.0, 0.0, 1.0])).astype(np.float32)


def _in_square(uv: Floats32) -> Floats32:
    """Texture coordinates inside the unit square, tiles and all, shrunk evenly where they do not fit."""
    low, high = uv.min(axis=0), uv.max(axis=0)
    if low.min() >= 0 and high.max() <= 1:
        return uv.copy()
    scaled: Floats32 = ((uv - low) / max(float((high - low).max()), 1e-9)).astype(np.float32)
    return scaled
