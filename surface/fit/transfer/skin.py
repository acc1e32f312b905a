"""Bring a head's skin onto a scan: the map first, then the scan's own detail, lips closed, lids on the eyeballs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, diags
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

from surface.base.arrays import Floats, Ints
from surface.dcp import DCPSurface
from surface.fit.features.rigging import lid_share
from surface.fit.points.net import Net
from surface.fit.points.solve import solve
from surface.fit.transfer.register import Matcher
from surface.fit.transfer.warp import Warp
from surface.head import Contact, Head, HeadPart
from surface.head.model.parameters import smoothstep

DETAIL_MM, PASSES = 5.0, 3  # of the scan, which the skin is moved by at most in one pass
SMOOTH = 0.6  # of detail, against how closely it is followed
RIM_MM = (1.5, 4.0)  # from the rim of an opening: nearer than the first the scan shows no skin, further all of it
LIP_FADE_MM = 14.0
FAIR = 1e-3
NEAR, NEAR_MM = 6, 12.0  # points of the skin that another part follows, and how far


@dataclass(frozen=True)
class Ball:
    """Eyeballs: centres (2, 3), left first, and radius."""

    centres: Floats
    radius: float


class Skin:
    """One part of skin as triangles: ``rest (n, 3)`` on the head it comes from, ``at (n, 3)`` on the scan."""

    def __init__(self, part: HeadPart, rims: Floats, warp: Warp) -> None:
        self.name, self.surface, self.mesh = part.name, part.surface, part.mesh
        n = len(part.mesh.uv)  # seams may have added copies
        self.rest = part.vertices[:n].astype(float)
        self.at = warp(self.rest)
        distance = cKDTree(rims).query(self.rest)[0] if len(rims) else np.full(n, np.inf)
        self._seen = smoothstep(distance, *RIM_MM)
        self._matrix = _laplacian(part.mesh.triangles, n)

    def follow(self, matcher: Matcher, scale: float) -> None:
        """Move along normals to the scan where it has data; in between as smoothly as the map did."""
        for _ in range(PASSES):
            normals = self.normals()
            match = matcher.find(self.at, normals, DETAIL_MM * scale, 0.0)
            off = ((match.goals - self.at) * normals).sum(axis=1)
            weight = self._seen * match.found
            system = (diags(weight + 1e-6) + SMOOTH * self._matrix).tocsc()
            self.at = self.at + spsolve(system, weight * off)[:, None] * normals

    def normals(self) -> Floats:
        """(n, 3) unit normals of the skin as it lies."""
        tri = self.mesh.triangles
        cross = np.cross(self.at[tri[:, 1]] - self.at[tri[:, 0]], self.at[tri[:, 2]] - self.at[tri[:, 0]])
        out = np.zeros_like(self.at)
        for k in range(3):
            np.add.at(out, tri[:, k], cross)
        unit: Floats = out / np.maximum(np.linalg.norm(out, axis=1), 1e-12)[:, None]
        return unit

    def control_points(self) -> Floats:
        """(n, 3) positions of the surface's control points that put it where the skin lies, in least squares."""
        s = self.surface
        net = Net(np.zeros((s.n, 4), np.int64), *s.padded)
        b = s.basis_matrix(self.mesh.uv, side=self.mesh.side)
        moves = solve(net, b, np.ones(len(self.rest)), self.at - b @ s.points, FAIR)
        return np.asarray(s.points + moves)


def _laplacian(triangles: Ints, n: int) -> coo_matrix:
    """(n, n) squared graph Laplacian of triangles, normalised."""
    a = np.concatenate([triangles, triangles[:, ::-1]]).reshape(-1, 3)
    i, j = np.concatenate([a[:, 0], a[:, 1], a[:, 2]]), np.concatenate([a[:, 1], a[:, 2], a[:, 0]])
    links = coo_matrix((np.ones(len(i)), (i, j)), shape=(n, n)).tocsr()
    links.data[:] = 1.0
    share = diags(1.0 / np.maximum(np.asarray(links.sum(axis=1)).ravel(), 1.0)) @ links
    step = diags(np.ones(n)) - share
    return (step.T @ step).tocsr()


