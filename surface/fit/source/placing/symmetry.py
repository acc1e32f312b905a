"""Find the plane that a head mirrors itself in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from surface.base.arrays import Floats

SAMPLES = 500  # points that are mirrored
STEPS = 10  # of the refinement of a plane
MATCHED_FRACTION = 0.8  # of the points that must find their mirror image: hair and stands need not
SAME_COSINE = 0.97  # between the normals of planes that are the same
RIVAL_FACTOR = 1.8  # other planes count if their error is below this many times the best
RIVAL_EXCESS = 0.01  # or exceeds the best by less than this
GOLDEN = np.pi * (3.0 - np.sqrt(5.0))


@dataclass(frozen=True)
class Mirror:
    """A plane by its unit normal (3,) and a point (3,); error : mean distance of mirrored points, in sizes."""

    normal: Floats
    centre: Floats
    error: float


def find_mirrors(points: Floats, most: int = 3) -> list[Mirror]:
    """The planes in which points (n, 3) on a surface mirror themselves best, the best first."""
    centre = points.mean(axis=0)
    size = float(np.sqrt(((points - centre) ** 2).sum(axis=1).mean()))
    tree, checked = cKDTree(points), points[:: -(-len(points) // SAMPLES)]
    axes = np.linalg.svd(points - centre, full_matrices=False)[2]
    starts = [*axes, *np.eye(3), *_spread(24)]
    first = sorted((_refined(tree, points, checked, n, centre, 2, size) for n in starts), key=lambda m: m.error)
    found = sorted((_refined(tree, points, checked, m.normal, m.centre, STEPS, size) for m in first[:6]),
                   key=lambda m: m.error)  # fmt: skip
    out: list[Mirror] = []
    for mirror in found:
        rival = mirror.error < max(RIVAL_FACTOR * found[0].error, found[0].error + RIVAL_EXCESS)
        if rival and all(abs(float(mirror.normal @ m.normal)) < SAME_COSINE for m in out):
            out.append(mirror)
    return out[:most]


def _spread(count: int) -> Floats:
    """(count, 3) unit vectors spread over half a sphere (a Fibonacci lattice)."""
    k = np.arange(count) + 0.5
    z = k / count
    r = np.sqrt(1.0 - z**2)
    return np.column_stack([r * np.cos(GOLDEN * k), r * np.sin(GOLDEN * k), z])


def _refined(
    tree: cKDTree, points: Floats, checked: Floats, normal: Floats, centre: Floats, steps: int, size: float
) -> Mirror:  # fmt: skip
    """A plane moved so that mirrored points come nearer to others, as in the method of iterated closest points."""
    for _ in range(steps):
        distance, index = tree.query(_mirrored(checked, normal, centre))
        near = distance <= np.quantile(distance, MATCHED_FRACTION)
        a, b = checked[near], points[index[near]]
        centre = 0.5 * (a.mean(axis=0) + b.mean(axis=0))
        cross = (a - a.mean(axis=0)).T @ (b - b.mean(axis=0))
        normal = np.linalg.eigh(cross + cross.T)[1][:, 0]  # where pairs lie opposite each other
    distance = np.sort(tree.query(_mirrored(checked, normal, centre))[0])
    return Mirror(normal, centre, float(distance[: int(MATCHED_FRACTION * len(distance))].mean()) / max(size, 1e-30))


def _mirrored(points: Floats, normal: Floats, centre: Floats) -> Floats:
    out: Floats = points - 2.0 * np.outer((points - centre) @ normal, normal)
    return out
