"""Benchmark of drift: the rounding errors that accumulate over many updates of a deformation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats
from surface.dcp import DCPSurface
from surface.deform.deformation import Deformation
from surface.mesh.mesh import Mesh
from surface.mesh.tessellate import unit_normals

from .bench import Report, no_report

ROUND_UPDATES = 2_000  # one of them changes a weight, and one the knots of a point
GROUP_POINTS = 12
GROUP_FRACTION = 0.02  # of the updates move a group instead of one point


@dataclass(frozen=True)
class Drift:
    """How many updates of each kind were made, and the errors that resulted.

    moves, groups : updates that moved one point and a group. weights, knots : changes of one of these.
    error : maximum distance of a vertex from a new evaluation, as a fraction of the control points' diagonal.
    normal_error : maximum length of the difference between a normal and the exact one.
    """

    moves: int
    groups: int
    weights: int
    knots: int
    error: float
    normal_error: float


def drift(
    surface: DCPSurface, mesh: Mesh, updates: int = 1_000_000, *, seed: int = 0, report: Report = no_report
) -> Drift:
    """Make random updates of every kind and compare the result with a new evaluation.

    ``updates`` counts calls of ``move``, ``set_weights`` and ``set_knots`` together; ``report`` gets how many are done.
    """
    rng, deformation = np.random.default_rng(seed), surface.deformation(mesh)
    size = float(np.linalg.norm(np.ptp(surface.points, axis=0)))
    moves = groups = changes = 0
    for done in range(0, updates, ROUND_UPDATES):
        report(f"{done} updates")
        left = min(ROUND_UPDATES, updates - done)
        _change_basis(deformation, rng)
        grouped = max(0, int(GROUP_FRACTION * left) - 1)
        single = max(0, left - grouped - 2)
        for count, points in ((single, 1), (grouped, GROUP_POINTS)):
            ids = (rng.integers(0, surface.n, (count, 1)) + np.arange(points)) % surface.n
            for which, steps in zip(ids, rng.normal(0, 1e-4 * size, (count, points, 3)), strict=True):
                deformation.move(which, steps)
        moves, groups, changes = moves + single, groups + grouped, changes + 1
    error, normal_error = _max_errors(deformation, size)
    return Drift(moves, groups, changes, changes, error, normal_error)


def _change_basis(deformation: Deformation[DCPSurface], rng: np.random.Generator) -> None:
    """Change the weight of one random point, and slightly the knots of another."""
    basis = deformation.basis
    deformation.set_weights(rng.integers(0, basis.n, 1), rng.uniform(0.5, 2.0, 1))
    i = int(rng.integers(basis.n))
    knots = [k[i, : p[i] + 2] for k, p in zip(basis.knots, basis.degrees, strict=True)]
    deformation.set_knots(i, *(_jitter_knots(k, rng) for k in knots))


def _jitter_knots(knots: Floats, rng: np.random.Generator) -> Floats:
    """Return knots with the inner ones moved slightly; the outer ones stay, so that the same area is covered."""
    inner = (knots > knots[0]) & (knots < knots[-1])
    return np.sort(np.where(inner, 0.9 * knots + 0.1 * rng.uniform(knots[0], knots[-1], len(knots)), knots))


def _max_errors(deformation: Deformation[DCPSurface], size: float) -> tuple[float, float]:
    """Return the maximum distance of vertices, as a fraction of ``size``, and of normals from a new evaluation."""
    mesh, surface = deformation.mesh, deformation.surface
    points, su, sv = surface.derivatives(mesh.uv, mesh.side)
    normals = unit_normals(points, su, sv, mesh.triangles) * (-1 if mesh.flip else 1)
    offsets, differences = (deformation.vertices - points) / size, deformation.normals - normals
    return float(np.linalg.norm(offsets, axis=1).max()), float(np.linalg.norm(differences, axis=1).max())
