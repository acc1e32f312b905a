"""The shade of hair on the skin beside it: how much of the light from above and in front does not get there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from surface.base.arrays import Floats
from surface.fit.wardrobe.patches import Patches
from surface.fit.wardrobe.skin import Skin, unit

_RAYS = 40
_ABOVE = np.array([0.0, 0.55, 0.35])  # from where most light comes: so much is added to rays evenly about the normal
_STEPS_MM = np.array([2.5, 4.5, 7.0, 10.0, 14.0, 19.0, 25.0, 33.0, 42.0])  # along a ray
_THICK = 0.28, 1.4  # of the way along a ray, mm: hair that is so near to the ray stands in it
_CLEAR_MM = 0.8  # over the skin, from where rays start
_NEAR_MM, _MOST = 60.0, 0.72  # from hair, beyond which there is no shade; and the darkest that shade is
_HAIRY = 0.35  # cover from which hair keeps light out


def shade(skin: Skin, patches: Sequence[Patches]) -> Floats:
    """(s,) share of the light that patches keep from the skin's samples, 0..1."""
    hair = np.concatenate([_solid(patch) for patch in patches])
    tree, out = cKDTree(hair), np.zeros(len(skin.points))
    near = np.flatnonzero(tree.query(skin.points, distance_upper_bound=_NEAR_MM)[0] < _NEAR_MM)
    rays = unit(_evenly(_RAYS))
    for ray in rays:
        toward = unit(skin.normals[near] + 0.92 * ray + _ABOVE)
        start = skin.points[near] + _CLEAR_MM * skin.normals[near]
        blocked = np.zeros(len(near), bool)
        for way in _STEPS_MM:
            away, _ = tree.query(start + way * toward, distance_upper_bound=_THICK[0] * way + _THICK[1])
            blocked |= np.isfinite(away)
        out[near] += blocked / _RAYS
    return np.asarray(_MOST * out)


def _solid(patch: Patches) -> Floats:
    """(n, 3) places of a patch, about 3 mm apart, where it keeps light out; control points stand for the surface."""
    out = []
    for points, strands in zip(patch.points, patch.strands, strict=True):
        size = [max(2, round(float(np.linalg.norm(np.diff(points, axis=k), axis=2).sum(axis=k).max()) / 3.0))
                for k in (0, 1)]  # fmt: skip
        at = [np.linspace(0.0, 1.0, n) for n in size]
        cover = _resampled(strands[..., 2:3], at)[..., 0]
        out.append(_resampled(points, at)[cover > _HAIRY])
    return np.concatenate(out)


def _resampled(rows: Floats, at: Sequence[Floats]) -> Floats:
    """Values of a grid (nu, nv, c) at shares of its rows and columns, linear between."""
    for axis, where in enumerate(at):
        index = where * (rows.shape[axis] - 1)
        low = np.minimum(index.astype(int), rows.shape[axis] - 2)
        share = np.expand_dims(index - low, tuple(k for k in range(rows.ndim) if k != axis))
        rows = np.take(rows, low, axis) * (1.0 - share) + np.take(rows, low + 1, axis) * share
    return rows


def _evenly(count: int) -> Floats:
    """(count, 3) directions evenly all round."""
    k = np.arange(count) + 0.5
    down, turn = np.arccos(1.0 - 2.0 * k / count), np.pi * (1.0 + 5.0**0.5) * k
    return np.column_stack([np.sin(down) * np.cos(turn), np.sin(down) * np.sin(turn), np.cos(down)])
