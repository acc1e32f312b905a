"""A head's skin as samples: what lies how far from it, and over which place in (u, v)."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from surface.base.arrays import Floats, Ints
from surface.head import Head

ANCHORS = ("face", "back")
EAR_X_MM, EAR_Y_MM, EAR_Z_MM = 79.0, (-22.0, 46.0), (-34.0, 26.0)
CENTRE = np.array([0.0, 40.0, 0.0])  # of the skull, from which directions are counted
_NEAR = 6


def unit(rows: Floats) -> Floats:
    """Rows (..., 3) at length 1."""
    return np.asarray(rows / np.maximum(np.linalg.norm(rows, axis=-1, keepdims=True), 1e-9))


class Skin:
    """Samples of the skin at rest.

    data : the head. points, normals : (s, 3). part : (s,) number in :data:`ANCHORS`. uv : (s, 2).
    bare : samples without the ears, which hair lies over or behind.
    """

    def __init__(self, head: Head) -> None:
        self.data = head.data
        self.surfaces = [head.part(name).surface for name in ANCHORS]
        self.uv, self.part, self.points, self.normals = self._samples(head)
        x, y, z = np.abs(self.points[:, 0]), self.points[:, 1], self.points[:, 2]
        ear = (x > EAR_X_MM) & (y > EAR_Y_MM[0]) & (y < EAR_Y_MM[1]) & (z > EAR_Z_MM[0]) & (z < EAR_Z_MM[1])
        outward = (self.normals * (self.points - CENTRE)).sum(axis=1) > 0.0
        self.bare = np.flatnonzero(~ear & (outward | (y < -40.0)))
        self._every, self._bare = cKDTree(self.points), cKDTree(self.points[self.bare])
        self._directions = cKDTree(unit(self.points[self.bare] - CENTRE))

    def _samples(self, head: Head) -> tuple[Floats, Ints, Floats, Floats]:
        """Vertices and middles of all triangles."""
        found = []
        for k, name in enumerate(ANCHORS):
            part = head.part(name)
            corners = part.mesh.uv[part.mesh.triangles]
            uv = np.vstack([part.mesh.uv, corners.mean(axis=1), 0.5 * (corners[:, 0] + corners[:, 1])])
            points, su, sv = part.surface.derivatives(uv)
            normals = unit(np.cross(su, sv)) * (-1.0 if part.mesh.flip else 1.0)
            good = np.isfinite(points).all(axis=1) & np.isfinite(normals).all(axis=1)
            found.append((uv[good], np.full(int(good.sum()), k), points[good], normals[good]))
        uv, number, points, normals = (np.concatenate(column) for column in zip(*found, strict=True))
        return uv, number, points, normals

    def nearest(self, points: Floats, *, ears: bool = False) -> tuple[Floats, Floats]:
        """Normals (n, 3) of the skin nearest to points (n, 3), and how far these lie outside of it (n,), mm."""
        tree, ids = (self._every, np.arange(len(self.points))) if ears else (self._bare, self.bare)
        away, near = tree.query(points, k=_NEAR)
        share = 1.0 / (away + 0.5) ** 2
        share /= share.sum(axis=1, keepdims=True)
        normals = unit((self.normals[ids[near]] * share[..., None]).sum(axis=1))
        foot = (self.points[ids[near]] * share[..., None]).sum(axis=1)
        return normals, ((points - foot) * normals).sum(axis=1)

    def reach(self, directions: Floats) -> Floats:
        """(n,) how far from :data:`CENTRE` the skin without ears lies in unit directions (n, 3), mm."""
        away, near = self._directions.query(directions, k=12)
        radii = np.linalg.norm(self.points[self.bare] - CENTRE, axis=1)[near]
        share = np.exp(-((away / 0.035) ** 2)) + 1e-9
        return np.asarray((radii * share).sum(axis=1) / share.sum(axis=1))

    def anchors(self, points: Floats) -> tuple[Floats, Floats]:
        """(n, 3) part, u and v of the places nearest to points (n, 3), and the points' offsets (n, 3) from them."""
        _, near = self._bare.query(points)
        ids = self.bare[near]
        anchor = np.column_stack([self.part[ids], self.uv[ids]])
        return anchor, points - self.points[ids]
