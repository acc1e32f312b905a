"""How far many updates take a deformation from a fresh evaluation."""

# mypy: allow-untyped-defs
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats
from surface.base.jit import kernel
from surface.dcp import DCPSurface
from surface.deform.binding import place_bound
from surface.deform.deformation import Deformation
from surface.deform.table import BIAS, GAP, LIMIT
from surface.mesh.mesh import Mesh
from surface.mesh.tessellate import unit_normals

from .bench import Tell

ROUND = 2_000  # updates between two changes of weights and of knots
GROUP = 12  # points of a group
SHARE = 0.02  # of the updates move a group


@dataclass(frozen=True)
class Drift:
    """What updates led to.

    Attributes
    ----------
    moves, groups, weights, knots : how many updates of each kind were made
    error : greatest distance of a vertex from a fresh evaluation, as a part of the size of the control net
    normal_error : greatest difference of a normal from the exact one
    """

    moves: int
    groups: int
    weights: int
    knots: int
    error: float
    normal_error: float


def drift(
    surface: DCPSurface, mesh: Mesh, updates: int = 1_000_000, *, seed: int = 0, tell: Tell = lambda text: None
) -> Drift:
    """Make random updates of every kind, one after the other, and compare with a fresh evaluation.

    Parameters
    ----------
    surface, mesh : what is updated
    updates : how many calls of ``move``, ``set_weights`` and ``set_knots`` together
    seed : of the random numbers
    tell : is told how many updates are done
    """
    rng, deformation = np.random.default_rng(seed), surface.deformation(mesh)
    size = float(np.linalg.norm(np.ptp(surface.points, axis=0)))
    count = {"moves": 0, "groups": 0, "weights": 0, "knots": 0}
    for done in range(0, updates, ROUND):
        tell(f"{done} updates")
        left = min(ROUND, updates - done)
        _reshape(deformation, rng, count)
        groups = max(0, int(SHARE * left) - 1)
        _move(deformation, rng, max(0, left - groups - 2), 1, 1e-4 * size)
        _move(deformation, rng, groups, GROUP, 1e-4 * size)
        count["moves"] += max(0, left - groups - 2)
        count["groups"] += groups
    error, normal_error = _errors(deformation, size)
    return Drift(**count, error=error, normal_error=normal_error)


def _reshape(deformation: Deformation[DCPSurface], rng: np.random.Generator, count: dict[str, int]) -> None:
    """Change one weight, and the knots of one point by a little."""
    basis = deformation.table.basis
    ids = rng.integers(0, basis.n, 1)
    deformation.set_weights(ids, rng.uniform(0.5, 2.0, 1))
    count["weights"] += 1
    i = int(rng.integers(basis.n))
    knots = [k[i, : p[i] + 2] for k, p in zip(basis.knots, basis.degrees, strict=True)]
    deformation.set_knots(i, *(_shaken(k, rng) for k in knots))
    count["knots"] += 1


def _shaken(knots: Floats, rng: np.random.Generator) -> Floats:
    """Knots with those between the ends moved a little, so that what was covered stays covered."""
    inner = (knots > knots[0]) & (knots < knots[-1])
    return np.sort(np.where(inner, 0.9 * knots + 0.1 * rng.uniform(knots[0], knots[-1], len(knots)), knots))


def _move(deformation: Deformation[DCPSurface], rng: np.random.Generator, count: int, size: int, length: float) -> None:
    """Make ``count`` calls of ``move`` with ``size`` points each, without Python between them."""
    if not count:
        return
    table, state = deformation.table, deformation.state
    n, blocks = table.basis.n, len(table.basis.shifts)
    first = rng.integers(0, n, count)
    ids = (first[:, None] + np.arange(size)) % n
    steps = rng.normal(0, length, (count, size, 3))
    ids = np.concatenate([ids + b * n for b in range(blocks)], axis=1)  # copies of a closed surface move along
    steps = np.ascontiguousarray(np.tile(steps, (1, blocks, 1)))
    table.address(state)
    _play(state.addresses, ids, steps, state.most, LIMIT, BIAS, GAP, table.sign)


@kernel
def _play(table, ids, steps, most, limit, bias, gap, sign):
    """One update after the other."""
    for k in range(ids.shape[0]):
        place_bound(table, ids[k], steps[k], True, most, limit, bias, gap, sign)


def _errors(deformation: Deformation[DCPSurface], size: float) -> tuple[float, float]:
    """Greatest distances of vertices, as a part of ``size``, and of normals from those of a new surface."""
    mesh, surface = deformation.mesh, deformation.surface
    points, su, sv = surface.derivatives(mesh.uv, mesh.side)
    normals = unit_normals(points, su, sv, mesh.triangles) * (-1 if mesh.flip else 1)
    off, turned = (deformation.vertices - points) / size, deformation.normals - normals
    return float(np.linalg.norm(off, axis=1).max()), float(np.linalg.norm(turned, axis=1).max())
