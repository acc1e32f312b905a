"""Openings between lids: holes of the face in front of the eyes, and eyeballs fitted behind their rims."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial import cKDTree

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.eyes.pieces import USUAL_SIZE, mirrored
from surface.fit.points.ballfit import Ball
from surface.fit.points.lid_seating import LID_MM
from surface.fit.source.islands import Island, boundary_loops
from surface.fit.source.mesh import FitMesh, directed_edges, renumbered

WIDTH_RANGE = (0.15, 0.9)  # of an opening, in distances between both
MAX_OFFSET = 0.45  # of the middle of what blinks from its opening's, in distances between both openings
MIN_NORMAL_Z = 0.3  # of an opening
MIN_RINGS = 5  # of vertices around a hole, in which the lids' edges lie
RING_DEPTH = 0.2  # of a hole's width: on fine meshes the lids' edges lie in all rings this near to it
MAX_RINGS = 60
SECTOR_FRACTION = 0.4  # of a vertex's part of the whole turn: how far beside it the edge is searched
MIN_SECTOR = 0.12  # of that, rad, as holes may be finer than skin
CORNER_WIDTH = 0.15  # of the hole's width from a corner, in which that minimum is not used
MAX_EDGE_RATIO = 0.97  # of an edge's distance from the hole's middle to the hole's own: others are the hole itself
FULL_WIDTH, FULL_HEIGHT = 0.40, 0.70  # least radius of an eyeball, in widths and heights of the opening it has to fill
PRIOR_WEIGHT = 6.0  # of the usual radius, in vertices of an edge
SHAPES = ("eyeBlink", "eyeWide", "eyeSquint", "eyeLookUp", "eyeLookDown")  # that slide lids over the eyeball
MIN_FRONT = 0.3  # in radii in front of the centre: skin further back may lie inside the eyeball


@dataclass(frozen=True)
class Opening:
    """An opening between lids.

    side : "Left" or "Right"; edge : (e,) vertices of the lids' edges; middle : (3,); size : (2,) width and height, mm.
    """

    side: str
    edge: Ints
    middle: Floats
    size: Floats


def find_openings(mesh: FitMesh, skin: Bools, middle: float, near: Floats | None) -> list[Opening]:
    """The left and the right opening; empty where no two holes of the skin (f,) mirror each other."""
    holes = [h for h in _holes(mesh, skin) if _faces_front(mesh.vertices[h])]
    middles = [_centre(mesh.vertices[h]) for h in holes]
    best: tuple[float, int, int] | None = None
    for i, p in enumerate(middles):
        for j, q in enumerate(middles):
            apart = float(p[0] - q[0])
            if p[0] <= middle or q[0] >= middle or not mirrored(p, q, middle):
                continue
            sizes = [float(np.ptp(mesh.vertices[holes[k], 0])) / apart for k in (i, j)]
            placed = near is None or max(np.linalg.norm(np.stack([p, q]) - near, axis=1)) < MAX_OFFSET * apart
            if placed and all(WIDTH_RANGE[0] < s < WIDTH_RANGE[1] for s in sizes) and apart > (best or (0.0,))[0]:
                best = apart, i, j
    if best is None:
        return []
    return [_opening(mesh, skin, holes[k], side) for k, side in ((best[1], "Left"), (best[2], "Right"))]


def _holes(mesh: FitMesh, skin: Bools) -> list[Ints]:
    """Loops of border edges of the skin, as mesh vertices, but the longest, which goes round the whole face."""
    used, faces = renumbered(mesh.faces[skin])
    loops = boundary_loops(Island(used, mesh.vertices[used][:, :2], faces))
    return [used[loop] for loop in loops if len(loop) >= 6]


def _faces_front(points: Floats) -> bool:
    """Is a loop (k, 3) seen from the front as an area, not from its edge?"""
    local = points - points.mean(axis=0)
    area = 0.5 * np.cross(local, np.roll(local, -1, axis=0)).sum(axis=0)
    return bool(abs(area[2]) > MIN_NORMAL_Z * max(float(np.linalg.norm(area)), 1e-12))


def _centre(points: Floats) -> Floats:
    centre: Floats = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return centre


def _opening(mesh: FitMesh, skin: Bools, hole: Ints, side: str) -> Opening:
    edge = _edge(mesh, skin, hole)
    points = mesh.vertices[edge]
    return Opening(side, edge, _centre(points), np.ptp(points[:, :2], axis=0))


def _edge(mesh: FitMesh, skin: Bools, hole: Ints) -> Ints:
    """Vertices of the lids' edges around a hole: those nearest to its middle, seen from the front.

    A lid's lining leads from its edge back over the eyeball, so the hole itself lies behind the lids.
    """
    ids, middle = np.flatnonzero(_around(mesh, skin, hole)), _centre(mesh.vertices[hole])
    angle, off = _polar(mesh.vertices[ids], middle)
    own, away = _polar(mesh.vertices[hole], middle)
    turn = np.abs((angle - own[:, None] + np.pi) % (2 * np.pi) - np.pi)
    beside = np.where(turn < _sectors(mesh.vertices[hole])[:, None], off, np.inf)
    nearest = np.where(beside.min(axis=1) < MAX_EDGE_RATIO * away, ids[beside.argmin(axis=1)], hole)
    return np.unique(nearest)


def _sectors(hole: Floats) -> Floats:
    """(h,) how far aside of a hole's vertices (h, 3) the edge is looked for, rad; in corners it soon becomes nearer."""
    low, high = hole[:, 0].min(), hole[:, 0].max()
    inside = np.minimum(hole[:, 0] - low, high - hole[:, 0]) > CORNER_WIDTH * (high - low)
    return np.maximum(SECTOR_FRACTION * 2 * np.pi / len(hole), np.where(inside, MIN_SECTOR, 0.0))


