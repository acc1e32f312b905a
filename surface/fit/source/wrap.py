"""Make the chart of a tongue by wrapping one skin round it: its texture is cut into a back and an underside.

(u, v) go along the tongue, from its root over its length to the tip, and around it, from below over the right, the
top and the left. Rays from a line in its middle find the mesh; what they hit is a mix of a triangle's corners, so that
shapes are sampled by the same rows.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from surface.base.arrays import Floats, Ints
from surface.fit.source.chart import BORDER_WEIGHT, FOLD_WEIGHT, Chart
from surface.fit.source.islands import Island
from surface.fit.source.mesh import SMALL, FitMesh, intersect, triangles

STATIONS, FAN, AROUND = 20, 18, 41  # rays along the line, over its tip, around it
OVERLAP = 0.125  # of the way around, on either side, is sampled twice, so that slopes match where the skin is sewn
ROOT, TIP_SHARE = 0.12, 0.22  # of the length: where the line begins, and how far before the tip it ends
HEIGHT = 0.5  # of the line between the lowest and the highest place
BOW = np.radians(45.0)  # how far below straight ahead the last ray points, so that the pole lies under the tip
INSIDE = 0.02  # of a vertex' distance from the line: skin so much further out hides it
END = 0.997  # of u: a tiny hole at the tip's pole is left out, so that normals are defined everywhere


def wrap_chart(mesh: FitMesh, islands: list[Island], *, even: bool = False) -> Chart:
    """One tile around all islands, which point forwards along z; half as wide as it is long.

    even : rays are as dense at the rim of a flat tongue as on its back, where few at equal angles would meet the rim.
    """
    faces = np.concatenate([np.where(i.faces >= 0, i.vertex[i.faces], -1) for i in islands])
    corners = triangles(faces)
    origins, rays, uv = _rays(mesh.vertices[np.unique(corners)], even=even)
    which, shares = _hits(mesh.vertices[corners], origins, rays)
    mix = _filled(which, shares, corners, uv, len(mesh.vertices))
    spacing = np.tile([1.0 / (STATIONS + FAN - 1), (1.0 + 2.0 * OVERLAP) / (AROUND - 1)], (len(uv), 1))
    loop = np.array([[0.0, 0.0], [END, 0.0], [END, 1.0], [0.0, 1.0]])
    sewn = np.array([-1, -2, -2, -1])  # both long sides are one line
    weight = np.where(uv[:, 0] == 1.0, BORDER_WEIGHT, np.where(which < 0, FOLD_WEIGHT, 1.0))
    return Chart(uv, mix, weight, spacing, which < 0, [loop], [sewn], inner=_inner(mesh.vertices, corners))


def _rays(points: Floats, *, even: bool = False) -> tuple[Floats, Floats, Floats]:
    """Origins and directions (r, 3) of rays through a tongue's skin, and where in (u, v) each hits it (r, 2). even :
    those around the line go to evenly turned places of an ellipse as wide and as high as the tongue."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle, length = low + HEIGHT * (high - low), high[2] - low[2]
    along = np.concatenate([np.linspace(ROOT, 1.0 - TIP_SHARE, STATIONS), np.full(FAN, 1.0 - TIP_SHARE)])
    t = np.concatenate([np.zeros(STATIONS), np.linspace(0.0, 1.0, FAN + 1)[1:]])[:, None]
    v = np.linspace(-OVERLAP, 1.0 + OVERLAP, AROUND)
    flat = (high[0] - low[0]) / max(high[1] - low[1], SMALL) if even else 1.0
    side, up = -np.sin(2.0 * np.pi * v) * flat, -np.cos(2.0 * np.pi * v)
    side, up = (x / np.hypot(side, up) for x in (side, up))
    wide, forward = np.cos(0.5 * np.pi * t), np.sin(0.5 * np.pi * t)
    cosine, sine = np.cos(BOW * t), np.sin(BOW * t)
    rays = np.stack([wide * side, wide * up * cosine - forward * sine, wide * up * sine + forward * cosine], axis=2)
    origins = np.stack([np.broadcast_to(middle[i], along.shape) for i in (0, 1)] + [low[2] + along * length], axis=1)
    u = np.linspace(0.0, 1.0, len(along))
    uv = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
    return np.repeat(origins, AROUND, axis=0), rays.reshape(-1, 3), uv


def _inner(vertices: Floats, corners: Ints) -> Ints:
    """Vertices of triangles ``corners (t, 3)`` that no skin around the line can lie on: others are further out in the
    same direction, as where the underside has a groove, or they are behind the line's beginning, as the root is."""
    own = np.unique(corners)
    points = vertices[own]
    low, high = points.min(axis=0), points.max(axis=0)
    origins = np.tile(low + HEIGHT * (high - low), (len(own), 1))
    first, last = low[2] + np.array([ROOT, 1.0 - TIP_SHARE]) * (high[2] - low[2])
    origins[:, 2] = np.clip(points[:, 2], first, last)
    distance, *_ = intersect(vertices[corners], origins, points - origins)
    hidden = np.nan_to_num(distance, nan=0.0).max(axis=1, initial=0.0) > 1.0 + INSIDE
    inner: Ints = own[hidden | (points[:, 2] < first)]
    return inner


def _hits(tri: Floats, origins: Floats, rays: Floats) -> tuple[Ints, Floats]:
    """The furthest triangle (r,) of ``tri (t, 3, 3)`` that each ray meets, -1 for none, and the shares of its corners
    (r, 3)."""
    distance, *shares = intersect(tri, origins, rays)
    which = np.where(np.isnan(distance), -1.0, distance).argmax(axis=1)
    a, b = (np.take_along_axis(share, which[:, None], axis=1)[:, 0] for share in shares)
    missed = np.isnan(distance).min(axis=1, keepdims=True)
    which = np.where(missed[:, 0], -1, which)
    return which, np.where(missed, 0.0, np.column_stack([1.0 - a - b, a, b]))


def _filled(which: Ints, shares: Floats, corners: Ints, uv: Floats, n: int) -> csr_matrix:
    """(r, n) samples as mixes of vertices; a ray that meets nothing takes the sample that is nearest in (u, v)."""
    met = np.flatnonzero(which >= 0)
    _, near = cKDTree(uv[met]).query(uv)
    source = met[near]
    rows = np.repeat(np.arange(len(uv)), 3)
    return csr_matrix((shares[source].ravel(), (rows, corners[which[source]].ravel())), shape=(len(uv), n))
