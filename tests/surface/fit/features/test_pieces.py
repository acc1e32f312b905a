"""Brows and lashes stand on the skin and follow it."""

from dataclasses import replace

import numpy as np
import pytest
from slit_sheet import slit_sheet

from surface.fit.features.pieces import (
    ROOT_MM,
    HeadRig,
    Skin,
    brow_strip,
    eyeball_part,
    fit_strip,
    hair_parts,
    lash_strip,
    skin_part,
    teeth_part,
)
from surface.fit.points.recipe import PartRecipe
from surface.fit.points.refine import FitRequest, fit_chart
from surface.fit.source.chart import make_chart
from surface.fit.source.islands import find_islands
from surface.fit.source.mesh import FitMesh
from surface.head.model.data import Jaw
from surface.head.model.meshes import make_surface


@pytest.fixture(scope="module")
def skin() -> Skin:
    mesh = slit_sheet()
    chart = make_chart(mesh, find_islands(mesh), normalise=False)
    return Skin(fit_chart(mesh, chart, FitRequest(250, coarse=0.2)))


def ends(strip, v: float) -> np.ndarray:
    s = np.linspace(0.02, 0.98, 9)
    at = strip.surface.basis_matrix(np.column_stack([s, np.full(9, v)]))
    return np.stack([at @ strip.points, *(at @ (strip.points + m) for m in strip.moves)])


def test_a_strip_passes_through_its_samples():
    s, t = np.meshgrid(np.linspace(0, 1, 15), np.linspace(0, 1, 3), indexing="ij")
    rows = np.stack([s, t, 0.2 * s**2], axis=-1)[None]
    strip = fit_strip(rows, 8, 3, [])
    at = strip.surface.basis_matrix(np.column_stack([s.ravel(), t.ravel()]))
    np.testing.assert_allclose(at @ strip.points, rows.reshape(-1, 3), atol=1e-9)


def test_lashes_are_rooted_in_the_lid_in_every_shape(skin):
    s = np.linspace(0.35, 0.65, 20)
    root = np.column_stack([s, np.full(20, 0.45)])
    strip = lash_strip(skin, root, np.array([0.0, 0.0, 20.0]), np.full(20, 8.0), upper=True, hairs=12)
    want = skin.at(np.column_stack([0.35 + 0.3 * np.linspace(0.02, 0.98, 9), np.full(9, 0.45)]))
    assert np.linalg.norm(ends(strip, 0.0) - want, axis=2).max() < ROOT_MM + 0.45
    length = np.linalg.norm(ends(strip, 1.0) - ends(strip, 0.0), axis=2)
    assert length.min() > 6.5 and length.max() < 9.0


def brow_uv() -> np.ndarray:
    u, v = np.meshgrid(np.linspace(0.55, 0.8, 20), np.linspace(0.78, 0.82, 5), indexing="ij")
    return np.stack([u, v], axis=-1)


def test_brows_lie_just_above_the_skin(skin):
    strip = brow_strip(skin, brow_uv(), hairs=12)
    uv = np.column_stack([0.55 + 0.25 * np.linspace(0.02, 0.98, 9), np.full(9, 0.8)])
    above = ((ends(strip, 0.5) - skin.at(uv)) * skin.normals(uv)).sum(axis=2)
    assert above.min() > 0.3 and above.max() < 1.2


def test_combs_are_closed_lines_inside_the_strip(skin):
    (loop,) = brow_strip(skin, brow_uv(), hairs=12).loops
    assert loop.min() >= 0 and loop.max() <= 1 and len(loop) > 40


def two_teeth() -> FitMesh:
    """Two ellipsoids side by side, 14 by 24 vertices each."""
    a, b = np.meshgrid(np.linspace(0.05, np.pi - 0.05, 14), np.linspace(0, 2 * np.pi, 24), indexing="ij")
    egg = np.stack([4 * np.sin(a) * np.cos(b), 6 * np.cos(a), 3 * np.sin(a) * np.sin(b)], axis=-1).reshape(-1, 3)
    at = np.arange(14 * 24).reshape(14, 24)
    quads = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]], axis=-1).reshape(-1, 4)
    vertices = np.vstack([egg + np.array([-6, 0, 50]), egg + np.array([6, 0, 50])])
    faces = np.vstack([quads, quads + 14 * 24])
    return FitMesh(vertices, faces, np.zeros((1, 2)), np.zeros_like(faces), (), np.zeros((0, len(vertices), 3)))


JAW = Jaw((0.0, 0.0, 0.0), 0.3, (0.0, -1.0, 2.0))


@pytest.fixture(scope="module")
def fitted():
    mesh = slit_sheet()
    chart = make_chart(mesh, find_islands(mesh), normalise=False)
    return mesh, chart, fit_chart(mesh, chart, FitRequest(250, coarse=0.2))


def rig(eyes: np.ndarray | None = None, **other) -> HeadRig:
    sources = {"jawOpen": [0], "mouthSmileLeft": [1]}
    return HeadRig(sources, JAW, np.zeros((2, 3)) if eyes is None else eyes, 0.0 if eyes is None else 12.0, **other)


