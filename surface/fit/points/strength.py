"""Make shapes of a mesh stronger before it is fitted, whole ones by a factor and places of the face by a pull, and
smooth them where they crumple.

Captured and modelled shapes often stay below what a face does; ``benchmarks/action_units.py`` compares them. Where skin
is pushed together they crumple into lumps, which glint and look like scars.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from surface.base.arrays import Floats, Ints
from surface.fit.source.mesh import FitMesh
from surface.head.model.parameters import smoothstep

FRONT_MM = (60.0, 90.0)  # z: what lies further back than the first is not changed, what lies before the second is
INSIDE, OUTSIDE = 0.7, 1.6  # of an ellipse: what it smooths wholly, and from where on nothing
ACROSS_MM = -6.0  # x on the other side of the face up to which a pull on one side is felt


@dataclass(frozen=True)
class Pull:
    """A pull on the skin of the left side: at centre (x, y), mm, it moves by ``move`` (3,), mm, and around it by a
    share that falls off as a normal distribution with the standard deviations ``reach`` (x, y), mm."""

    centre: tuple[float, float]
    reach: tuple[float, float]
    move: tuple[float, float, float]

    def at(self, points: Floats, side: float) -> Floats:
        """(n, 3) what it does to points (n, 3) on the left, ``side`` 1, or mirrored on the right, -1."""
        x, y, z = (points * [side, 1.0, 1.0]).T
        away = ((x - self.centre[0]) / self.reach[0]) ** 2 + ((y - self.centre[1]) / self.reach[1]) ** 2
        share = np.exp(-0.5 * away) * smoothstep(z, *FRONT_MM) * smoothstep(x, ACROSS_MM, self.centre[0])
        moved: Floats = share[:, None] * np.array(self.move) * [side, 1.0, 1.0]
        return moved


@dataclass(frozen=True)
class Smoothing:
    """On the left, around centre (x, y), mm, each point moves as the mean of its neighbours, which count by a normal
    distribution of the standard deviation ``width``, mm: wholly inside of ``INSIDE`` of the ellipse with the half axes
    ``reach`` (x, y), mm, not at all from ``OUTSIDE`` of it."""

    centre: tuple[float, float]
    reach: tuple[float, float]
    width: float

    def smooth(self, deltas: Floats, points: Floats, side: float) -> Floats:
        """(n, 3) displacements, mm, made smooth from those of points (n, 3) on the left, ``side`` 1, or right, -1."""
        x, y, z = (points * [side, 1.0, 1.0]).T
        away = np.hypot((x - self.centre[0]) / self.reach[0], (y - self.centre[1]) / self.reach[1])
        share = smoothstep(-away, -OUTSIDE, -INSIDE) * smoothstep(z, *FRONT_MM)
        within = np.flatnonzero(share)
        mean = _means(deltas, points, within, self.width)
        out = deltas.copy()
        out[within] += share[within, None] * (mean - deltas[within])
        return out


def _means(deltas: Floats, points: Floats, within: Ints, width: float) -> Floats:
    """(k, 3) means of the displacements (n, 3) around the points (n, 3) with the indices ``within`` (k,), mm."""
    near = cKDTree(points[within]).sparse_distance_matrix(cKDTree(points), 3.0 * width, output_type="coo_matrix")
    counts = np.exp(-0.5 * (near.data / width) ** 2)
    weights = csr_matrix((counts, (near.row, near.col)), (len(within), len(points)))
    means: Floats = (weights @ deltas) / np.asarray(weights.sum(axis=1))
    return means


@dataclass(frozen=True)
class Strength:
    """What is done to the shapes whose names begin with ``shape``: a factor, then pulls on their side, or on both sides
    where the name has none, then smoothing there."""

    shape: str
    scale: float = 1.0
    pulls: tuple[Pull, ...] = ()
    smoothed: tuple[Smoothing, ...] = ()

    @classmethod
    def of(cls, table: dict[str, object]) -> Strength:
        """From a table of a recipe."""
        pulls = tuple(Pull(**pull) for pull in table.get("pulls", ()))  # type: ignore
        smoothed = tuple(Smoothing(**place) for place in table.get("smoothed", ()))  # type: ignore
        return cls(**table | {"pulls": pulls, "smoothed": smoothed})  # type: ignore


def strengthen(mesh: FitMesh, wanted: Iterable[Strength]) -> FitMesh:
    """The mesh with stronger, smoother shapes; those that nothing names stay."""
    deltas = mesh.deltas.copy()
    for strength in wanted:
        for k in (k for k, name in enumerate(mesh.names) if name.startswith(strength.shape)):
            deltas[k] *= strength.scale
            for side in _sides(mesh.names[k]):
                deltas[k] += sum((pull.at(mesh.vertices, side) for pull in strength.pulls), np.zeros(3))
                for smoothing in strength.smoothed:
                    deltas[k] = smoothing.smooth(deltas[k], mesh.vertices, side)
    return replace(mesh, deltas=deltas)


def _sides(name: str) -> tuple[float, ...]:
    if name.endswith(("_L", "Left")):
        return (1.0,)
    return (-1.0,) if name.endswith(("_R", "Right")) else (1.0, -1.0)
