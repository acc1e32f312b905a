"""Coordinates of strips of hair, brows and lashes: along each strip, and across it from the roots to the tips.

Strips that omote makes fill their tile of (u, v): u runs along them, v from the roots on. Those of a mesh, as of a head
that was exported and fitted again, are charts, upright and of one scale in u and v.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from surface.base.arrays import Array, Bools, Floats, Floats32, Ints

TILE = 2.0  # distance in u between two strips of one part
FILLED = 0.6  # of a tile's height: strips that reach up less are charts of a mesh
HAIRY = 1.6  # outline of a strip by that of its rectangle: from there on it consists of hairs
APART_MM = 4.0  # least height of lashes of the upper lid above those of the lower one


class Strips(Protocol):
    """A part of strips: ``uv (m, 2)``, ``triangles (t, 3)``, ``vertices (m, 3)`` at rest and ``material``."""

    material: str

    @property
    def uv(self) -> Array: ...
    @property
    def triangles(self) -> Array: ...
    @property
    def vertices(self) -> Array: ...


def strip_uv(part: Strips) -> Floats32:
    """Return coordinates along and across its strip of each vertex, 0..1, (m, 2).

    Brows and lashes of hairs that are charts of a mesh are stretched until they fill their tile, so that they are drawn
    as those that omote makes; lashes that a mesh draws as a whole, without hairs, are as they are.
    """
    uv = np.array(part.uv, np.float32)
    strip = np.floor(uv[:, 0] / TILE)
    uv[:, 0] -= np.float32(TILE) * strip.astype(np.float32)
    if len(uv) and np.ptp(uv[:, 1]) < FILLED and part.material in ("brow", "lash"):
        lower = lower_strips(part)
        for each in np.unique(strip):
            own = strip == each
            if part.material == "brow" or is_hairy(uv, np.asarray(part.triangles), own):
                uv[own] = _stretched(uv[own], upside_down=part.material == "lash" and bool(lower[own].any()))
    clipped: Floats32 = np.clip(uv, 0.0, 1.0)
    return clipped


def lower_strips(part: Strips) -> Bools:
    """Return which vertices (m,) belong to strips of the lower lids; none do where all strips are about as high."""
    strip = np.floor(np.asarray(part.uv)[:, 0] / TILE)
    each, own = np.unique(strip, return_inverse=True)
    count = np.maximum(np.bincount(own.ravel()), 1)
    height = np.bincount(own.ravel(), np.asarray(part.vertices, float)[:, 1], len(each)) / count
    if not len(each) or np.ptp(height) < APART_MM:
        return np.zeros(len(strip), bool)
    lower: Bools = (height < 0.5 * (height.min() + height.max()))[own.ravel()]
    return lower


def is_hairy(uv: Floats32, triangles: Ints, own: Bools) -> bool:
    """Return whether a strip, vertices ``own (m,)`` at ``uv (m, 2)``, consists of hairs: its outline is long."""
    corner = triangles[own[triangles[:, 0]]]
    edge = np.sort(np.concatenate([corner[:, [0, 1]], corner[:, [1, 2]], corner[:, [2, 0]]]), axis=1)
    once, count = np.unique(edge, axis=0, return_counts=True)
    rim = once[count == 1]
    outline = float(np.linalg.norm(uv[rim[:, 0]] - uv[rim[:, 1]], axis=1).sum())
    return outline > HAIRY * 2.0 * float(np.ptp(uv[own], axis=0).sum())


def _stretched(uv: Floats32, *, upside_down: bool) -> Floats:
    """Return a strip's (u, v) such that it fills its tile, with the roots below."""
    low, high = uv.min(axis=0), uv.max(axis=0)
    out: Floats = (uv - low) / np.maximum(high - low, 1e-6)
    if upside_down:
        out[:, 1] = 1.0 - out[:, 1]
    return out