def _around(mesh: FitMesh, skin: Bools, hole: Ints) -> Bools:
    """(n,) vertices in a few rings about a hole, and in more where they are near it."""
    a, b = directed_edges(mesh.faces[skin])
    reached = np.zeros(len(mesh.vertices), bool)
    reached[hole] = True
    near = cKDTree(mesh.vertices[hole]).query(mesh.vertices)[0] < RING_DEPTH * np.ptp(mesh.vertices[hole, 0])
    for ring in range(MAX_RINGS):
        fresh = np.zeros_like(reached)
        fresh[np.concatenate([b[reached[a]], a[reached[b]]])] = True
        fresh &= ~reached & (near | (ring < MIN_RINGS))
        if not fresh.any():
            break
        reached |= fresh
    return reached


def _polar(points: Floats, middle: Floats) -> tuple[Floats, Floats]:
    """Angle and distance (m,) of points from a middle, seen from the front."""
    across = points[:, :2] - middle[:2]
    return np.arctan2(across[:, 1], across[:, 0]), np.linalg.norm(across, axis=1)


def lid_positions(mesh: FitMesh, opening: Opening) -> Floats:
    """(m, 3) where the lids' edges are, at rest and in every shape that slides them over the eyeball."""
    rest, out = mesh.vertices[opening.edge], [mesh.vertices[opening.edge]]
    for name in (f"{shape}{opening.side}" for shape in SHAPES):
        if name in mesh.names:
            move = mesh.deltas[mesh.names.index(name)][opening.edge]
            moved = np.linalg.norm(move, axis=1) > 0.1 * max(float(np.linalg.norm(move, axis=1).max()), 1e-9)
            out.append((rest + move)[moved])
    return np.concatenate(out)


def usual_radius(opening: Opening, apart: float) -> float:
    """Radius of an eyeball that fills an opening: as people's, in the distance between the eyes, or larger."""
    return max(USUAL_SIZE * apart, FULL_WIDTH * float(opening.size[0]), FULL_HEIGHT * float(opening.size[1]))


def ball_behind(mesh: FitMesh, opening: Opening, flat: Floats | None, apart: float) -> Ball:
    """An eyeball behind an opening, on which the lids' edges lie at rest and wherever they slide.

    flat : (3,) the middle of a flat eye that it stands for, or None. apart : distance between both eyes, mm.

    Least squares of the edges' heights above the sphere, with the radius held near the usual one: edges lie nearly in
    one plane, unless shapes move them.
    """
    points, usual = lid_positions(mesh, opening), usual_radius(opening, apart)
    across = (opening.middle if flat is None else flat)[:2]
    pull = np.sqrt(PRIOR_WEIGHT * len(points) / len(opening.edge)), np.sqrt(0.5 * PRIOR_WEIGHT)

    def off(x: Floats) -> Floats:
        heights = np.linalg.norm(points - x[:3], axis=1) - x[3] - LID_MM[0]
        held = pull[0] * (x[3] - usual), *(pull[1] * (x[:2] - across))
        return np.concatenate([heights, held]) / usual

    start = np.append([across[0], across[1], float(np.median(points[:, 2])) - 0.9 * usual], usual)
    x = least_squares(off, start, loss="soft_l1", f_scale=0.05).x
    return Ball(set_back(x[:3], float(x[3]), mesh.vertices[opening.edge]), float(x[3]), 0.0, 1.0)


def set_back(centre: Floats, radius: float, edge: Floats) -> Floats:
    """The centre, moved back until nine tenths of an edge (e, 3) lie outside the sphere."""
    across = np.linalg.norm(edge[:, :2] - centre[:2], axis=1)
    seen = edge[(edge[:, 2] > centre[2] + MIN_FRONT * radius) & (across < 0.98 * radius)]
    if not len(seen):
        return centre
    height = np.sqrt(np.maximum(radius**2 - ((seen - centre)[:, :2] ** 2).sum(axis=1), 0.0))
    inside = centre[2] + height + LID_MM[0] - seen[:, 2]
    return centre - [0.0, 0.0, max(float(np.quantile(inside, 0.9)), 0.0)]
