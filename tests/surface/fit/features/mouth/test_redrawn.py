"""Which parts of a mouth are redrawn, and what moves with them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from surface.base import files
from surface.fit.features.mouth.redrawn import redrawn_mouth
from surface.fit.features.rigging import DROOP
from surface.fit.points.recipe import RECIPES, Recipe, _part
from surface.head import load_data
from surface.head.model.data import HeadData
from surface.head.model.meshes import make_surface

HEAD = Path(__file__).parents[5] / "configs" / "heads" / "ict"


@pytest.fixture(scope="module")
def head() -> HeadData:
    return load_data(HEAD)


def recipe(*redrawn: str) -> Recipe:
    table = files.read_toml(RECIPES / "ict.toml")
    parts = [replace(_part(dict(t)), redrawn=t["name"] in redrawn) for t in table["parts"]]
    return Recipe(parts=parts, tongue=table["tongue"])


def moved(before: HeadData, after: HeadData) -> set[str]:
    pairs = zip(before.parts, after.parts, strict=True)
    return {a.name for a, b in pairs if not np.array_equal(a.points, b.points)}


def test_only_what_the_recipe_names_is_redrawn(head: HeadData) -> None:
    assert moved(head, redrawn_mouth(head, recipe())) == set()
    assert moved(head, redrawn_mouth(head, recipe("tongue"))) == {"tongue"}
    assert moved(head, redrawn_mouth(head, recipe("gums_lower"))) == {"gums_lower"}


def test_gums_without_teeth_on_their_bone_stay(head: HeadData) -> None:
    bare = replace(head, parts=[p for p in head.parts if p.name != "teeth_lower"])
    assert moved(bare, redrawn_mouth(bare, recipe("gums_lower"))) == set()


def test_a_tongue_comes_out_to_where_it_came_out_before(head: HeadData) -> None:
    after = redrawn_mouth(head, recipe("tongue"))
    old, new = (next(p for p in h.parts if p.name == "tongue") for h in (head, after))
    reach = []
    for part in (old, new):
        group = next(g for g in part.groups if g.name == "tongueOut")
        out = part.points.copy()
        out[group.ids] += group.moves
        reach.append(out[:, 2].max())
    assert reach[1] == pytest.approx(reach[0], abs=1.0)
    rest = [g.name for g in new.groups if g.name not in ("tongueOut", DROOP)]
    for name in rest:
        before, now = (next(g for g in p.groups if g.name == name) for p in (old, new))
        np.testing.assert_array_equal(before.moves, now.moves)


@pytest.mark.parametrize("name", ["gums_upper", "gums_lower"])
def test_borders_of_gums_still_meet(head: HeadData, name: str) -> None:
    after = redrawn_mouth(head, recipe(name))
    apart = []
    for one in (head, after):
        surface = make_surface(next(p for p in one.parts if p.name == name))
        own = [s for s in one.seams if s.part_a == s.part_b == name]
        apart.append(max(np.abs(surface.evaluate(s.uv_a) - surface.evaluate(s.uv_b)).max() for s in own))
    assert apart[1] < max(apart[0], 0.5) + 0.1
