"""Eyes that are part of the face's mesh: a patch between the lids that shapes or the texture's cuts set apart."""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.eyes.pieces import SIZE_RANGE, Piece, Side, round_sides, weighted_points
from surface.fit.points.ballfit import Ball, fit_ball, turn_angle
from surface.fit.points.rigidfit import rigid_fit
from surface.fit.source.islands import find_islands
from surface.fit.source.mesh import FitMesh, components, corners, face_areas, renumbered, triangles

LOOKS = ("eyeLookUp", "eyeLookDown", "eyeLookIn", "eyeLookOut")
MAX_REGION = 0.5  # of the distance between both eyes: how far an eye may reach from the middle of what blinks
MIN_BLINK = 0.03  # of a blink's greatest displacement: what moves less is no lid
MIN_TURN = 0.35  # of the greatest displacement by looking: what moves more may be the eyeball
MAX_RESIDUAL = 0.12  # of the displacement that the best rotation may leave
MAX_FIT_ERROR = 0.04  # of a patch's points from a sphere, in radii
MIN_ALIGNMENT = 0.6  # mean cosine between a patch's normals and the directions from its centre
MIN_VERTICES = 9  # of a patch
MIN_SPREAD = 0.3  # sine of half the angle that a patch spans


def shaped_sides(mesh: FitMesh, skin: Bools, near: Floats | None) -> list[Side]:
    """Both eyes as patches of the skin that do not blink, or that turn as a whole; empty where one is missing.

    skin : (f,) faces; near : (2, 3) the middles of what blinks, or None.
    """
    if near is None:
        return []
    reach = MAX_REGION * float(np.linalg.norm(near[0] - near[1]))
    found = [_patch(mesh, skin, side, at, reach) for side, at in zip(("Left", "Right"), near, strict=True)]
    return [side for side in found if side is not None] if all(found) else []


def _patch(mesh: FitMesh, skin: Bools, side: str, middle: Floats, reach: float) -> Side | None:
    """One eye, by how it turns, else by what does not blink."""
    still = _size(mesh, f"eyeBlink{side}")
    still = still < MIN_BLINK * still.max(initial=0.0)
    near = np.linalg.norm(mesh.vertices - middle, axis=1) < reach
    looks = [k for k in (f"{look}{side}" for look in LOOKS) if k in mesh.names]
    by_turn = np.max([_size(mesh, k) for k in looks], axis=0) if len(looks) >= 2 else np.zeros(len(still))
    most = by_turn[near & still].max(initial=0.0)
    for chosen in (still & near & (by_turn > MIN_TURN * most), still & near):
        for faces in _clusters(mesh, skin, chosen, near, middle):
            if found := _as_eye(mesh, faces, looks, 2.0 * reach / (2 * MAX_REGION), middle):
                return found
    return None


def _size(mesh: FitMesh, shape: str) -> Floats:
    """(n,) how far a shape moves every vertex."""
    if shape not in mesh.names:
        return np.zeros(len(mesh.vertices))
    size: Floats = np.linalg.norm(mesh.deltas[mesh.names.index(shape)], axis=1)
    return size


def _clusters(mesh: FitMesh, skin: Bools, chosen: Bools, near: Bools, middle: Floats) -> list[Ints]:
    """Connected faces of the skin whose vertices are all chosen (n,), those nearest to the middle first; clusters that
    go on beyond what is near are none."""
    faces = mesh.faces
    inside = skin & (chosen[np.where(faces < 0, faces[:, :1], faces)]).all(axis=1)
    ids = np.flatnonzero(inside)
    if not len(ids):
        return []
    first, *others = corners(faces[ids])
    label = components(np.concatenate([first] * 3), np.concatenate(others), len(mesh.vertices))
    open_ends = _touching(mesh, skin, ~near)
    out = []
    for k in np.unique(label[first]):
        own = ids[label[first] == k]
        used = renumbered(faces[own])[0]
        if len(used) >= MIN_VERTICES and not open_ends[used].any():
            out.append((float(np.linalg.norm(mesh.vertices[used].mean(axis=0) - middle)), own))
    return [own for _, own in sorted(out, key=lambda pair: pair[0])]


def _touching(mesh: FitMesh, skin: Bools, far: Bools) -> Bools:
    """(n,) vertices of faces of the skin that reach what is far (n,)."""
    faces = mesh.faces[skin]
    filled = np.where(faces < 0, faces[:, :1], faces)
    out = np.zeros(len(mesh.vertices), bool)
    out[filled[far[filled].any(axis=1)].ravel()] = True
    return out


