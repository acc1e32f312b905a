"""The skin behind an eyeball: sockets that nobody sees are left out, so that the opening between the lids is a hole."""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.source.mesh import FitMesh, components, corners, triangles
from surface.head.model.parameters import rotation

MAX_DISTANCE = 1.6  # of a socket from an eye's centre, in radii
COVER_REACH = 3.0  # in radii: brow, nose and cheek this far away hide a socket from views from above or aside
VIEWS = ((0.0, 0.0), (0.6, 0.0), (-0.6, 0.0), (0.0, 0.45), (0.0, -0.45))  # yaw and pitch of the directions of view, rad
PIXEL = 0.04  # in radii
MIN_DEPTH = 0.06  # in radii: what lies this much deeper than what is seen is hidden
MAX_SAMPLES = 24  # of a triangle along an edge
SHRINKAGE = 0.96  # of the radius, so that what lies on the eyeball is not behind it


def hidden_faces(mesh: FitMesh, skin: Bools, centre: Floats, radius: float) -> Ints:
    """Faces of the skin (f,) behind an eyeball that cannot be seen from the front or from half aside; none where the
    skin ends at the lids.

    Faces that lead from there to the lids' edges go, too: the hole's rim is seen.
    """
    filled = np.where(mesh.faces < 0, mesh.faces[:, :1], mesh.faces)
    away = np.linalg.norm(mesh.vertices - centre, axis=1)
    close, hiding = away < MAX_DISTANCE * radius, away < COVER_REACH * radius
    near, cover = (np.flatnonzero(skin & inside[filled].any(axis=1)) for inside in (close, hiding))
    used = np.unique(filled[near])
    if not len(near):
        return near
    seen = np.ones(len(mesh.vertices), bool)
    seen[used] = _seen((mesh.vertices[used] - centre) / radius, _local(mesh, cover, centre) / radius)
    seen[used[~close[used]]] = True
    hidden = _behind(mesh, near[~seen[filled[near]].any(axis=1)], centre)
    lining = np.zeros(len(seen), bool)
    lining[filled[hidden]] = True
    return near[lining[filled[near]].any(axis=1)]


def _local(mesh: FitMesh, faces: Ints, centre: Floats) -> Floats:
    """(t, 3, 3) corners of triangles from an eye's centre."""
    local: Floats = mesh.vertices[triangles(mesh.faces[faces])] - centre
    return local


def _seen(points: Floats, tri: Floats) -> Bools:
    """(m,) which points are seen in one of the views, past triangles (t, 3, 3) and a ball of radius 1 at the origin."""
    out = np.zeros(len(points), bool)
    size = int(np.ceil(2.0 * (COVER_REACH + 1.0) / PIXEL))
    samples = _samples(tri)
    for yaw, pitch in VIEWS:
        turn = rotation(yaw, pitch)
        at, cover = points @ turn, samples @ turn  # in the viewer's axes, whose z points at them
        depth = np.full((size, size), -np.inf)
        i, j = _pixels(cover, size)
        np.maximum.at(depth, (i, j), cover[:, 2])
        i, j = _pixels(at, size)
        across = (at[:, :2] ** 2).sum(axis=1)
        ball = np.where(across < SHRINKAGE**2, np.sqrt(np.maximum(SHRINKAGE**2 - across, 0.0)), -np.inf)
        out |= at[:, 2] > np.maximum(depth[i, j], ball) - MIN_DEPTH
    return out


def _pixels(points: Floats, size: int) -> tuple[Ints, Ints]:
    at = np.clip(((points[:, :2] + COVER_REACH + 1.0) / PIXEL).astype(np.int64), 0, size - 1)
    return at[:, 0], at[:, 1]


def _samples(tri: Floats) -> Floats:
    """(s, 3) points all over triangles, no further apart than pixels, as long as those are not too large."""
    longest = np.linalg.norm(tri - np.roll(tri, -1, axis=1), axis=2).max(axis=1)
    steps = np.clip(np.ceil(longest / (0.7 * PIXEL)), 1, MAX_SAMPLES).astype(int)
    out = []
    for count in np.unique(steps):
        own = tri[steps == count]
        s, t = np.meshgrid(np.arange(count + 1) / count, np.arange(count + 1) / count, indexing="ij")
        s, t = s[s + t <= 1.0 + 1e-9], t[s + t <= 1.0 + 1e-9]
        share = np.column_stack([1.0 - s - t, s, t])
        out.append(np.einsum("sk,tkx->tsx", share, own).reshape(-1, 3))
    return np.concatenate(out)


def _behind(mesh: FitMesh, hidden: Ints, centre: Floats) -> Ints:
    """The connected hidden faces that an eye's line of sight meets behind its centre; else the largest set of them."""
    if not len(hidden):
        return hidden
    first, *others = corners(mesh.faces[hidden])
    label = components(np.concatenate([first] * 3), np.concatenate(others), len(mesh.vertices))[first]
    away = mesh.vertices[mesh.faces[hidden, :3]].mean(axis=1) - centre
    off = np.hypot(away[:, 0], away[:, 1])
    return np.asarray(hidden[label == label[np.argmin(off)]])
