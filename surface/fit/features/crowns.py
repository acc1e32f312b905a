"""Make charts of teeth: crowns are sampled by rays and fitted as one small patch each.

A tooth's own texture is cut like a paper model; a patch wrapped around the crown needs a tenth of the points.
(u, v) go evenly over the crown, about the tooth's left-right axis: v from the gum behind over the edge to the gum in
front, u from one neighbour to the next.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import identity

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.points.strokes import evenly
from surface.fit.source.chart import TILE, Chart
from surface.fit.source.mesh import FitMesh, components, corners, intersect, renumbered, triangles

GRID = (19, 31)  # samples along u and v
RAYS = (41, 91)  # that they are found with
U_RANGE = (np.radians(7.0), np.radians(173.0))
V_RANGE = (np.radians(165.0), np.radians(-165.0))
CROWN_MM = 10.0  # height of a crown, from its tip towards the gum


def crown_chart(mesh: FitMesh, teeth: list[Ints], upper: bool) -> tuple[Chart, FitMesh]:
    """A chart with one tile per tooth, and the sampled points as a separate mesh.

    teeth : face indices of each tooth.
    upper : upper teeth point down, lower ones up.
    """
    middle = np.mean([_box_centre(mesh.vertices[renumbered(mesh.faces[t])[0]]) for t in teeth], axis=0)
    grids = [_sample(mesh, t, upper, middle) for t in teeth]
    s, t = (np.linspace(0.0, 1.0, k) for k in GRID)
    square = np.stack(np.meshgrid(s, t, indexing="ij"), axis=-1).reshape(-1, 2)
    loop = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    uv = np.concatenate([square + np.array([TILE * k, 0.0]) for k in range(len(teeth))])
    n = len(uv)
    chart = Chart(
        uv, identity(n, format="csr"), np.ones(n), np.tile([1 / (k - 1) for k in GRID], (n, 1)), np.zeros(n, bool),
        [loop + np.array([TILE * k, 0.0]) for k in range(len(teeth))], [], [],
    )  # fmt: skip
    points = np.concatenate(grids)
    empty = np.zeros((0, 4), np.int64)
    return chart, FitMesh(points, empty, uv, empty, (), np.zeros((0, n, 3)))


def split_teeth(mesh: FitMesh, faces: Ints) -> list[Ints]:
    """Face indices of every connected piece."""
    a, *others = corners(mesh.faces[faces])
    label = components(np.concatenate([a] * 3), np.concatenate(others), len(mesh.vertices))[a]
    return [faces[label == i] for i in np.unique(label)]


def _box_centre(points: Floats) -> Floats:
    centre: Floats = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return centre


def _sample(mesh: FitMesh, faces: Ints, upper: bool, middle: Floats) -> Floats:
    """(19 * 31, 3) points of one crown on an even grid, v changing fastest."""
    tri = mesh.vertices[triangles(mesh.faces[faces])]
    down = np.array([0.0, -1.0 if upper else 1.0, 0.0])
    gum = (tri @ down).max() - CROWN_MM
    crown = tri.reshape(-1, 3)[(tri @ down).ravel() > gum]
    centre = _box_centre(crown)
    outward = (centre - middle) * [1.0, 0.0, 1.0]
    length = float(np.linalg.norm(outward))
    outward = outward / length if length > 1e-6 else np.array([0.0, 0.0, 1.0])
    across = np.cross(down, outward)
    a, b = np.meshgrid(np.linspace(*U_RANGE, RAYS[0]), np.linspace(*V_RANGE, RAYS[1]), indexing="ij")
    a, b = a[..., None], b[..., None]
    rays = np.cos(a) * across + np.sin(a) * (np.cos(b) * down - np.sin(b) * outward)
    distance = np.nan_to_num(intersect(tri, centre, rays.reshape(-1, 3))[0], nan=np.inf).min(axis=1)
    distance[np.isinf(distance)] = np.median(distance[np.isfinite(distance)])
    hits = centre + rays * distance.reshape(*RAYS, 1)
    # Rays are dense in some places and miss thin edges; samples are placed evenly.
    rows = np.stack([evenly(_below(row, row @ down > gum), GRID[1]) for row in hits])
    return np.stack([evenly(column, GRID[0]) for column in rows.swapaxes(0, 1)], axis=1).reshape(-1, 3)


def _below(row: Floats, crown: Bools) -> Floats:
    """Of a row of points (k, 3) about a tooth, those in the middle that are its crown's."""
    middle, outside = len(row) // 2, np.flatnonzero(~crown)
    start = outside[outside < middle].max(initial=-1) + 1
    end = outside[outside > middle].min(initial=len(row))
    return row[start:end]
