"""Brows and lashes stand on the skin and follow it."""

from dataclasses import replace

import numpy as np
import pytest
from slit_sheet import slit_sheet

from surface.fit.features.pieces import (
    ROOT_MM,
    HeadRig,
    Skin,
    _lid_line,
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
    raised = skin_part(recipe(raised=1.5), chart, fit, rig())
    np.testing.assert_allclose(raised.points - fit.points, np.tile([0.0, 1.5, 0.0], (len(fit.points), 1)))
    fixed = skin_part(recipe(follows="jaw"), chart, fit, rig(np.array([[30.0, 0, 30], [-30, 0, 30]])))
    assert fixed.groups == [] and not fixed.jaw.any() and not fixed.lids.any()
    lids = skin_part(recipe(), chart, fit, rig(np.array([[30.0, 0, 30], [-30, 0, 30]]))).lids
    assert lids.max() > 0.0 > lids.min()


def test_a_strip_whose_net_lies_far_beside_it_does_not_keep_to_the_eyeball(fitted):
    """Kept at their own distances from the eyeball, such points would bend the strip in a blink. Nets that lie on their
    surface, and the face in any case, go on keeping to it."""
    mesh, chart, _ = fitted
    fit = fit_chart(mesh, chart, FitRequest(600, coarse=0.1))
    middle = fit.points[np.argmin(np.linalg.norm(fit.points[:, :2], axis=1))]
    eyes = rig(np.array([middle - [0.0, 0.0, 12.0], middle - [200.0, 0.0, 12.0]]))
    usual = skin_part(recipe(), chart, fit, eyes).lids
    assert usual.max() > 0.9
    np.testing.assert_array_equal(skin_part(recipe(material="lash"), chart, fit, eyes).lids, usual)
    wild = replace(fit, points=fit.points + 16.0 * (-1.0) ** np.arange(len(fit.points))[:, None] * [1, 0, 0])
    assert not skin_part(recipe(material="lash"), chart, wild, eyes).lids.any()
    assert skin_part(recipe(), chart, wild, eyes).lids.any()


def test_a_strip_that_a_shape_takes_through_the_eyeball_does_not_keep_to_it(fitted):
    """A few control points far beside the strip, on their way past the eyeball, would be pushed out of it and take the
    strip along; of a strip whose shapes stay outside, all keep to it."""
    mesh, chart, _ = fitted
    fit = fit_chart(mesh, chart, FitRequest(600, coarse=0.1))
    middle = fit.points[np.argmin(np.linalg.norm(fit.points[:, :2], axis=1))]
    eyes = rig(np.array([middle - [0.0, 0.0, 14.0], middle - [200.0, 0.0, 14.0]]))
    part = recipe(material="lash")
    assert skin_part(part, chart, fit, eyes).lids.any()
    near = np.argsort(np.linalg.norm(fit.points - middle, axis=1))[:4]
    moves = fit.moves.copy()
    moves[0, near] += [0.0, 0.0, -9.0]
    assert not skin_part(part, chart, replace(fit, moves=moves), eyes).lids.any()
    assert skin_part(recipe(), chart, replace(fit, moves=moves), eyes).lids.any(), "a lid has to"


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


def outward_and_up(skin, uv: np.ndarray, eye: np.ndarray, sign: float) -> tuple[np.ndarray, np.ndarray]:
    """Away from an eyeball, and up (or down) square to it."""
    away = skin.at(uv) - eye
    away /= np.linalg.norm(away, axis=2, keepdims=True)
    up = np.array([0.0, sign, 0.0]) - away * sign * away[..., 1:2]
    return away, up / np.linalg.norm(up, axis=2, keepdims=True)


@pytest.mark.parametrize(("upper", "sign"), [(True, 1.0), (False, -1.0)])
def test_lashes_lean_away_from_the_eyeball_and_curl_to_their_own_side(skin, upper: bool, sign: float):
    s = np.linspace(0.35, 0.65, 40)
    root, eye = np.column_stack([s, np.full(40, 0.45)]), np.array([3.0, -8.0, 20.0])
    strip = lash_strip(skin, root, eye, np.full(40, 8.0), upper=upper, hairs=12)
    places = np.column_stack([0.35 + 0.3 * np.linspace(0.02, 0.98, 9), np.full(9, 0.45)])
    away, up = outward_and_up(skin, places, eye, sign)
    for v, out, side in ((0.0, 0.4, 0.0), (0.5, 3.74, 0.44), (1.0, 6.8, 3.68)):
        wanted = skin.at(places) + out * away + side * up
        np.testing.assert_allclose(ends(strip, v)[[0, 2]], wanted[[0, 2]], atol=0.15)


@pytest.mark.parametrize(("upper", "thick"), [(True, 0.36), (False, 0.42)])
@pytest.mark.parametrize("hairs", [10, 24])
def test_a_lash_is_a_hair_with_a_fine_tip_on_a_continuous_root(skin, upper: bool, thick: float, hairs: int):
    root = np.column_stack([np.linspace(0.35, 0.65, 20), np.full(20, 0.45)])
    (loop,) = lash_strip(skin, root, np.array([0, 0, 20.0]), np.full(20, 8.0), upper=upper, hairs=hairs).loops
    assert loop[0].tolist() == [0.0, 0.0] and loop[-1].tolist() == [1.0, 0.0] and len(loop) == 2 + 4 * hairs
    left, tip_left, tip_right, right = loop[1:-1].reshape(hairs, 4, 2).swapaxes(0, 1)
    middle = 0.045 + 0.91 * (np.arange(hairs) + 0.5) / hairs
    for side, rows in ((-1.0, left), (1.0, right)):
        half = thick / hairs * np.minimum(1.0, 0.8 + 0.4 * middle)  # finer to the inner corner
        np.testing.assert_allclose(rows[:, 0], np.clip(middle + side * half, 0, 1))
        np.testing.assert_allclose(rows[:, 1], 0.22 * thick)
    np.testing.assert_allclose(tip_right[:, 0] - tip_left[:, 0], 0.0044)
    np.testing.assert_array_equal(tip_left[:, 1], tip_right[:, 1])
    assert tip_left[:, 1].min() > 0.65 and tip_left[:, 1].max() <= 1.0 and np.ptp(tip_left[:, 1]) > 0.15
    aside = 0.5 * (tip_left + tip_right)[:, 0] - middle - 0.048 * (2 * middle - 1)  # they spread towards the ends
    assert np.abs(aside).max() <= 0.3 / hairs and np.ptp(aside) > 0.2 / hairs and abs(aside.mean()) < 0.15 / hairs


def test_hairs_of_a_brow_lean_over_its_upper_edge_from_uneven_roots(skin):
    hairs = 40
    (loop,) = brow_strip(skin, brow_uv(), hairs=hairs).loops
    assert len(loop) == 2 + 4 * hairs
    assert loop[0].tolist() == [0.0, 0.35] and loop[1 + 2 * hairs].tolist() == [1.0, 0.5]
    base, tip = loop[1 : 1 + 2 * hairs].reshape(hairs, 2, 2).swapaxes(0, 1)
    gap, root = loop[2 + 2 * hairs :][::-1].reshape(hairs, 2, 2).swapaxes(0, 1)[::-1]
    x = (np.arange(hairs) + 0.5) / hairs
    ranges = (
        (base, (-0.35, -0.35), (0.66, 0.72)), (tip, (0.9, 1.7), (0.74, 1.0)),
        (root, (0.0, 0.0), (0.06, 0.18)), (gap, (0.5, 0.5), (0.2, 0.28)),
    )  # fmt: skip
    for rows, (least, most), (low, high) in ranges:
        wanted = np.clip([x + least / hairs, x + most / hairs], 0, 1)
        assert (rows[:, 0] >= wanted[0] - 1e-9).all() and (rows[:, 0] <= wanted[1] + 1e-9).all()
        assert rows[:, 1].min() >= low and rows[:, 1].max() <= high
        assert np.ptp(rows[:, 1]) > 0.6 * (high - low)


def test_a_brow_is_arched_over_the_skin(skin):
    strip = brow_strip(skin, brow_uv(), hairs=12)
    for v, height in ((0.0, 0.35), (0.5, 0.7), (1.0, 0.35)):
        uv = np.column_stack([0.55 + 0.25 * np.linspace(0.02, 0.98, 9), np.full(9, 0.78 + 0.04 * v)])
        above = ((ends(strip, v) - skin.at(uv)) * skin.normals(uv)).sum(axis=2)
        np.testing.assert_allclose(above, height, atol=0.08)


def test_normals_are_those_of_the_sheet(skin):
    uv = np.array([[0.5, 0.7], [0.3, 0.6], [0.7, 0.25]])
    x, y = 3 * (uv.T - 0.5)
    slope = np.column_stack([0.6 * np.sin(x) * np.cos(y), 0.6 * np.cos(x) * np.sin(y), np.ones(3)])
    wanted = slope / np.linalg.norm(slope, axis=1)[:, None]
    np.testing.assert_allclose(skin.normals(uv)[0], wanted, atol=0.03)
    np.testing.assert_allclose(np.linalg.norm(skin.normals(uv), axis=2), 1.0)


@pytest.mark.parametrize(("upper", "first", "last", "count", "v"), [
    (True, 0.02, 0.95, 27, 0.7 + 0.0188), (False, 0.10, 0.94, 22, 0.5 - 0.0145),
])  # fmt: skip
@pytest.mark.parametrize("inner_first", [True, False])
def test_lashes_begin_just_outside_the_rim_from_the_inner_corner(upper, first, last, count, v, inner_first):
    u = np.linspace(0.2, 0.6, 9)
    rim = np.vstack([np.column_stack([u, np.full(9, 0.5)]), np.column_stack([u[::-1], np.full(9, 0.7)])])
    roots, along = _lid_line(rim, upper=upper, inner_first=inner_first)
    np.testing.assert_allclose(along, np.linspace(first, last, count))
    np.testing.assert_allclose(roots[:, 0], 0.2 + 0.4 * (along if inner_first else 1.0 - along))
    np.testing.assert_allclose(roots[:, 1], v)


@pytest.mark.slow
def test_teeth_are_fitted_finely_by_the_number_of_teeth(monkeypatch):
    asked = []

    def noted(mesh, chart, request):
        asked.append(request)
        return fit_chart(mesh, chart, request)

    monkeypatch.setattr("surface.fit.features.pieces.fit_chart", noted)
    part = recipe(name="teeth", follows="jaw", vertices=[(0, 2 * 14 * 24)], request=FitRequest(60))
    teeth_part(two_teeth(), part, rig())
    (request,) = asked
    assert (request.points, request.coarse, request.deepest, request.neutral_mm) == (120, 0.4, 2, 0.08)


def test_strips_lie_in_tiles_of_their_own_and_are_as_long_as_wanted(fitted):
    mesh, chart, fit = fitted
    brow = np.flatnonzero((np.abs(mesh.vertices[:, 1] - 50) < 1e-6) & (mesh.vertices[:, 0] > 20))[:5]
    eyes = np.array([[30.0, 0.0, 20.0], [-30.0, 0.0, 20.0]])
    brows, lashes = hair_parts(mesh, chart, fit, brow.tolist(), rig(eyes))
    assert (brows.budget, lashes.budget) == ((0, 0.4, 6), (0, 0.6, 6))
    assert brows.slits.shape == lashes.slits.shape == eyeball_part("left", eyes[0], 12.0).slits.shape == (0, 3)
    for part, count, across in ((brows, 2, 4), (lashes, 4, 3)):
        assert len(part.points) == count * 10 * across and (part.weights == 1).all()
        assert (part.degrees == [3, 2]).all()
        for k, knots in enumerate(np.split(part.knots_u, count)):
            assert (knots.min(), knots.max()) == (2 * k, 2 * k + 1)
        assert (part.knots_v.min(), part.knots_v.max()) == (0, 1)
    assert [len(loop) for loop in lashes.loops] == [2 + 4 * 30, 2 + 4 * 18] * 2
    assert [len(loop) for loop in brows.loops] == [2 + 4 * 40] * 2
    left = np.split(brows.points, 2)[0]
    assert 4.6 < left[:, 1].max() - 50 < 5.7 and 4.2 < 50 - left[:, 1].min() < 5.2
    whole = np.hypot(0.85, 0.46)
    for k, length in enumerate((8.0, 3.0) * 2):
        rows = np.split(lashes.points, 4)[k].reshape(10, 3, 3)
        reach = np.linalg.norm(rows[:, 2] - rows[:, 0], axis=1) + 0.4 * 0.85 / whole
        inner = 0.24 + 0.76 * np.sin(np.pi * (0.02 + 0.64 * (0.02, 0.10)[k % 2]))
        outer = 0.24 + 0.76 * np.sin(np.pi * (0.02 + 0.64 * (0.95, 0.94)[k % 2]))
        assert reach[0] == pytest.approx(inner * length * whole, rel=0.06)
        assert reach[-1] == pytest.approx(outer * length * whole, rel=0.06)
        assert reach.max() == pytest.approx(length * whole, rel=0.06)
