"""Recipes of known meshes: how each is taken apart into the parts of a head, from ``recipes/*.toml``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from surface.base import files
from surface.base.arrays import Ints
from surface.fit.points.lid_seating import Eyeball, fit_sphere
from surface.fit.points.refine import FitRequest
from surface.fit.points.strength import Strength
from surface.fit.source.load import Loaded
from surface.fit.source.mesh import FitMesh
from surface.fit.source.placing.place import CLOSE_MM, moved

RECIPES = Path(__file__).parent / "recipes"
Ranges = Sequence[Sequence[int]]
Tables = list[dict[str, Any]]


@dataclass(frozen=True)
class PartRecipe:
    """One part: its vertices as ranges, what it looks like, what it follows, how finely it is fitted.

    ``tiled`` : its islands are still to be put into tiles of their own; ``wrapped`` : one skin goes round all of them,
    and ``even`` : its samples are as dense at the rim of something flat as elsewhere;
    ``downweight_slivers`` : its faces may be of any form and size; see :func:`surface.fit.source.chart.make_chart`;
    ``raised`` : how far it is moved upwards after the fit, mm; ``redrawn`` : whether its form is redrawn then, see
    :mod:`surface.fit.features.mouth.redrawn`.
    """

    name: str
    material: str
    follows: str
    vertices: Ranges
    request: FitRequest
    budget: tuple[int, float, int]
    tiled: bool = False
    wrapped: bool = False
    even: bool = False
    downweight_slivers: bool = False
    raised: float = 0.0
    redrawn: bool = False

    def holds(self, vertex: float) -> bool:
        """Is the vertex in one of the ranges?"""
        return any(a <= vertex < b for a, b in self.vertices)


@dataclass(frozen=True)
class Recipe:
    """All that is known about a kind of mesh beforehand, as its file has it; every field may be empty."""

    parts: list[PartRecipe]
    teeth: list[PartRecipe] = field(default_factory=list)
    neck: Sequence[float] = ()
    hinge: Sequence[float] = (0.0, 0.0, 0.0)
    jaw_teeth: Sequence[int] = (0, 0)
    ball: Sequence[int] = ()
    ball_at: Sequence[float] = ()
    ball_inset: float = 0.0
    eye_shift: Sequence[float] = (0.0, 0.0, 0.0)
    eye_radius: float = 0.0
    seat: Ranges = ()
    lips_close: float = 0.0
    tongue: Sequence[Sequence[float]] = ()
    tongue_low: float = 0.0
    tongue_back: float = 0.0
    source: dict[str, str] = field(default_factory=dict)
    paint: Tables = field(default_factory=list)
    hair: dict[str, Any] = field(default_factory=dict)
    strengthened: Sequence[Strength] = ()
    wrinkles: Tables = field(default_factory=list)
    correctives: Tables = field(default_factory=list)

    @property
    def seated(self) -> Ints:
        """Vertices that are moved with the lids."""
        return np.concatenate([np.zeros(0, np.int64), *(np.arange(a, b) for a, b in self.seat)])

    def eyeballs(self, mesh: FitMesh) -> tuple[Eyeball, Eyeball] | None:
        """The left eyeball that the lids were modelled on, and the one they are moved onto; None for a head without."""
        if not self.ball:
            return None
        centre, radius = fit_sphere(mesh.vertices[slice(*self.ball)])
        x, y, z = (centre + np.array(self.eye_shift)).tolist()
        return Eyeball(tuple(centre.tolist()), radius - self.ball_inset), Eyeball((x, y, z), self.eye_radius)


def recipe_for(mesh: FitMesh) -> Recipe | None:
    """The recipe made for meshes of this size; None for an unknown mesh."""
    for path in sorted(RECIPES.glob("*.toml")):
        table = files.read_toml(path)
        if (table.pop("vertices"), table.pop("faces")) == (len(mesh.vertices), len(mesh.faces)):
            made = {key: [_part(t) for t in table[key]] for key in ("parts", "teeth")}
            return Recipe(**table | made | {"strengthened": [Strength.of(t) for t in table.get("strengthened", [])]})
    return None


def in_place(loaded: Loaded, recipe: Recipe) -> Loaded:
    """The mesh moved to where the recipe's own places, of neck and hinge, belong to it."""
    balls = recipe.eyeballs(loaded.mesh)
    if balls is None or not recipe.ball_at:
        return loaded
    shift = np.array(recipe.ball_at) - balls[0].centre
    return moved(loaded, shift) if np.abs(shift).max() > CLOSE_MM else loaded


def _part(table: dict[str, Any]) -> PartRecipe:
    """A part from its table, which holds the keys of its :class:`FitRequest`, too."""
    request = {f.name: table.pop(f.name) for f in fields(FitRequest) if f.name in table}
    table |= {"budget": tuple(table["budget"]), "follows": table.get("follows", "skin")}
    return PartRecipe(**table, request=FitRequest(**request))
