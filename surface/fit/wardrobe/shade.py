"""The shade of hair on the skin beside it: how much of the light from above and in front does not get there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import BSpline
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from surface.base.arrays import Floats
from surface.fit.wardrobe.patches import Patches, knots
from surface.fit.wardrobe.skin import Skin, unit

_RAYS = 40
_ABOVE = np.array([0.0, 0.55, 0.35])  # from where most light comes: so much is added to rays evenly about the normal
_STEPS_MM = np.array([2.5, 4.5, 7.0, 10.0, 14.0, 19.0, 25.0, 33.0, 42.0])  # along a ray
_THICK = 0.24, 1.2  # of the way along a ray, mm: hair that is so near to the ray stands in it
_CLEAR_MM = 0.8  # over the skin, from where rays start
_NEAR_MM, _MOST = 60.0, 0.55  # from hair, beyond which there is no shade; and the darkest that shade is
_SOFT = 1.3, 0.5  # vertices along u and v, over which shade on cloth is soft: from one to the next it may be a stripe
_HAIRY = 0.35  # cover from which hair keeps light out


def shade(skin: Skin, patches: Sequence[Patches]) -> Floats:
    """(s,) share of the light that patches keep from the skin's samples, 0..1."""
    hair = np.concatenate([_solid(patch) for patch in patches])
    return _MOST * blocked(skin.points, skin.normals, hair)


def worn_shade(patch: Patches, things: Floats) -> Floats:
    """(k, gu, gv) share of the light that things (n, 3), densely sampled, keep from a patch's vertices, 0..1."""
    at = [np.linspace(0.0, 1.0, n) for n in patch.grid]
    out = np.empty(patch.shade.shape)
    for row, points in zip(out, patch.points, strict=True):
        places = surface_at(points, patch.degrees, at)
        normals = unit(np.cross(np.gradient(places, axis=0), np.gradient(places, axis=1)))
        dark = blocked(places.reshape(-1, 3), normals.reshape(-1, 3), things).reshape(patch.grid)
        row[:] = _MOST * gaussian_filter(dark, _SOFT, mode=("wrap", "nearest"))
    return out


def surface_at(points: Floats, degrees: tuple[int, int], at: Sequence[Floats]) -> Floats:
    """Places of a patch's surface over control points (nu, nv, 3), at every pair of u and v."""
    for axis, (degree, where) in enumerate(zip(degrees, at, strict=True)):
        own = knots(points.shape[axis], degree)
        points = BSpline(np.concatenate([own[:, 0], own[-1, 1:]]), points, degree, axis=axis)(where)
    return points


def blocked(points: Floats, normals: Floats, things: Floats) -> Floats:
    """(n,) share of the light to places (n, 3) with normals (n, 3) in whose way things (m, 3) are."""
    tree, out = cKDTree(things), np.zeros(len(points))
    near = np.flatnonzero(tree.query(points, distance_upper_bound=_NEAR_MM)[0] < _NEAR_MM)
    for ray in _evenly(_RAYS):
        toward = unit(normals[near] + 0.92 * ray + _ABOVE)
        start = points[near] + _CLEAR_MM * normals[near]
        stopped = np.zeros(len(near), bool)
        for way in _STEPS_MM:
            away, _ = tree.query(start + way * toward, distance_upper_bound=_THICK[0] * way + _THICK[1])
            stopped |= np.isfinite(away)
        out[near] += stopped / _RAYS
    return out


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
