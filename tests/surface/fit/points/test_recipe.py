"""Recipes know the meshes they were made for."""

from dataclasses import replace

import numpy as np
from slit_sheet import slit_sheet

from surface.fit.points.recipe import recipe_for
from surface.fit.source.mesh import FitMesh


def test_an_unknown_mesh_has_none():
    assert recipe_for(slit_sheet()) is None


def test_ict_is_taken_apart():
    sizes = FitMesh(np.zeros((26719, 3)), np.zeros((26384, 4), int), np.zeros((1, 2)), np.zeros((26384, 4), int), (),
                    np.zeros((0, 26719, 3)))  # fmt: skip
    recipe = recipe_for(sizes)
    names = [p.name for p in recipe.parts + recipe.teeth]
    assert names == ["face", "back", "cavity", "sockets", "gums_upper", "gums_lower", "tongue", "teeth_upper",
                     "teeth_lower"]  # fmt: skip
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
