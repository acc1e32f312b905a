"""Fit control points to skin on a scan, and split those that are too far apart for its detail, a few times over."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import csr_matrix, identity

from surface.base.arrays import Floats, Ints
from surface.dcp import DCPSurface
from surface.fit.points.solve import normal_equations
from surface.fit.transfer.detail.finer_mesh import FineMesh
from surface.fit.transfer.detail.split_points import how_many, split_points
from surface.head import Jaw, PartData
from surface.head.model.meshes import make_surface

FAIR = 1e-4  # weight of fairness
ROUNDS = 3  # of splitting points
GROWTH = 1.8  # most points of a part, relative to those it had
SHARE = 0.6  # of the points that are left to be added, how many a round adds
ENOUGH_MM = 0.25  # RMS error around a control point up to which it is not split
LEAST_GAIN_MM = 0.15  # by which splitting a control point lowers the RMS error around it, or it is not split
CLOSEST_MM = 3.0  # least distance of the knots of a point that is split: finer ones would follow a scanner's noise
MIN_SHARE = 0.04  # of a place, that a control point has to be counted there


@dataclass(frozen=True)
class FittedPart:
    """A part with as many control points as its form needs, their places ``points (k, 3)`` in the new form, and the
    skin's places ``at (n, 3)``. The part itself has the form and the expressions that it had."""

    part: PartData
    surface: DCPSurface
    points: Floats
    at: Floats


@dataclass(frozen=True)
class _Solved:
    """A part with its surface, the places (k, 3) of its control points on the scan, its ``basis (n, k)`` at the samples
    there, and the errors (n,) that are left, mm²."""

    part: PartData
    surface: DCPSurface
    points: Floats
    basis: csr_matrix
    error: Floats


def fit_points(part: PartData, mesh: FineMesh, at: Floats, counts: Floats, jaw: Jaw, weight: Floats) -> FittedPart:
    """Fit a part's surface to skin ``at (n, 3)`` over a mesh, with more control points where it needs them.

    counts : (n,) 0..1, how much an error matters for where points are split. jaw : the path of the jaw, for its
        expressions. weight : (n,) of every place in the least squares.
    """
    most = int(GROWTH * len(part.points))
    now = _solved(part, mesh, at, counts, weight)
    for left in range(ROUNDS, 0, -1):
        chosen = too_far_apart(now.part, now.basis, now.error, now.points)
        room = most - len(now.part.points)
        chosen = chosen[: how_many(now.part, chosen, room if left == 1 else int(SHARE * room))]
        if not len(chosen):
            break
        finer = _solved(split_points(now.part, chosen, jaw), mesh, at, counts, weight)
        useful = chosen[gains(now.basis[:, chosen], now.error, finer.error) > LEAST_GAIN_MM]
        if not len(useful):
            break
        if len(useful) < len(chosen):
            finer = _solved(split_points(now.part, useful, jaw), mesh, at, counts, weight)
        now = finer
    return FittedPart(now.part, now.surface, now.points, now.basis @ now.points)


def _solved(part: PartData, mesh: FineMesh, at: Floats, counts: Floats, weight: Floats) -> _Solved:
    """The part's surface fitted to skin ``at (n, 3)``."""
    surface = make_surface(part)
    basis = surface.basis_matrix(mesh.uv, side=mesh.side)
    points = surface.points + solve_moves(surface, basis, at - basis @ surface.points, weight)
    return _Solved(part, surface, points, basis, np.sqrt(weight) * counts * ((basis @ points - at) ** 2).sum(axis=1))


def gains(shares: csr_matrix, before: Floats, after: Floats) -> Floats:
    """(k,) by how much errors (n,), mm², sank around each of k control points, of which the samples have ``shares (n,
    k)``: the difference of the RMS, mm."""
    weight = np.maximum(np.asarray(shares.sum(axis=0)).ravel(), 1e-12)
    first, last = (np.sqrt(np.maximum(shares.T @ e, 0.0) / weight) for e in (before, after))
    gain: Floats = first - last
    return gain


def solve_moves(surface: DCPSurface, basis: csr_matrix, moves: Floats, weight: Floats) -> Floats:
    """(k, 3) moves of control points that move the surface by ``moves (n, 3)`` at the samples of ``basis (n, k)``.

    As :func:`surface.fit.points.solve.solve`, for control points that have weights.
    """
    n = surface.n
    normal, right = normal_equations(basis, weight, moves)
    fair = (identity(n) - surface.basis_matrix(centres(surface))).tocsr()
    strength = len(moves) / n
    normal += (FAIR * strength * (fair.T @ fair)).toarray()
    normal[np.diag_indices(n)] += 1e-7 * strength
    solved: Floats = cho_solve(cho_factor(normal, check_finite=False), right, check_finite=False)
    return solved


def centres(surface: DCPSurface) -> Floats:
    """(k, 2) the middle of each control point's knots, inside its support also beside a slit."""
    middles: Floats = np.column_stack([knots[:, 1:4].mean(axis=1) for knots in surface.padded])
    return middles


def too_far_apart(part: PartData, basis: csr_matrix, error: Floats, points: Floats) -> Ints:
    """Control points that may be split, those with the greatest errors first.

    At every sample these are the finest ones that have a share of it. error : (n,) mm² at the samples of ``basis``.
    """
    span, n = _spans_mm(part, points), len(points)
    shares = basis.tocsr()
    kept = shares.data > MIN_SHARE
    row = np.repeat(np.arange(shares.shape[0]), np.diff(shares.indptr))[kept]
    column, share = shares.indices[kept], shares.data[kept]
    finest = np.full(shares.shape[0], np.inf)
    np.minimum.at(finest, row, span[column])
    own = span[column] < 1.5 * finest[row]
    weight = np.bincount(column[own], share[own], n)
    rms = np.sqrt(np.bincount(column[own], (share * error[row])[own], n) / np.maximum(weight, 1e-12))
    able = (rms > ENOUGH_MM) & (span > CLOSEST_MM) & (part.lids == 0.0) & bool((part.degrees == 3).all())
    order = np.argsort(-np.where(able, rms, 0.0), kind="stable")
    ids: Ints = order[: int(able.sum())]
    return ids


def _spans_mm(part: PartData, points: Floats) -> Floats:
    """(k,) mean distance of neighbouring knots of each control point, the geometric mean of both directions, mm."""
    surface = make_surface(replace(part, points=points))
    _, along_u, along_v = surface.derivatives(centres(surface))
    u, v = (
        np.linalg.norm(along, axis=1) * (knots[:, 4] - knots[:, 0]) / 4.0
        for along, knots in zip((along_u, along_v), surface.padded, strict=True)
    )
    span: Floats = np.sqrt(u * v)
    return span
