"""The drift of a deformation: how far many updates take it from a new evaluation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats
from surface.dcp import DCPSurface
from surface.deform.deformation import Deformation
from surface.mesh.mesh import Mesh
from surface.mesh.tessellate import unit_normals

from .bench import Report, no_report

ROUND = 2_000  # updates between two changes of weights and of knots
GROUP = 12  # points of a group
SHARE = 0.02  # of the updates move a group


@dataclass(frozen=True)
class Drift:
    """How many updates of each kind were made, and the errors they led to.

    ``error`` is the greatest distance of a vertex from a new evaluation, as a part of the size of the control net,
    ``normal_error`` the greatest difference of a normal from the exact one.
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
    """Make random updates of every kind, one after the other, and compare with a new evaluation.

    ``updates`` counts calls of ``move``, ``set_weights`` and ``set_knots`` together; ``report`` gets how many are done.
    """
    rng, deformation = np.random.default_rng(seed), surface.deformation(mesh)
    size = float(np.linalg.norm(np.ptp(surface.points, axis=0)))
    moves = groups = changes = 0
    for done in range(0, updates, ROUND):
        report(f"{done} updates")
        left = min(ROUND, updates - done)
        _change_shape(deformation, rng)
        grouped = max(0, int(SHARE * left) - 1)
        single = max(0, left - grouped - 2)
        for count, points in ((single, 1), (grouped, GROUP)):
            ids = (rng.integers(0, surface.n, (count, 1)) + np.arange(points)) % surface.n
            for which, steps in zip(ids, rng.normal(0, 1e-4 * size, (count, points, 3)), strict=True):
                deformation.move(which, steps)
        moves, groups, changes = moves + single, groups + grouped, changes + 1
    error, normal_error = _errors(deformation, size)
    return Drift(moves, groups, changes, changes, error, normal_error)


def _change_shape(deformation: Deformation[DCPSurface], rng: np.random.Generator) -> None:
    """Change one weight, and the knots of one point by a little."""
    basis = deformation.basis
    deformation.set_weights(rng.integers(0, basis.n, 1), rng.uniform(0.5, 2.0, 1))
    i = int(rng.integers(basis.n))
    knots = [k[i, : p[i] + 2] for k, p in zip(basis.knots, basis.degrees, strict=True)]
    deformation.set_knots(i, *(_jittered(k, rng) for k in knots))


def _jittered(knots: Floats, rng: np.random.Generator) -> Floats:
    """Knots with the inner ones moved a little, so that what was covered stays covered."""
    inner = (knots > knots[0]) & (knots < knots[-1])
    return np.sort(np.where(inner, 0.9 * knots + 0.1 * rng.uniform(knots[0], knots[-1], len(knots)), knots))


def _errors(deformation: Deformation[DCPSurface], size: float) -> tuple[float, float]:
    """Greatest distances of vertices, as a part of ``size``, and of normals from those of a new surface."""
    mesh, surface = deformation.mesh, deformation.surface
    points, su, sv = surface.derivatives(mesh.uv, mesh.side)
    normals = unit_normals(points, su, sv, mesh.triangles) * (-1 if mesh.flip else 1)
    off, turned = (deformation.vertices - points) / size, deformation.normals - normals
    return float(np.linalg.norm(off, axis=1).max()), float(np.linalg.norm(turned, axis=1).max())
