"""Make shapes of a mesh stronger before it is fitted: whole ones by a factor, and places of the face by a pull.

Captured and modelled shapes often stay below what a face does; ``benchmarks/action_units.py`` compares them.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from surface.base.arrays import Floats
from surface.fit.source.mesh import FitMesh
from surface.head.model.parameters import smoothstep

FRONT_MM = (60.0, 90.0)  # z: what lies further back than the first is not pulled, what lies before the second is
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
class Strength:
    """What is added to the shapes whose names begin with ``shape``: a factor, then pulls on their side, or on both
    sides where the name has none."""

    shape: str
    scale: float = 1.0
    pulls: tuple[Pull, ...] = ()

    @classmethod
    def of(cls, table: dict[str, object]) -> Strength:
        """From a table of a recipe."""
        return cls(**table | {"pulls": tuple(Pull(**pull) for pull in table.get("pulls", ()))})  # type: ignore


def strengthen(mesh: FitMesh, wanted: Iterable[Strength]) -> FitMesh:
    """The mesh with stronger shapes; those that nothing names stay."""
    deltas = mesh.deltas.copy()
    for strength in wanted:
        for k in (k for k, name in enumerate(mesh.names) if name.startswith(strength.shape)):
            deltas[k] *= strength.scale
            for side in _sides(mesh.names[k]):
                deltas[k] += sum((pull.at(mesh.vertices, side) for pull in strength.pulls), np.zeros(3))
    return replace(mesh, deltas=deltas)


def _sides(name: str) -> tuple[float, ...]:
    if name.endswith(("_L", "Left")):
        return (1.0,)
    return (-1.0,) if name.endswith(("_R", "Right")) else (1.0, -1.0)
