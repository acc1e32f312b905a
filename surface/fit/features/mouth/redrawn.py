"""Redraw the parts of a fitted head's mouth that its recipe says: the mesh was not made to be looked into."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from surface.base.arrays import Floats
from surface.fit.features.mouth.gum_lines import LOWER_INNER, UPPER_OUTER, laid_to_necks
from surface.fit.features.mouth.tongue_form import rounded_tongue
from surface.fit.features.rigging import tongue_groups
from surface.fit.features.tooth_rows import tooth_samples
from surface.fit.points.recipe import Recipe
from surface.head.model.data import HeadData, PartData
from surface.head.model.meshes import domain_of, make_surface

ALONG, ACROSS = 600, 60  # samples of gums, along u and v of the rectangle around all their patches


def redrawn_mouth(head: HeadData, recipe: Recipe) -> HeadData:
    """The head with the parts redrawn that the recipe names: a tongue is rounded, gums are laid up to the teeth that
    follow the same bone. Their triangles stay those of before in (u, v); stored meshes hold no positions."""
    wanted = {part.name for part in recipe.parts if part.redrawn}
    return replace(head, parts=[_redrawn(p, head, recipe) if p.name in wanted else p for p in head.parts])


def _redrawn(part: PartData, head: HeadData, recipe: Recipe) -> PartData:
    if part.material == "tongue":
        return _with_round_tongue(part, head, recipe)
    rows = [p for p in head.parts if p.material == "teeth" and p.follows == part.follows]
    teeth = [crown for row in rows for crown in tooth_samples(make_surface(row), row.loops)]
    if not teeth:
        return part
    side = LOWER_INNER if part.follows == "jaw" else UPPER_OUTER
    seams = [(s.uv_a, s.uv_b) for s in head.seams if s.part_a == s.part_b == part.name]
    return replace(part, points=laid_to_necks(part.points, make_surface(part), _places(part), teeth, side, seams))


def _with_round_tongue(part: PartData, head: HeadData, recipe: Recipe) -> PartData:
    """Shapes that take a tongue from place to place depend on its form at rest; others do not."""
    points = rounded_tongue(part.points, make_surface(part), domain_of(part).rect)
    made = {g.name: g for g in tongue_groups(points, np.array(recipe.tongue), head.jaw)} if recipe.tongue else {}
    return replace(part, points=points, groups=[made.get(g.name, g) for g in part.groups])


def _places(part: PartData) -> Floats:
    """Places (m, 2) all over a part, in (u, v)."""
    domain = domain_of(part)
    u0, u1, v0, v1 = domain.rect
    grid = np.stack(np.meshgrid(np.linspace(u0, u1, ALONG), np.linspace(v0, v1, ACROSS)), axis=-1).reshape(-1, 2)
    return np.asarray(grid[domain.inside(grid)])
