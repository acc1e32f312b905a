"""Where a surface may be calmer than the flat faces of its mesh, and what it is fitted to there.

A mesh is drawn as if it were smooth, with normals that are means of those of faces. A surface that follows the faces
themselves, each with its own slope, has ripples of their size. So wherever errors leave room for it, faces get the
slopes of the smooth surface that they stand for, the surface has to turn evenly from a face to its corners, and control
points are held to their neighbours more strongly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix

from surface.base.arrays import Bools, Floats
from surface.fit.points.net import Net
from surface.fit.points.solve import solve
from surface.fit.source.chart import Chart, Slopes
from surface.fit.source.mesh import FitMesh, triangles

CALMER = 10.0  # factor by which fairness and bending weigh more where the surface is calm
STEADIER = 2.0  # and slopes
MIN_HOLD = 0.1  # least weight of a control point at a sample that it is held by
CORNERS = 4  # of a face
CREASE_RAD = np.radians(30.0)  # between a border's own faces and all around it: from there on the mesh has a crease


@dataclass(frozen=True)
class SlopeTargets:
    """What slopes should be: ``u``, ``v`` (f, c) those of the faces, ``turn_u``, ``turn_v`` (4 f, c) how they turn to
    the corners."""

    slopes: Slopes
    u: Floats
    v: Floats
    turn_u: Floats
    turn_v: Floats

    def at(self, calm: Bools) -> tuple[tuple[Slopes, Floats, Floats], tuple[Floats, Floats]]:
        """Slopes and turns for :func:`surface.fit.points.solve.solve`: smooth ones at the faces that are ``calm (f,)``,
        those of flat faces at the others."""
        kept = np.repeat(calm, CORNERS)[:, None]
        mean_u, mean_v = (self._mean(turn) for turn in (self.turn_u, self.turn_v))
        u, v = (own + calm[:, None] * mean for own, mean in ((self.u, mean_u), (self.v, mean_v)))
        turns = tuple(
            0.5 * kept * (turn - self._used * np.repeat(mean, CORNERS, axis=0))
            for turn, mean in ((self.turn_u, mean_u), (self.turn_v, mean_v))
        )
        weight = self.slopes.weight * np.where(calm, STEADIER, 1.0)
        return (replace(self.slopes, weight=weight), u, v), (turns[0], turns[1])

    @property
    def _used(self) -> Floats:
        """(4 f, 1) 1 for corners, 0 for the fourth of a triangle."""
        apart = np.abs(self.slopes.corners - self.slopes.uv[:, None]).max(axis=2) > 0.0
        used: Floats = apart.reshape(-1, 1).astype(np.float64)
        return used

    def _mean(self, turn: Floats) -> Floats:
        """(f, c) mean over the corners of each face."""
        count = self._used.reshape(-1, CORNERS).sum(axis=1)
        mean: Floats = turn.reshape(len(count), CORNERS, -1).sum(axis=1) / np.maximum(count, 1.0)[:, None]
        return mean


@dataclass(frozen=True)
class Calm:
    """How a chart is fitted with a net, calm or not. ``fair (n,)``, ``bend`` : weights of fairness and bending where it
    is not."""

    mesh: FitMesh
    chart: Chart
    net: Net
    fair: Floats
    bend: float

    def solved(self, rows: csr_matrix, targets: Floats, strict: Bools) -> Floats:
        """Control point coordinates (n, c) for targets (m, c), calm but around samples that are ``strict (m,)``; rows
        (m, n) : weights of the control points at the samples."""
        slopes = self._wanted
        faces, points = calm_faces(self.chart, slopes.slopes, strict), calm_points(rows, strict)
        own, turns = slopes.at(faces)
        fair, bend = self.fair * np.where(points, CALMER, 1.0), self.bend * np.where(faces, CALMER, 1.0)
        return solve(self.net, rows, self.chart.weight, targets, fair, own, bend, turns)

    @cached_property
    def _wanted(self) -> SlopeTargets:
        slopes = self.chart.slopes
        if slopes is None:
            raise ValueError("a chart without slopes")
        mixes = (slopes.mix_u, slopes.mix_v, slopes.turn_u, slopes.turn_v)
        return level_at_rims(self.mesh, SlopeTargets(slopes, *(samples_of(self.mesh, mix) for mix in mixes)))


def level_at_rims(mesh: FitMesh, wanted: SlopeTargets) -> SlopeTargets:
    """The targets with which the surface at rest meets the rest of the mesh without a crease at the chart's border.

    A chart knows only its own faces, so that at its border the last one's slope would go on: where the mesh is smooth,
    the corner lies as the mean of all faces of the mesh around it. Creases of the mesh, as at lips, stay.
    """
    rim = np.flatnonzero(wanted.slopes.rim >= 0)
    if not len(rim):
        return wanted
    face, vertex = rim // CORNERS, wanted.slopes.rim[rim]
    own = [slope[face, :3] + turn[rim, :3] for slope, turn in ((wanted.u, wanted.turn_u), (wanted.v, wanted.turn_v))]
    flat, whole = _unit(np.cross(own[0], own[1])), _unit(point_normals(mesh)[vertex])
    whole *= np.sign((flat * whole).sum(axis=1))[:, None]
    smooth = (flat * whole).sum(axis=1) > np.cos(CREASE_RAD)
    turns = [wanted.turn_u.copy(), wanted.turn_v.copy()]
    for turn, slope in zip(turns, own, strict=True):
        turn[rim, :3] -= np.where(smooth, (slope * whole).sum(axis=1), 0.0)[:, None] * whole
    return replace(wanted, turn_u=turns[0], turn_v=turns[1])


def point_normals(mesh: FitMesh) -> Floats:
    """(n, 3) normals of a mesh at its vertices, those of the triangles around weighted by their angles there, however
    quads are split; not of length 1."""
    out = np.zeros_like(mesh.vertices)
    corner = triangles(mesh.faces)
    points = mesh.vertices[corner]
    sides = [_unit(np.roll(points, -k, axis=1)[:, j] - points[:, j]) for j in range(3) for k in (1, 2)]
    normal = _unit(np.cross(sides[0], sides[1]))
    for j in range(3):
        angle = np.arccos(np.clip((sides[2 * j] * sides[2 * j + 1]).sum(axis=1), -1.0, 1.0))
        np.add.at(out, corner[:, j], angle[:, None] * normal)
    return out


def _unit(rows: Floats) -> Floats:
    unit: Floats = rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-12)
    return unit


def samples_of(mesh: FitMesh, mix: csr_matrix) -> Floats:
    """(m, 3 (1 + k)): neutral and shape displacements of a mesh at rows of ``mix (m, n)``."""
    return np.hstack([mix @ mesh.vertices, *(mix @ d for d in mesh.deltas)])


def calm_faces(chart: Chart, slopes: Slopes, strict: Bools) -> Bools:
    """(f,) faces none of whose vertices belong to a sample that is ``strict (m,)``."""
    calm: Bools = np.asarray(_pattern(slopes.mix_u) @ _vertices(chart, strict)).ravel() == 0
    return calm


def calm_points(rows: csr_matrix, strict: Bools) -> Bools:
    """(n,) control points that hold none of the samples that are ``strict (m,)``; rows (m, n) : their weights there."""
    held = rows[np.flatnonzero(strict)].tocoo()
    out = np.ones(rows.shape[1], bool)
    out[held.col[held.data > MIN_HOLD]] = False
    return out


def beside(chart: Chart, samples: Bools) -> Bools:
    """(m,) samples that share a vertex of the mesh with any of ``samples (m,)``, themselves included."""
    near: Bools = np.asarray(_pattern(chart.mix) @ _vertices(chart, samples)).ravel() > 0
    return near


def _vertices(chart: Chart, samples: Bools) -> Floats:
    """(n,) 1 for the vertices of the mesh that samples are made of."""
    flag = np.zeros(chart.mix.shape[1])
    flag[_pattern(chart.mix[np.flatnonzero(samples)]).indices] = 1.0
    return flag


def _pattern(matrix: csr_matrix) -> csr_matrix:
    """1 where a matrix is not 0."""
    out = matrix.tocsr(copy=True)
    out.eliminate_zeros()
    out.data[:] = 1.0
    return out
