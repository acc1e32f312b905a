"""Where the grain of skin lies: texture coordinates in which it has nearly the same size everywhere.

Longitude and latitude stretch pores to streaks where skin lies along them, as under the jaw and beside the nose, or
where it unfolds, as upper lids do. So skin is laid out over its triangles anew, as in Liu et al., "A local/global
approach to mesh parameterization" (2008): each triangle wants to be as large as in the mean of some poses. Done once
when a head is made and kept in its file; see :mod:`surface.head.posing.baked`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from surface.head import Head, load_data
from surface.head.posing.baked import write_grain
from surface.head.posing.part import HeadPart
from surface.view.draw.materials import DETAIL_TILE_MM, wrapped_uv

#: Poses whose sizes count, with the rest's twice: lids open, shut and pressed together, a mouth wide and open.
_POSES: tuple[dict[str, float], ...] = (
    {},
    {},
    {
        "eyeWideLeft": 1,
        "eyeWideRight": 1,
        "browInnerUp": 1,
        "browOuterUpLeft": 1,
        "browOuterUpRight": 1,
        "jawOpen": 0.6,
    },
    {"eyeBlinkLeft": 1, "eyeBlinkRight": 1, "browInnerUp": 0.5},
    {"mouthSmileLeft": 1, "mouthSmileRight": 1, "cheekSquintLeft": 1, "cheekSquintRight": 1},
)
#: Skin that cannot be laid out flat may be this much smaller or larger than it should, rather than longer one way.
_SCALES = 0.85, 1.2
_ROUNDS = 40
#: Weight of the places in longitude and latitude beside the shapes of triangles: enough that nothing floats.
_STAY = 1e-6
_LEAST_MM = 1e-3


def grain_head(folder: str | Path) -> Path:
    """Lay out the grain of the head in ``folder`` and keep it beside it; returns the file written.

    Raises HeadFileError: the head cannot be read.
    """
    head = Head(load_data(folder), str(folder))  # without the files beside it, which may belong to another head
    return write_grain(folder, even_grain(head), head.parts)


def even_grain(head: Head) -> dict[str, np.ndarray]:
    """Return texture coordinates (m, 2) of each part of the skin, by name, in tiles; the head is left at rest.

    Grain is cut where parts meet, which noise hides better than it would hide being stretched.
    """
    parts = [part for part in head.parts if part.material == "skin" and part.follows == "skin"]
    start = {part.name: wrapped_uv(part) for part in parts}
    sides = _mean_sides(head, parts)
    return {
        part.name: _laid_out(start[part.name], part.triangles, _flattened(sides[part.name]) / DETAIL_TILE_MM)
        for part in parts
    }


def _mean_sides(head: Head, parts: list[HeadPart]) -> dict[str, np.ndarray]:
    """Return (t, 3) mm by part: the triangles' sides, from the first corner on, geometric means of poses."""
    logarithms = {part.name: np.zeros(part.triangles.shape) for part in parts}
    for weights in _POSES:
        head.pose(head.values({name: v for name, v in weights.items() if name in head.parameters}))
        for part in parts:
            at = part.vertices.astype(np.float64)[part.triangles]
            sides = np.linalg.norm(np.roll(at, -1, axis=1) - at, axis=2)
            logarithms[part.name] += np.log(np.maximum(sides, _LEAST_MM)) / len(_POSES)
    head.pose(np.zeros(len(head.parameters)))
    return {name: np.exp(mean) for name, mean in logarithms.items()}


def _flattened(sides: np.ndarray) -> np.ndarray:
    """Return (t, 3, 2): corners in the plane of triangles with these ``sides``; what cannot close lies on a line."""
    a, b, c = sides.T
    along = (a**2 + c**2 - b**2) / (2.0 * a)
    across = np.sqrt(np.maximum(c**2 - along**2, (0.02 * a) ** 2))
    zero = np.zeros_like(a)
    return np.stack([np.stack([zero, zero], 1), np.stack([a, zero], 1), np.stack([along, across], 1)], axis=1)


def _laid_out(start: np.ndarray, triangles: np.ndarray, flat: np.ndarray) -> np.ndarray:
    """Return ``start`` (n, 2) moved so that triangles (t, 3) nearly have the shapes ``flat`` (t, 3, 2)."""
    gradient, area = _gradients(flat)
    count, t = len(start), len(triangles)
    rows = np.repeat(np.arange(2 * t).reshape(t, 2, 1), 3, axis=2)
    columns = np.repeat(triangles[:, None, :], 2, axis=1)
    slope = sparse.csr_matrix((gradient.ravel(), (rows.ravel(), columns.ravel())), (2 * t, count))
    weighted = slope.T @ sparse.diags(np.repeat(area, 2))
    stay = _STAY * sparse.identity(count)
    solver = splu((weighted @ slope + stay).tocsc())
    at = start
    for _ in range(_ROUNDS):
        wanted = _similar((slope @ at).reshape(t, 2, 2))
        at = solver.solve(weighted @ wanted.reshape(2 * t, 2) + stay @ start)
    return at


def _gradients(flat: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (t, 2, 3): how much each corner's value adds to the slope along x and y of a triangle; and areas (t,)."""
    (x0, y0), (x1, y1), (x2, y2) = flat.transpose(1, 2, 0)
    double = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    along = np.stack([y1 - y2, y2 - y0, y0 - y1], 1) / double[:, None]
    across = np.stack([x2 - x1, x0 - x2, x1 - x0], 1) / double[:, None]
    return np.stack([along, across], 1), 0.5 * double


def _similar(slopes: np.ndarray) -> np.ndarray:
    """Return the nearest rotations to slopes (t, 2, 2), larger or smaller within :data:`_SCALES`."""
    one, other = slopes[:, 0, 0] + slopes[:, 1, 1], slopes[:, 0, 1] - slopes[:, 1, 0]
    length = np.maximum(np.hypot(one, other), 1e-12)
    scale = np.clip(0.5 * length, *_SCALES)
    cosine, sine = scale * one / length, scale * other / length
    return np.stack([np.stack([cosine, sine], 1), np.stack([-sine, cosine], 1)], 1)
