"""What holds of every garment, whatever it looks like."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree

from surface.base.arrays import Floats
from surface.fit.wardrobe.patches import Patches, knots
from surface.fit.wardrobe.skin import Skin


def points_of(patches: Sequence[Patches]) -> Floats:
    """(n, 3) control points of all patches."""
    return np.concatenate([patch.points.reshape(-1, 3) for patch in patches])


def heights(skin: Skin, points: Floats) -> Floats:
    """(n,) mm over the skin without ears; points far from its samples, as below the chin, count as they are."""
    return skin.nearest(points)[1]


def check_patches(patches: Sequence[Patches]) -> None:
    """Arrays are finite and belong together: as many vertices as the grid says, and shares within their ranges."""
    for patch in patches:
        count, nu, nv, three = patch.points.shape
        assert three == 3 and nu > patch.degrees[0] and nv > patch.degrees[1]
        for name, shape in (("strands", (4,)), ("tint", ()), ("shade", ())):
            values = getattr(patch, name)
            assert values.shape == (count, *patch.grid, *shape), name
            assert np.isfinite(values).all(), name
        assert patch.sway.shape == (count, nu, nv) and np.isfinite(patch.points).all()
        assert all(0 < few <= many for few, many in zip(patch.fast, patch.grid, strict=True))
        assert patch.tint.min() >= 0.0 and patch.tint.max() <= 1.0
        assert patch.sway.min() >= 0.0 and patch.sway.max() <= 1.0 and 0.0 <= patch.follow <= 1.0
        assert patch.shade.min() > 0.0 and patch.shade.max() < 2.0  # a byte holds twice the usual brightness


def outward_share(patches: Sequence[Patches], middle: Floats) -> float:
    """The share of the patches' area whose outside, along u x v, looks away from a place."""
    looks = area = 0.0
    for patch in patches:
        for points in patch.points:
            a, b, c = points[:-1, :-1], points[1:, :-1], points[:-1, 1:]
            normal = np.cross(b - a, c - a)
            size = np.linalg.norm(normal, axis=-1)
            away = (normal * (a - middle)).sum(axis=-1) > 0.0
            looks, area = looks + float(size[away].sum()), area + float(size.sum())
    return looks / area


def asymmetry(points: Floats, share: float = 1.0) -> float:
    """The greatest distance from a point's mirror image to the nearest other point, mm, of this share of the points."""
    return float(np.quantile(cKDTree(points).query(points * [-1.0, 1.0, 1.0])[0], share))


def share_below(outer: Patches, inner: Patches, middle: Floats) -> float:
    """The share of one sheet that lies nearer to a place than the sheet that shall lie below it."""
    above, below = (_dense(patch) for patch in (outer, inner))
    normals = np.cross(np.gradient(below, axis=0), np.gradient(below, axis=1)).reshape(-1, 3)
    above, below = above.reshape(-1, 3), below.reshape(-1, 3)
    normals *= np.sign((normals * (below - middle)).sum(axis=1, keepdims=True))
    away, near = cKDTree(below).query(above)
    beside = away < 5.0
    return float((((above - below[near]) * normals[near]).sum(axis=1)[beside] < 0.0).mean())


def _dense(patch: Patches) -> Floats:
    """(300, 100, 3) places on the first patch, but for its ends."""
    at = [np.linspace(low, high, n) for low, high, n in ((0.0, 1.0, 300), (0.02, 0.94, 100))]
    every = [np.concatenate([own[:, 0], own[-1, 1:]]) for own in map(knots, patch.points.shape[1:3], patch.degrees)]
    along = BSpline(every[0], patch.points[0], patch.degrees[0])(at[0]).swapaxes(0, 1)
    return np.asarray(BSpline(every[1], along, patch.degrees[1])(at[1]).swapaxes(0, 1))
