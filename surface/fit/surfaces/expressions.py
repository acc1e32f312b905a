"""Transfer the expressions of a head to surfaces read from a file, whose form stays as it is.

The other head has been given the form of the surfaces before (:mod:`surface.fit.transfer`). Each of its expressions is
a displacement field over its skin. The field is sampled on the surfaces, at the nearest places of the skin that have a
similar normal, and then fitted in least squares by displacements of the surfaces' own control points. Control points
that the samples do not determine take the weighted mean of the field over their subdomain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from surface.base.arrays import Floats
from surface.fit.surfaces.build import sparse_group
from surface.fit.surfaces.pieces import Piece
from surface.head.model.data import HeadData, PartData
from surface.head.model.meshes import make_surface
from surface.head.model.parameters import SHAPES, smoothstep
from surface.head.posing.head import Head

NORMAL_MM = 14.0  # distance that a difference of normals by 1 counts as in the search for the nearest places
FINER_FACTOR = (
    8.0  # divides the chord error of the sampling, so that the control points of flat surfaces get samples, too
)
NEIGHBOURS = 4  # places of the skin whose displacements are averaged at a sample
FADE_MM = (12.0, 35.0)  # distance from the other head's skin where displacements begin to fade, and where they are 0
MEAN_WEIGHT = 1e-2  # weight of the mean over a subdomain, relative to that of the samples in it
MIN_MM = 0.01  # shorter displacements are dropped
MIN_GROUP_MM = 0.25  # groups whose displacements are all shorter are dropped
MIN_SHOWN = 0.5  # of a rule's group, such as a wrinkle: the fraction that the surfaces must reproduce to keep the group


@dataclass(frozen=True)
class Fields:
    """Displacements of a head's skin at ``points (m, 3)`` with unit ``normals (m, 3)``, mm.

    values : (m, c), three columns for each of the groups ``names``, then one for the share of the jaw's rotation.
    """

    points: Floats
    normals: Floats
    names: tuple[str, ...]
    values: Floats

    def at(self, points: Floats, normals: Floats) -> Floats:
        """(k, c) values at other points (k, 3) with unit normals (k, 3)."""
        tree = cKDTree(np.hstack([self.points, NORMAL_MM * self.normals]))
        distance, near = tree.query(np.hstack([points, NORMAL_MM * normals]), k=NEIGHBOURS)
        weight = 1.0 / (distance + 0.3) ** 2
        weight /= weight.sum(axis=1, keepdims=True)
        away = np.linalg.norm(self.points[near[:, 0]] - points, axis=1)
        weight *= (1.0 - smoothstep(away, *FADE_MM))[:, None]
        out: Floats = sum(weight[:, k, None] * self.values[near[:, k]] for k in range(NEIGHBOURS))
        return out


def skin_fields(head: HeadData) -> Fields:
    """The displacement fields of all groups over the visible skin of a head at rest."""
    made = Head(head)
    skins = [p for p in head.parts if p.follows == "skin" and p.material == "skin" and p.name != "sockets"]
    names = tuple(dict.fromkeys(g.name for p in skins for g in p.groups))
    rows = []
    for part in skins:
        own = made.part(part.name)
        mesh, count = own.mesh, len(own.mesh.uv)  # seams may have added copies
        basis = own.surface.basis_matrix(mesh.uv, side=mesh.side)
        points, normals = own.vertices[:count].astype(float), own.normals[:count].astype(float)
        rows.append((points, normals, basis @ _dense(part, names)))
    every = [np.concatenate([row[k] for row in rows]) for k in range(3)]
    return Fields(every[0], every[1], names, every[2])


def _dense(part: PartData, names: tuple[str, ...]) -> Floats:
    """(n, 3 g + 1) displacements by the g groups ``names``, 0 for groups that the part lacks, and the jaw's share."""
    out = np.zeros((len(part.points), 3 * len(names) + 1))
    place = {name: 3 * k for k, name in enumerate(names)}
    for group in part.groups:
        at = place[group.name]
        out[group.ids, at : at + 3] += group.moves
    out[:, -1] = part.jaw
    return out