def close_lips(skin: Skin, contact: Contact, scale: float) -> None:
    """Take back what the scan's lips stand further apart than those of the head the skin comes from."""
    rows = skin.surface.evaluate(contact.places.reshape(-1, 2)).reshape(*contact.places.shape[:3], 3)
    uv = skin.mesh.uv  # in which the lips are apart; in space each touches the other
    share = _nearest_shares(contact.places[:, :, 0].reshape(-1, 2), uv)
    moved = (share @ (skin.at - skin.rest)).reshape(*rows.shape[:2], 3)
    apart = moved[0] - moved[1] - (scale - 1.0) * (rows[0, :, 0] - rows[1, :, 0])
    apart[:, [0, 2]] = 0.0
    x = rows[:, :, 0, 0].mean(axis=0)
    order = np.argsort(x)
    distance = np.stack([cKDTree(side.reshape(-1, 2)).query(uv)[0] for side in contact.places])
    rim = np.stack([cKDTree(side[:, 0]).query(skin.rest)[0] for side in rows])
    side = (distance[1] < distance[0]).astype(int)
    fade = 1.0 - smoothstep(rim.min(axis=0), 0.0, LIP_FADE_MM)
    push = np.column_stack([np.interp(skin.rest[:, 0], x[order], apart[order, k]) for k in range(3)])
    part = np.where(side == 0, -contact.share, 1.0 - contact.share)
    skin.at = skin.at + (part * fade)[:, None] * push


def seat(points: Floats, rest: Floats, old: Ball, new: Ball) -> Floats:
    """Points (n, 3) moved to or from the new eyeballs until they are as high above them as ``rest (n, 3)`` above the
    old ones, where that is low."""
    share = lid_share(rest, old.centres, old.radius)
    side = (share < 0).astype(int)
    ratio = new.radius / old.radius
    above = ratio * (np.linalg.norm(rest - old.centres[side], axis=1) - old.radius)
    offset = points - new.centres[side]
    length = np.maximum(np.linalg.norm(offset, axis=1), 1e-9)
    move = np.abs(share) * (new.radius + above - length)
    seated: Floats = points + (move / length)[:, None] * offset
    return seated


def _nearest_shares(places: Floats, uv: Floats) -> csr_matrix:
    """(m, n) shares of the nearest of uv (n, 2) in each of places (m, 2)."""
    distance, near = cKDTree(uv).query(places, k=3)
    weight = 1.0 / (distance + 1e-6)
    weight /= weight.sum(axis=1, keepdims=True)
    rows = np.repeat(np.arange(len(places)), 3)
    return csr_matrix((weight.ravel(), (rows, near.ravel())), shape=(len(places), len(uv)))


def _followed(points: Floats, rest: Floats, moves: Floats) -> Floats:
    """(m, 3) means of moves (n, 3) of the points ``rest`` around each of ``points (m, 3)``."""
    distance, near = cKDTree(rest).query(points, k=NEAR)
    weight = 1.0 / (distance + 0.3) ** 2
    weight /= weight.sum(axis=1, keepdims=True)
    mean: Floats = np.einsum("mk,mkc->mc", weight, moves[near])
    return mean


def follow_skin(points: Floats, skin: Skin, warp: Warp) -> Floats:
    """Points (m, 3) of another part, moved by the map and, near the skin, by what the skin was moved further."""
    residual = skin.at - warp(skin.rest)
    nearest = cKDTree(skin.rest).query(points)[0]
    fade = 1.0 - smoothstep(nearest, 0.0, NEAR_MM)
    moved: Floats = warp(points) + fade[:, None] * _followed(points, skin.rest, residual)
    return moved


def rims_of(head: Head) -> Floats:
    """(m, 3) the rims of all openings of a head's face."""
    lips = [c for c in head.data.contacts if c.name == "lips"]
    part = next(p for p in head.data.parts if p.name == lips[0].part)
    surface: DCPSurface = head.part(part.name).surface
    rims: Floats = surface.evaluate(np.concatenate(part.loops[1:]))
    return rims
