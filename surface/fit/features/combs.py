"""Lashes of a mesh without a texture: strips that its picture would draw hairs on are cut into hairs.

Lashes are modelled as strips along the lids, whose texture is clear between the hairs. Without it each would be drawn
whole, as a dark band round the eye.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.fit.features.pieces import comb
from surface.fit.source.islands import Island
from surface.fit.source.layout import middle_line
from surface.fit.source.mesh import FitMesh
from surface.head.model.data import PartData
from surface.head.model.meshes import make_surface

HAIR_MM = 1.3  # of a head of usual size, between the roots of two hairs
HAIRS = (8, 40)  # in one strip, at least and at most
LEAN, THICK = 0.015, 0.45  # of the strip's length; of the distance between hairs
LOWEST = 0.04  # of the greatest height: where a strip runs out at its ends
INSET = 0.02  # of a strip's length and height: hairs stay within it


def combed(part: PartData, mesh: FitMesh, islands: list[Island], eyes: Floats, scale: float) -> PartData:
    """A part of lashes with hairs for outlines, where the mesh says nothing of how its strips look.

    islands : those that the part was made of. eyes : (2, 3) centres; scale : of the head, 1 for usual size.
    """
    faces = {mesh.material_of(int(f)) for f in _faces(mesh, islands)}
    whole = len(part.loops) == len(islands)  # a strip with holes is none
    if any(m is not None and m.texture is not None for m in faces) or not whole:
        return part
    return replace(part, loops=[_hairs(part, loop, eyes, scale) for loop in part.loops])


def _hairs(part: PartData, loop: Floats, eyes: Floats, scale: float) -> Floats:
    """The outline of hairs in one strip with outline ``loop``, rooted at its border that is nearer to an eye."""
    u, low, high = _ends(loop)
    borders = [make_surface(part).evaluate(np.column_stack([u, v])) for v in (low, high)]
    near = [np.linalg.norm(at[:, None] - eyes, axis=2).min(axis=1).mean() for at in borders]
    if near[0] > near[1]:
        low, high, borders = high, low, borders[::-1]
    length = float(np.linalg.norm(np.diff(borders[0], axis=0), axis=1).sum())
    line = comb(int(np.clip(length / (HAIR_MM * scale), *HAIRS)), lean=LEAN, thick=THICK)
    at = u[0] + np.ptp(u) * line[:, 0]
    root, tip = np.interp(at, u, low), np.interp(at, u, high)
    return np.column_stack([at, root + np.clip(line[:, 1], INSET, 1.0 - INSET) * (tip - root)])


def _faces(mesh: FitMesh, islands: list[Island]) -> Ints:
    """Faces of the mesh that use vertices of islands."""
    used = np.zeros(len(mesh.vertices) + 1, bool)
    for island in islands:
        used[island.vertex] = True
    used[-1] = True
    return np.flatnonzero(used[mesh.faces].all(axis=1))


def _ends(loop: Floats) -> tuple[Floats, Floats, Floats]:
    """Places along a strip in u (k,), and its lower and upper border in v there (k,)."""
    low, high = loop[:, 0].min(), loop[:, 0].max()
    u = np.linspace(low + INSET * (high - low), high - INSET * (high - low), 41)
    middle, half = middle_line(loop, u)
    tall = half > LOWEST * half.max()
    u, middle, half = u[tall], middle[tall], half[tall]
    return u, middle - half, middle + half
