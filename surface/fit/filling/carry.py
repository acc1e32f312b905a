"""Carry the motions of a head over to a mesh that lies on it: skin from skin, lashes from lashes, teeth with the jaw.

Places on skin correspond where they are near and face the same way, so that an upper lip, which touches the lower one,
takes nothing from that. Rims of lids correspond to rims, since a head's lids lie on its own eyeballs. What has no place
on the head moves as what it is connected with.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, diags
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from surface.base.arrays import Bools, Floats, Ints
from surface.check.subject import Subject
from surface.fit.filling.rims import rims_of_head, rims_of_mesh
from surface.fit.source.kinds import kind_of
from surface.fit.source.mesh import FitMesh, components, directed_edges, triangles
from surface.fit.transfer.warp_head import SOCKETS
from surface.head import Head

NORMAL_MM = 6.0  # distance that a difference of normals by 1 counts as: lips that touch face each other
LEAST_COSINE = 0.3  # between the normals of places that correspond
FARTHEST_MM = 8.0  # of a place on skin from the place on the head that it takes its motion from
NEAR = 4  # places on the head whose motions are mixed
SOFT_MM = 0.3  # distance up to which they hardly differ in weight
GROUND = 1e-6  # of a connection: what hangs on nothing that moves is held by it
SKIN, LASH, TONGUE, EYE, STILL, INSIDE = "skin", "lash", "tongue", "eye", "still", "inside"
FROM = {SKIN: ("skin", "mouth"), LASH: ("lash",), TONGUE: ("tongue",)}
"""Materials of the head that each sort of the mesh's vertices takes its motion from."""
ROWS = {"teeth": INSIDE, "gums": INSIDE, "tongue": TONGUE, "lash": LASH}
"""Sorts of pieces by material; others are skin, or move with it."""
RIGID = ("jaw", "skull")