def _as_eye(mesh: FitMesh, faces: Ints, looks: list[str], apart: float, middle: Floats) -> Side | None:
    """A cluster of faces as an eye, if it is round or turns as a whole, is of an eye's size and bulges outwards."""
    points, weight = weighted_points(mesh, faces)
    ball = fit_ball(points, weight)
    if ball is None or ball.off > MAX_FIT_ERROR or not SIZE_RANGE[0] < ball.radius / apart < SIZE_RANGE[1]:
        return None
    turned = turns(mesh, faces, looks)
    if not (ball.spread > MIN_SPREAD and bulges(mesh, faces, ball.centre)):
        return None
    if not turned and np.linalg.norm(points.mean(axis=0) - middle) > 0.5 * apart * MAX_REGION:
        return None
    return Side(grown(mesh, faces), ball, points, weight)


def turns(mesh: FitMesh, faces: Ints, looks: list[str]) -> list[tuple[Floats, Floats]]:
    """Rotation (3, 3) and shift (3,) of the faces in each of the shapes that turns them as a whole."""
    used = renumbered(mesh.faces[faces])[0]
    rest, out = mesh.vertices[used], []
    for name in looks:
        move = mesh.deltas[mesh.names.index(name)][used]
        length = float(np.linalg.norm(move, axis=1).max(initial=0.0))
        if length <= 0:
            continue
        turn, shift = rigid_fit(rest, rest + move)
        left = np.linalg.norm(rest @ turn.T + shift - rest - move, axis=1)
        own = left <= np.quantile(left, 0.9)  # an apex at the back may stay where it is
        turn, shift = rigid_fit(rest[own], (rest + move)[own])
        left = np.linalg.norm(rest @ turn.T + shift - rest - move, axis=1)
        if np.quantile(left, 0.9) < MAX_RESIDUAL * length and turn_angle(turn) > 0.02:
            out.append((turn, shift))
    return out


def bulges(mesh: FitMesh, faces: Ints, centre: Floats) -> bool:
    """Do the faces look away from the centre?"""
    tri = mesh.vertices[triangles(mesh.faces[faces])]
    normal = np.cross(tri[:, 1] - tri[:, 0], tri[:, 2] - tri[:, 0])
    out = tri.mean(axis=1) - centre
    along = (normal * out).sum(axis=1) / np.maximum(np.linalg.norm(out, axis=1), 1e-12)
    total = float(np.linalg.norm(normal, axis=1).sum())
    return bool(along.sum() > MIN_ALIGNMENT * total)


def grown(mesh: FitMesh, faces: Ints) -> Ints:
    """The faces and all that share a vertex with them: what joins an eyeball to the lids' edges goes with it."""
    used = np.zeros(len(mesh.vertices), bool)
    used[renumbered(mesh.faces[faces])[0]] = True
    return np.flatnonzero(used[np.where(mesh.faces < 0, mesh.faces[:, :1], mesh.faces)].any(axis=1))


def island_sides(mesh: FitMesh, skin: Bools, middle: float, near: Floats | None) -> list[Side]:
    """Both eyes as round islands of the skin's texture coordinates; empty without."""
    if not len(mesh.uv) or not skin.any():
        return []
    ids = np.flatnonzero(skin)
    islands = [i for i in find_islands(mesh, ids)[1:] if len(i.vertex) >= MIN_VERTICES]
    area = face_areas(mesh.vertices, mesh.faces[ids]).sum()
    corner = _face_keys(mesh.faces[ids])
    pieces = []
    for island in islands:
        own = ids[np.isin(corner, _face_keys(np.where(island.faces < 0, -1, island.vertex[island.faces])))]
        points, weight = weighted_points(mesh, own)
        ball = fit_ball(points, weight)
        small = face_areas(mesh.vertices, mesh.faces[own]).sum() < 0.1 * area
        if small and ball is not None and bulges(mesh, own, ball.centre):
            pieces.append(Piece(mesh.piece_of(int(own[0])), own, points, weight, _trusted(ball)))
    return round_sides(pieces, middle, near)


def _trusted(ball: Ball) -> Ball:
    """A patch shows less of a sphere than a whole ball and counts as one all the same."""
    enough = ball.spread > MIN_SPREAD and ball.off < MAX_FIT_ERROR
    return Ball(ball.centre, ball.radius, min(ball.off, 0.03), 1.0) if enough else ball


def _face_keys(faces: Ints) -> Ints:
    """(f,) a number for each face that its set of vertices determines, whatever corner it begins with."""
    rows = np.sort(faces, axis=1).astype(np.uint64)
    key = np.zeros(len(rows), np.uint64)
    for k in range(4):
        key = key * np.uint64(1_000_003) + rows[:, k]
    return key.astype(np.int64)
