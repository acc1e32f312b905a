"""Samples of a head's skin: the nearest of them, how far out it lies, and what of it counts as ears."""

from __future__ import annotations

import numpy as np
import pytest

from surface.fit.wardrobe.skin import CENTRE, Skin, unit
from tests.surface.fit.wardrobe.made_skin import Form, half, skin_of, whole_skin


@pytest.fixture(scope="module")
def skin() -> Skin:
    return whole_skin()


def test_samples_are_vertices_and_middles_of_both_parts_on_their_surfaces(skin: Skin) -> None:
    face, back = 50 * 56, 49 * 55
    triangles = 2 * 49 * 55 + 2 * 48 * 54
    assert len(skin.points) == face + back + 2 * triangles
    assert np.bincount(skin.part).tolist() == [face + 4 * 49 * 55, back + 4 * 48 * 54]
    for part, first in ((0, -0.5 * np.pi), (1, 0.5 * np.pi)):
        own = skin.part == part
        np.testing.assert_allclose(skin.points[own], Form(first).places(skin.uv[own]))
    np.testing.assert_allclose(np.linalg.norm(skin.normals, axis=1), 1.0)


@pytest.mark.parametrize("flip", [False, True])
def test_normals_look_outwards_or_inwards_as_the_parts_triangles_run(flip: bool) -> None:
    skin = skin_of(half(-0.5 * np.pi, 20, 24, flip=flip), half(0.5 * np.pi, 20, 24, flip=flip))
    skull = skin.points[:, 1] > 20.0
    out = (skin.normals * (skin.points - CENTRE)).sum(axis=1)[skull]
    assert ((out < 0) if flip else (out > 0)).all()


def test_ears_are_a_box_on_either_side_and_inner_skin_above_the_neck_does_not_count(skin: Skin) -> None:
    is_bare = np.isin(np.arange(len(skin.points)), skin.bare)
    low, high = np.array([79.0, -22.0, -34.0]), np.array([np.inf, 46.0, 26.0])
    at = np.abs(skin.points * [1.0, 0.0, 0.0]) + skin.points * [0.0, 1.0, 1.0]
    ear = ((at > low) & (at < high)).all(axis=1)
    assert not is_bare[ear].any()
    for side in (-1.0, 1.0):
        assert (ear & (skin.points[:, 0] * side > 0)).sum() > 50
    beside = ~ear & (skin.points[:, 1] > -20.0)
    assert is_bare[beside].all()
    neck = skin.points[:, 1] < -40.0
    assert is_bare[neck].all()  # also where it looks towards the skull
    assert ((skin.normals * (skin.points - CENTRE)).sum(axis=1)[neck] < 0).any()
    inwards = skin_of(half(-0.5 * np.pi, 20, 24, flip=True), half(0.5 * np.pi, 20, 24, flip=True))
    outside = (inwards.normals * (inwards.points - CENTRE)).sum(axis=1) > 0
    kept = np.isin(np.arange(len(inwards.points)), inwards.bare)
    np.testing.assert_array_equal(kept, outside | (inwards.points[:, 1] < -40.0))


def test_the_nearest_skin_has_the_forms_normal_and_distance(skin: Skin) -> None:
    place = np.array([[0.31, 0.8], [0.62, 0.86], [0.5, 0.93]])
    at, along_u, along_v = Form(-0.5 * np.pi).derivatives(place)
    normal = unit(np.cross(along_u, along_v))
    for height in (-4.0, 0.0, 6.0):
        normals, away = skin.nearest(at + height * normal)
        np.testing.assert_allclose(away, height, atol=0.35)
        assert ((normals * normal).sum(axis=1) > 0.995).all()


def test_over_an_ear_the_distance_is_that_from_it_only_where_ears_count(skin: Skin) -> None:
    ear = np.setdiff1d(np.arange(len(skin.points)), skin.bare)
    tip = skin.points[ear[skin.points[ear, 0].argmax()]][None] + [2.0, 0.0, 0.0]
    with_ears, without = skin.nearest(tip, ears=True)[1], skin.nearest(tip)[1]
    assert with_ears[0] == pytest.approx(2.0, abs=0.4) and abs(without[0] - 2.0) > 1.0
    anchor, _ = skin.anchors(tip)
    assert not np.isin(anchor[0, 1:], skin.uv[ear]).all()  # what lies over an ear hangs on the skin beside it


def test_reach_is_how_far_the_skin_lies_from_the_skulls_centre(skin: Skin) -> None:
    place = np.array([[0.3, 0.86], [0.5, 0.9], [0.7, 0.82]])
    at = Form(-0.5 * np.pi).places(place) - CENTRE
    far = np.linalg.norm(at, axis=1)
    np.testing.assert_allclose(skin.reach(at / far[:, None]), far, atol=0.8)


def test_anchors_and_offsets_lead_back_to_the_points(skin: Skin) -> None:
    points = np.random.default_rng(0).uniform(-120, 120, (40, 3))
    anchor, offset = skin.anchors(points)
    foot = np.empty_like(points)
    for part, first in ((0, -0.5 * np.pi), (1, 0.5 * np.pi)):
        own = anchor[:, 0] == part
        assert own.any()
        foot[own] = Form(first).places(anchor[own, 1:])
    np.testing.assert_allclose(foot + offset, points)
    every = np.linalg.norm(points[:, None] - skin.points[None, skin.bare], axis=2).min(axis=1)
    np.testing.assert_allclose(np.linalg.norm(offset, axis=1), every)


def test_unit_keeps_directions_and_leaves_nothing_undefined() -> None:
    np.testing.assert_allclose(unit(np.array([[3.0, 0.0, 4.0], [0.0, -2.0, 0.0]])), [[0.6, 0, 0.8], [0, -1, 0]])
    assert (unit(np.zeros((1, 3))) == 0).all()
    many = np.random.default_rng(0).normal(size=(2, 4, 3))
    np.testing.assert_allclose(np.linalg.norm(unit(many), axis=2), 1.0)