class Carrier:
    """Carries the motions of a head over to a mesh whose vertices (n, 3) lie on it, in the head's frame, mm."""

    def __init__(self, mesh: FitMesh, head: Head) -> None:
        self._subject, self._count = Subject(head), len(mesh.vertices)
        self._rims = rims_of_mesh(mesh), rims_of_head(head)
        self._offsets = np.cumsum([0, *(len(rest) for rest in self._subject.rest)])
        self._rest = np.concatenate(self._subject.rest).astype(np.float64)
        head.pose(head.values({}))
        normals = np.concatenate([part.normals for part in head.parts]).astype(np.float64)
        self._normals = normals / np.maximum(np.linalg.norm(normals, axis=1), 1e-12)[:, None]
        self._tongue = np.zeros_like(mesh.vertices)  # from its place to the head's: put out, it lies where that lies
        self._matrix, known = self._share_of(mesh)
        self._continued = Continued(mesh, known)

    def moves(self, names: Sequence[str]) -> Floats:
        """(k, n, 3), mm: how the mesh moves in the shapes of some ``names``; tongueOut opens the jaw, too."""
        out = np.zeros((len(names), self._count, 3))
        for row, name in zip(out, names, strict=True):
            row[:] = self._matrix @ np.concatenate(self._subject.moves(name)).astype(np.float64)
            self._continued.fill(row)
            if name == "tongueOut":
                row += self._tongue
        return out

    def _share_of(self, mesh: FitMesh) -> tuple[csr_matrix, Bools]:
        """(n, m) how much of the motion of each of the head's m vertices goes into that of each of the mesh's; and of
        which of these (n,) it says how they move."""
        sort, normals = self._sorts(mesh), vertex_normals(mesh)
        matrix, known = csr_matrix((self._count, len(self._rest))), np.isin(sort, (EYE, STILL))
        for kind in (SKIN, LASH, TONGUE):
            ids = np.flatnonzero(sort == kind)
            rows, found = self._nearest(kind, mesh.vertices[ids], normals[ids], eyes=not (sort == EYE).any())
            matrix += _spread(rows, ids[found], self._count)
            known[ids[found]] = True
            if kind == TONGUE and len(ids):
                self._tongue[ids] = _boxed(mesh.vertices[ids], self._rest[self._of(FROM[TONGUE])]) - mesh.vertices[ids]
        for follows in RIGID:
            ids = np.flatnonzero(sort == follows)
            matrix += _spread(self._rigid(follows, mesh.vertices[ids]), ids, self._count)
            known[ids] = True
        return matrix.tocsr(), known

    def _sorts(self, mesh: FitMesh) -> Ints:
        """(n,) of which sort each vertex is: a key of FROM, ``eye``, ``still``, or what of RIGID it follows."""
        sort = np.full(self._count, SKIN, dtype="<U8")
        for k, name in enumerate(mesh.pieces):
            kind = kind_of(name)
            own = np.unique(mesh.faces[mesh.piece == k])
            sort[own[own >= 0]] = {"eye": EYE, "out": STILL}.get(kind.rule, ROWS.get(kind.material, SKIN))
        if not self._of(FROM[LASH]).any():
            sort[sort == LASH] = SKIN
        inside = np.flatnonzero(sort == INSIDE)
        if len(inside):
            sort[inside] = self._inside(mesh, inside)
        sort[(sort == TONGUE) & (not self._of(FROM[TONGUE]).any())] = "jaw"
        return sort

    def _inside(self, mesh: FitMesh, ids: Ints) -> Ints:
        """Which of RIGID, or the tongue, each connected piece inside the mouth belongs to: the nearest, on average."""
        label: Ints = components(*directed_edges(mesh.faces), self._count)[ids]
        masks = {f: self._follow(f) for f in RIGID} | {TONGUE: self._of(FROM[TONGUE])}
        there = {key: mask for key, mask in masks.items() if mask.any()}
        if not there:
            return np.full(len(ids), STILL)
        _, piece = np.unique(label, return_inverse=True)
        far = [cKDTree(self._rest[mask]).query(mesh.vertices[ids])[0] for mask in there.values()]
        mean = np.stack([np.bincount(piece, f) for f in far]) / np.bincount(piece)
        nearest: Ints = np.array(list(there))[mean.argmin(axis=0)[piece]]
        return nearest

    def _of(self, materials: Sequence[str]) -> Bools:
        """(m,) which vertices of the head are of some materials, less what lies behind its lids."""
        return self._chosen([p.material in materials and p.name != SOCKETS for p in self._subject.parts])

    def _follow(self, follows: str) -> Bools:
        return self._chosen([p.follows == follows for p in self._subject.parts])

    def _chosen(self, parts: Sequence[bool]) -> Bools:
        return np.repeat(np.array(parts, bool), np.diff(self._offsets))

    def _nearest(self, kind: str, at: Floats, normals: Floats, *, eyes: bool) -> tuple[csr_matrix, Bools]:
        """For places (k, 3) with normals: (f, m) weights of the head's vertices for the f that correspond to any, and
        which (k,) these are. eyes : the mesh's eyes are in one piece with its skin."""
        own = np.flatnonzero(self._of((*FROM[kind], *(("eye",) if eyes and kind == SKIN else ()))))
        if not len(own) or not len(at):
            return csr_matrix((0, len(self._rest))), np.zeros(len(at), bool)
        rest, by_normal = self._rest[own], NORMAL_MM if kind == SKIN else 0.0
        ours, theirs = self._rims
        if kind == TONGUE:
            at = _boxed(at, rest)
        elif ours is not None and theirs is not None:
            at = ours.moved_to(theirs, at)
        tree = cKDTree(np.hstack([rest, by_normal * self._normals[own]]))
        _, near = tree.query(np.hstack([at, by_normal * normals]), k=NEAR)
        far = np.linalg.norm(rest[near] - at[:, None], axis=2)
        cosine = (self._normals[own][near[:, 0]] * normals).sum(axis=1)
        found = (far[:, 0] < FARTHEST_MM) & (cosine > LEAST_COSINE) if kind == SKIN else np.ones(len(at), bool)
        return _weights(own[near[found]], 1.0 / (far[found] + SOFT_MM) ** 2, len(self._rest)), found

    def _rigid(self, follows: str, at: Floats) -> csr_matrix:
        """(k, m) weights that sum to 1 and make of the head's vertices the places (k, 3): what follows its jaw, or its
        skull, moves by an affine map, which some of its vertices give everywhere."""
        own = np.flatnonzero(self._follow(follows))
        corners = _corners(self._rest[own])
        base = np.hstack([self._rest[own[corners]], np.ones((len(corners), 1))])
        share = np.hstack([at, np.ones((len(at), 1))]) @ np.linalg.pinv(base)
        return _weights(np.tile(own[corners], (len(at), 1)), share, len(self._rest), sums=False)


