"""The jaw's path, shares and groups."""

import numpy as np
import pytest

from surface.fit.mesh import FitMesh
from surface.fit.rigging import (
    affine_fit,
    find_jaw,
    jaw_share,
    lid_share,
    make_groups,
    rigid_fit,
    tongue_group,
)  # fmt: skip
from surface.head.data import Jaw
from surface.head.parameters import TONGUE_NEEDS, rotation
from surface.head.rig import jaw_path

RNG = np.random.default_rng(2)
POINTS = RNG.normal(size=(40, 3)) * 20 + [0, -40, 80]
JAW = Jaw((0.0, 6.0, 12.0), 0.4, (0.0, -3.0, 5.0))


def test_rigid_fit_recovers_a_motion():
    turn, shift = rotation(0.2, -0.3, 0.1), np.array([1.0, -2.0, 3.0])
    got_turn, got_shift = rigid_fit(POINTS, POINTS @ turn.T + shift)
    np.testing.assert_allclose(got_turn, turn, atol=1e-12)
    np.testing.assert_allclose(got_shift, shift, atol=1e-10)


def test_the_jaw_is_found_from_its_teeth():
    turn, shift = jaw_path(JAW, 1.0)
    delta = POINTS @ turn.T + shift - POINTS
    none = np.zeros((0, 4), np.int64)
    mesh = FitMesh(POINTS, none, np.zeros((0, 2)), none, ("jawOpen",), delta[None])
    found = find_jaw(mesh, {"jawOpen": [0]}, np.arange(40), np.array(JAW.centre))
    assert found.angle_rad == pytest.approx(JAW.angle_rad)
    np.testing.assert_allclose(found.glide, JAW.glide, atol=1e-9)


def test_affine_fit_recovers_a_map():
    matrix = RNG.normal(size=(3, 4))
    np.testing.assert_allclose(affine_fit(POINTS, POINTS @ matrix[:, :3].T + matrix[:, 3]), matrix, atol=1e-9)


def test_shares_of_points_that_follow_the_jaw_partly():
    turn, shift = jaw_path(JAW, 1.0)
    whole = POINTS @ turn.T + shift - POINTS
    want = np.linspace(0.05, 1.0, 40)
    np.testing.assert_allclose(jaw_share(POINTS, want[:, None] * whole, JAW), want, atol=1e-9)


def test_rotation_and_group_together_give_the_fitted_shape():
    moves = RNG.normal(size=(1, 40, 3)) * 5
    groups, share = make_groups(POINTS, moves, {"jawOpen": [0]}, JAW)
    turn, shift = jaw_path(JAW, 1.0)
    (rest,) = groups
    total = share[:, None] * (POINTS @ turn.T + shift - POINTS)
    total[rest.ids] += rest.moves
    np.testing.assert_allclose(total, moves[0], atol=6e-3)


def test_points_that_do_not_move_are_not_in_a_group():
    moves = np.zeros((2, 40, 3))
    moves[1, 7] = [0, 1, 0]
    groups, _ = make_groups(POINTS, moves, {"cheekPuff": [0], "mouthPucker": [1]}, JAW)
    assert [(g.name, g.ids.tolist()) for g in groups] == [("mouthPucker", [7])]


def test_lids_hold_to_their_own_eye():
    eyes = np.array([[31.0, 36, 84], [-31.0, 36, 84]])
    share = lid_share(np.array([[31.0, 36, 97], [-31.0, 36, 97], [31.0, 36, 120], [0, 36, 84]]), eyes, 12.0)
    np.testing.assert_allclose(share, [1, -1, 0, 0])


def test_the_tongue_ends_where_its_path_says():
    path = np.array([[30.0, -41, -41, 30, 1], [60, -41, -40, 75, 0.5], [98, -41, -45, 126, 0.5]])
    tip = np.array([[0.0, -41.0, 98.0], [0.0, -41.0, 25.0]])
    group = tongue_group(tip, path, JAW)
    turn, shift = jaw_path(JAW, TONGUE_NEEDS)
    out = tip @ turn.T + shift + group.moves
    np.testing.assert_allclose(out[0], [0, -45, 126], atol=1e-3)
    assert np.abs(group.moves[1]).max() < 1e-6
