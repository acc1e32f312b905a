"""How a mesh is taken apart into the parts of a head."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from surface.base.arrays import Ints
from surface.fit.points.lid_seating import Eyeball, fit_sphere
from surface.fit.points.refine import FitRequest
from surface.fit.source.mesh import FitMesh

RECIPES = Path(__file__).parent / "recipes"


@dataclass(frozen=True)
class PartRecipe:
    """One part: its vertices as ranges, what it looks like, what it follows, how finely it is fitted.

    ``tiled`` : its islands are still to be laid into tiles of their own; ``wrapped`` : one skin goes round all of them;
    ``doubt_slivers`` : nothing is known of its faces' forms.
    """

    name: str
    material: str
    follows: str
    vertices: list[tuple[int, int]]
    request: FitRequest
    budget: tuple[int, float, int]
    tiled: bool = False
    wrapped: bool = False
    doubt_slivers: bool = False

    def holds(self, vertex: float) -> bool:
        """Is the vertex in one of the ranges?"""
        return any(a <= vertex < b for a, b in self.vertices)


@dataclass(frozen=True)
class Recipe:
    """All that is known about a kind of mesh beforehand; every field may be empty."""

    parts: list[PartRecipe]
    teeth: list[PartRecipe] = field(default_factory=list)
    neck: tuple[float, float, float] | None = None
    hinge: tuple[float, float, float] | None = None
    jaw_teeth: tuple[int, int] = (0, 0)
    ball: tuple[int, int] | None = None
    ball_inset: float = 0.0
    eye_shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    eye_radius: float = 0.0
    seat: list[tuple[int, int]] = field(default_factory=list)
    lips_close: float = 0.0
    blink: float = 1.0
    tongue: list[list[float]] = field(default_factory=list)
    source: dict[str, str] = field(default_factory=dict)
    paint: list[dict[str, Any]] = field(default_factory=list)
    hair: dict[str, Any] = field(default_factory=dict)
    frown: dict[str, Any] = field(default_factory=dict)
    wrinkles: list[dict[str, Any]] = field(default_factory=list)
    correctives: list[dict[str, Any]] = field(default_factory=list)

    @property
    def seated(self) -> Ints:
        """Vertices that are moved with the lids."""
        return np.concatenate([np.arange(a, b) for a, b in self.seat]) if self.seat else np.zeros(0, np.int64)

    def eyeballs(self, mesh: FitMesh) -> tuple[Eyeball, Eyeball] | None:
        """The left eyeball that the lids were made on, and the one they shall lie on; None for a head without."""
        if self.ball is None:
            return None
        centre, radius = fit_sphere(mesh.vertices[slice(*self.ball)])
        x, y, z = (centre + np.array(self.eye_shift)).tolist()
        return Eyeball(tuple(centre.tolist()), radius - self.ball_inset), Eyeball((x, y, z), self.eye_radius)


def recipe_for(mesh: FitMesh) -> Recipe | None:
    """The recipe made for meshes of this size; None for an unknown mesh."""
    for path in sorted(RECIPES.glob("*.toml")):
        table = tomllib.loads(path.read_text(encoding="utf-8"))
        if (table.get("vertices"), table.get("faces")) == (len(mesh.vertices), len(mesh.faces)):
            return _read(table)
    return None


def _read(table: dict[str, Any]) -> Recipe:
    eyes, pivots = table["eyes"], table["pivots"]
    return Recipe(
        parts=[_part(t) for t in table["parts"]],
        teeth=[_part({"material": "teeth", **t, "vertices": [t["vertices"]]}) for t in table["teeth"]],
        neck=tuple(pivots["neck"]),
        hinge=tuple(pivots["hinge"]),
        jaw_teeth=tuple(pivots["jaw_teeth"]),
        ball=tuple(eyes["ball"]),
        ball_inset=eyes["inset"],
        eye_shift=tuple(eyes["shift"]),
        eye_radius=eyes["radius"],
        seat=[tuple(r) for r in eyes["seat"]],
        lips_close=table["lips"]["close"],
        blink=table["eyes"]["blink"],
        tongue=table["tongue"]["path"],
        source=table["source"],
        paint=table["paint"],
        hair=table["hair"],
        frown=table["frown"],
        wrinkles=table["wrinkles"],
        correctives=table["correctives"],
    )


def _part(t: dict[str, Any]) -> PartRecipe:
    request = {k: t[k] for k in ("points", "coarse", "neutral_mm", "shape_mm", "fair", "deepest") if k in t}
    return PartRecipe(
        t["name"], t["material"], t.get("follows", "skin"), [tuple(r) for r in t["vertices"]],
        FitRequest(**request), tuple(t["budget"]), wrapped=t.get("wrapped", False),
    )  # fmt: skip