def vertex_normals(mesh: FitMesh) -> Floats:
    """(n, 3) unit normals, by the area of the faces around each vertex; 0 where there are none."""
    tri = triangles(mesh.faces)
    a, b, c = (mesh.vertices[tri[:, k]] for k in range(3))
    cross, out = np.cross(b - a, c - a), np.zeros_like(mesh.vertices)
    for k in range(3):
        np.add.at(out, tri[:, k], cross)
    unit: Floats = out / np.maximum(np.linalg.norm(out, axis=1), 1e-12)[:, None]
    return unit


def _boxed(at: Floats, rest: Floats) -> Floats:
    """Places (k, 3) moved and stretched as their box onto that of others."""
    low, size = at.min(axis=0), np.maximum(np.ptp(at, axis=0), 1e-9)
    boxed: Floats = rest.min(axis=0) + (at - low) / size * np.ptp(rest, axis=0)
    return boxed


def _corners(points: Floats) -> Ints:
    """Indices of points (n, 3) that span all of them: the outermost along and against each axis."""
    return np.unique(np.concatenate([points.argmin(axis=0), points.argmax(axis=0)]))


def _weights(columns: Ints, share: Floats, width: int, *, sums: bool = True) -> csr_matrix:
    """(k, width) matrix of ``share (k, c)`` in ``columns (k, c)``; rows sum to 1 where that is asked for."""
    if sums:
        share = share / share.sum(axis=1, keepdims=True)
    rows = np.repeat(np.arange(len(columns)), columns.shape[1])
    return csr_matrix((share.ravel(), (rows, columns.ravel())), shape=(len(columns), width))


def _spread(rows: csr_matrix, ids: Ints, count: int) -> csr_matrix:
    """Rows (k, m) of a matrix put into places ``ids (k,)`` of one with ``count`` rows."""
    put = csr_matrix((np.ones(len(ids)), (ids, np.arange(len(ids)))), shape=(count, len(ids)))
    return put @ rows


class Continued:
    """Continues motions to vertices that are not known: the mean of those around each, as a net of springs would.

    known : (n,) which are.
    """

    def __init__(self, mesh: FitMesh, known: Bools) -> None:
        self._known, self._free = known, np.flatnonzero(~known)
        a, b = directed_edges(mesh.faces)
        edges = csr_matrix((np.ones(2 * len(a)), (np.append(a, b), np.append(b, a))), shape=(len(known), len(known)))
        edges.data[:] = 1.0
        own = edges[self._free]
        self._beside = own[:, np.flatnonzero(known)]
        held = diags(np.asarray(own.sum(axis=1)).ravel() + GROUND) - own[:, self._free]
        self._solve = splu(csc_matrix(held)).solve if len(self._free) else None

    def fill(self, moves: Floats) -> None:
        """Set the rows of ``moves (n, 3)`` that are not known."""
        if self._solve is not None:
            moves[self._free] = self._solve(self._beside @ moves[self._known])