def recipe(**other) -> PartRecipe:
    return replace(PartRecipe("face", "skin", "skin", [], FitRequest(9), (0, 0.3, 5)), **other)


def test_skin_has_groups_shares_and_slits_and_what_is_fixed_has_none(fitted):
    _, chart, fit = fitted
    part = skin_part(recipe(), chart, fit, rig())
    assert (part.name, part.material, part.follows, part.budget) == ("face", "skin", "skin", (0, 0.3, 5))
    assert {g.name for g in part.groups} <= {"jawOpen", "mouthSmileLeft"} and part.jaw.max() > 0.0
    assert part.slits.shape == (1, 3) and part.slits[0].tolist() == [
        chart.cuts[0].v,
        chart.cuts[0].start,
        chart.cuts[0].end,
    ]
    assert (part.weights == 1).all() and (part.degrees == 3).all() and not part.lids.any()
    np.testing.assert_array_equal(part.points, fit.points)
    fixed = skin_part(recipe(follows="jaw"), chart, fit, rig(np.array([[30.0, 0, 30], [-30, 0, 30]])))
    assert fixed.groups == [] and not fixed.jaw.any() and not fixed.lids.any()
    lids = skin_part(recipe(), chart, fit, rig(np.array([[30.0, 0, 30], [-30, 0, 30]]))).lids
    assert lids.max() > 0.0 > lids.min()


def test_only_a_tongue_that_is_skin_gets_groups_to_put_it_out(fitted):
    _, chart, fit = fitted
    path = np.array([[-50.0, 0, 0, 10, 1, 1, 0], [0, 0, 0, 30, 1, 1, 0], [50, 0, 0, 60, 0.5, 0.5, 4]])
    for material, follows, wanted in (("tongue", "skin", True), ("skin", "skin", False), ("tongue", "jaw", False)):
        part = skin_part(recipe(material=material, follows=follows), chart, fit, rig(tongue=path))
        assert ({"tongueOut", "tongueDroop"} <= {g.name for g in part.groups}) == wanted
    assert not any(g.name == "tongueOut" for g in skin_part(recipe(material="tongue"), chart, fit, rig()).groups)


def test_an_eyeball_is_a_sphere_that_follows_its_eye():
    centre = np.array([30.0, 40.0, 70.0])
    part = eyeball_part("right", centre, 12.0)
    assert (part.name, part.material, part.follows) == ("eye_right", "eye", "right_eye")
    assert part.budget == (0, 0.12, 6) and part.groups == []
    loop = part.loops[0]
    assert 0 < loop[:, 1].min() < 0.01 and loop[:, 1].max() == 1 and np.ptp(loop[:, 0]) == 1
    at = make_surface(part).evaluate(np.array([[0.1, 0.6], [0.5, 0.8], [0.9, 1.0]]))
    np.testing.assert_allclose(np.linalg.norm(at - centre, axis=1), 12.0, atol=1e-9)


def test_teeth_are_patches_by_the_number_of_teeth():
    mesh = two_teeth()
    part = recipe(name="teeth", follows="jaw", vertices=[(0, 2 * 14 * 24)], request=FitRequest(60))
    data, report = teeth_part(mesh, part, rig())
    assert len(data.loops) == 2 and data.groups == [] and report.shapes == {} and 60 < report.points <= 130
    assert report.name == "teeth" and len(data.points) == report.points


def test_hair_of_both_sides_is_rooted_at_the_brow_line_and_the_lids(fitted):
    mesh, chart, fit = fitted
    brow = np.flatnonzero((np.abs(mesh.vertices[:, 1] - 50) < 1e-6) & (mesh.vertices[:, 0] > 20))[:5]
    eyes = np.array([[30.0, 0.0, 20.0], [-30.0, 0.0, 20.0]])
    brows, lashes = hair_parts(mesh, chart, fit, brow.tolist(), rig(eyes))
    assert (brows.name, brows.material, brows.follows) == ("brows", "brow", "skin")
    assert (lashes.name, lashes.material) == ("lashes", "lash")
    assert len(brows.loops) == 2 and len(lashes.loops) == 4
    assert [loop[:, 0].min() >= 2 * k and loop[:, 0].max() <= 2 * k + 1 for k, loop in enumerate(lashes.loops)] == [
        True
    ] * 4
    left, right = np.split(brows.points, 2)
    assert left[:, 0].min() > 0 > right[:, 0].max()  # mirrored
    np.testing.assert_allclose(np.sort(left[:, 1]), np.sort(right[:, 1]), atol=1.5)
    assert np.abs(brows.points[:, 1] - 50).max() < 12
    upper, lower = np.split(lashes.points, 4)[:2]
    assert upper[:, 1].max() - upper[:, 1].min() > 0 and upper[:, 1].max() > lower[:, 1].max()
    reach = [
        np.linalg.norm(p.reshape(10, 3, 3)[:, 2] - p.reshape(10, 3, 3)[:, 0], axis=1).max() for p in (upper, lower)
    ]
    assert 5.0 < reach[0] < 9.0 and 2.0 < reach[1] < 4.0
    assert {g.name for g in lashes.groups} <= {"jawOpen", "mouthSmileLeft"} and len(lashes.lids) == len(lashes.points)