def with_expressions(head: HeadData, pieces: Sequence[Piece], other: HeadData) -> HeadData:
    """The head with the groups, rules, jaw and neck of another head that has the same form.

    pieces : the surfaces that ``head.parts`` were made from, in the same order.
    """
    fields = skin_fields(other)
    fitted = [
        None if part.follows != "skin" else fit_fields(part, piece, fields)
        for part, piece in zip(head.parts, pieces, strict=True)
    ]
    kept = _shown(fields, [f for f in fitted if f is not None])
    parts = [
        part if found is None else _moved(part, found.values, fields.names, kept)
        for part, found in zip(head.parts, fitted, strict=True)
    ]
    there = {g.name for p in parts for g in p.groups}
    rules = [r for r in other.rules if r.group in there]
    return replace(head, parts=parts, rules=rules, jaw=other.jaw, neck=other.neck)


@dataclass(frozen=True)
class FittedFields:
    """A least-squares fit of fields.

    values : (n, c) of the control points. whole : (c,) sum of squares of the field over the samples.
    residual : (c,) sum of squares of what the fit does not reproduce.
    """

    values: Floats
    whole: Floats
    residual: Floats


def fit_fields(part: PartData, piece: Piece, fields: Fields) -> FittedFields:
    """The least-squares fit of fields by a part's control points, at samples of the surface it was made from."""
    mesh, surface = replace(piece, chord=piece.chord / FINER_FACTOR).mesh, make_surface(part)
    sign = -1.0 if part.flip else 1.0
    points, su, sv = surface.derivatives(mesh.uv, side=mesh.side)
    normals = np.cross(su, sv)
    normals *= sign / np.maximum(np.linalg.norm(normals, axis=1), 1e-30)[:, None]
    wanted = fields.at(points, normals)
    basis = surface.basis_matrix(mesh.uv, side=mesh.side)
    if piece.ties is None:
        return solve_fields(basis, _areas(points, mesh.triangles), wanted)
    ties = piece.ties
    shares = csr_matrix((ties.share, (ties.row, ties.column)), shape=(ties.count, len(ties.points)))
    found = solve_fields(basis @ shares, _areas(points, mesh.triangles), wanted)
    return replace(found, values=shares @ found.values)


def _areas(points: Floats, triangles: np.ndarray) -> Floats:
    """(m,) a third of the area around each vertex, relative to the mean; none is less than a hundredth of that."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    own = np.bincount(triangles.ravel(), np.repeat(area, 3), len(points))
    return np.maximum(own / max(float(own.mean()), 1e-300), 0.01)


def solve_fields(basis: csr_matrix, weight: Floats, wanted: Floats) -> FittedFields:
    """Values (n, c) with least sum of weight (basis values - wanted)^2, each pulled a little to its subdomain's mean.

    basis : (m, n) sparse. weight : (m,). wanted : (m, c).
    """
    weighted = diags(weight) @ basis
    reach = np.asarray(weighted.sum(axis=0)).ravel()
    mean = (weighted.T @ wanted) / np.maximum(reach, 1e-12)[:, None]
    pull = MEAN_WEIGHT * reach + 1e-9 * max(float(reach.max()), 1e-12)
    normal = (basis.T @ weighted + diags(pull)).tocsc()
    values = splu(normal).solve(weighted.T @ wanted + pull[:, None] * mean)
    residual = (weight[:, None] * (basis @ values - wanted) ** 2).sum(axis=0)
    return FittedFields(values, (weight[:, None] * wanted**2).sum(axis=0), residual)


def _shown(fields: Fields, fitted: Sequence[FittedFields]) -> set[str]:
    """Names of the groups to keep: all shapes, and those other groups that the surfaces reproduce well enough."""
    whole, residual = (sum(getattr(f, key) for f in fitted) for key in ("whole", "residual"))
    by_group = np.stack([np.asarray(rows)[:-1].reshape(-1, 3).sum(axis=1) for rows in (whole, residual)])
    shown = by_group[1] < (1.0 - MIN_SHOWN) * by_group[0]
    return {name for name, good in zip(fields.names, shown, strict=True) if good or name in SHAPES}


def _moved(part: PartData, values: Floats, names: tuple[str, ...], kept: set[str]) -> PartData:
    """The part with the fitted groups ``kept`` and its share of the jaw's rotation."""
    groups = list(part.groups)
    for k, name in enumerate(names):
        moves = values[:, 3 * k : 3 * k + 3]
        length = np.linalg.norm(moves, axis=1)
        if name in kept and length.max() > MIN_GROUP_MM:
            groups.append(sparse_group(name, np.where(length[:, None] > MIN_MM, np.round(moves, 4), 0.0)))
    return replace(part, groups=groups, jaw=np.clip(np.round(values[:, -1], 6), 0.0, 1.0))
