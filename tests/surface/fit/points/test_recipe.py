"""Recipes know the meshes they were made for."""

from dataclasses import replace

import numpy as np
import pytest
from slit_sheet import slit_sheet

from surface.fit.points import recipe
from surface.fit.points.recipe import recipe_for
from surface.fit.source.load import Loaded
from surface.fit.source.mesh import FitMesh
from surface.fit.source.names import map_names


def test_an_unknown_mesh_has_none():
    assert recipe_for(slit_sheet()) is None


def test_ict_is_taken_apart():
    sizes = FitMesh(np.zeros((26719, 3)), np.zeros((26384, 4), int), np.zeros((1, 2)), np.zeros((26384, 4), int), (),
                    np.zeros((0, 26719, 3)))  # fmt: skip
    recipe = recipe_for(sizes)
    names = [p.name for p in recipe.parts + recipe.teeth]
    assert names == ["face", "back", "cavity", "sockets", "gums_upper", "gums_lower", "tongue", "teeth_upper",
                     "teeth_lower"]  # fmt: skip
    assert {p.name for p in recipe.parts if p.redrawn} == {"gums_upper", "gums_lower", "tongue"}
    assert recipe.parts[0].request.points <= 2500
    assert recipe.parts[0].holds(4704) and not recipe.parts[0].holds(9409)
    assert recipe_for(replace(sizes, faces=sizes.faces[1:])) is None


def test_eyes_stand_where_the_mesh_has_its_eyeballs():
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(577, 3))
    ball = np.array([33.0, 40, 78]) + 15.5 * directions / np.linalg.norm(directions, axis=1)[:, None]
    vertices = np.zeros((26719, 3))
    vertices[21451:22028] = ball
    faces = np.zeros((26384, 4), int)
    mesh = FitMesh(vertices, faces, np.zeros((1, 2)), faces, (), np.zeros((0, 26719, 3)))
    recipe = recipe_for(mesh)
    old, new = recipe.eyeballs(mesh)
    np.testing.assert_allclose(old.centre, [33, 40, 78], atol=1e-6)
    assert abs(old.radius - (15.5 - recipe.ball_inset)) < 1e-6 and new.radius == recipe.eye_radius
    np.testing.assert_allclose(np.subtract(new.centre, old.centre), recipe.eye_shift, atol=1e-6)


def test_parts_hold_half_open_ranges_and_follow_the_skin_unless_said():
    table = {"name": "a", "material": "skin", "vertices": [[2, 4], [9, 10]], "budget": [1, 0.5, 3], "points": 77}
    made = recipe._part(table | {"tiled": True})
    assert [made.holds(k) for k in (1, 2, 3, 4, 8, 9, 10)] == [False, True, True, False, False, True, False]
    assert made.follows == "skin" and made.budget == (1, 0.5, 3) and made.request.points == 77
    assert (made.tiled, made.wrapped, made.downweight_slivers) == (True, False, False)
    assert recipe._part(table | {"follows": "jaw", "points": 1}).follows == "jaw"


def test_ranges_of_what_moves_with_the_lids_are_joined():
    assert recipe.Recipe([], seat=[[3, 5], [0, 2]]).seated.tolist() == [3, 4, 0, 1]
    assert recipe.Recipe([]).seated.tolist() == []


@pytest.mark.parametrize(("off", "moves"), [(0.04, False), (0.06, True), (-0.06, True)])
def test_a_mesh_is_moved_to_where_the_recipe_has_its_eyeball(off, moves):
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(200, 3))
    ball = np.array([30.0, 40.0, 70.0]) + 12.0 * directions / np.linalg.norm(directions, axis=1)[:, None]
    none = np.zeros((0, 4), int)
    vertices = np.vstack([np.zeros((5, 3)), ball])
    loaded = Loaded(FitMesh(vertices, none, np.zeros((1, 2)), none, (), np.zeros((0, 205, 3))), map_names(()))
    known = recipe.Recipe([], ball=[5, 205], ball_at=[30.0, 40.0 + off, 70.0])
    found = recipe.in_place(loaded, known)
    assert (found is not loaded) == moves
    np.testing.assert_allclose(found.mesh.vertices - vertices, np.tile([0.0, off if moves else 0.0, 0.0], (205, 1)),
                               atol=1e-9)  # fmt: skip
    assert recipe.in_place(loaded, recipe.Recipe([])) is loaded
    assert recipe.in_place(loaded, recipe.Recipe([], ball=[5, 205])) is loaded
    assert recipe.Recipe([]).eyeballs(loaded.mesh) is None
