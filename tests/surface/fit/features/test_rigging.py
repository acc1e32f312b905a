"""The jaw's path, shares and groups."""

import numpy as np
import pytest

from surface.fit.features.rigging import (
    DROOP_RULE,
    affine_fit,
    find_jaw,
    jaw_share,
    lid_share,
    make_groups,
    rigid_fit,
    tongue_groups,
)
from surface.fit.source.mesh import FitMesh
from surface.head.model.data import Jaw
from surface.head.model.parameters import TONGUE_NEEDS, rotation
from surface.head.posing.rig import jaw_path

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


PATH = np.array([[30.0, -41, -41, 30, 1, 1, 0], [60, -41, -40, 75, 0.5, 0.9, 0], [98, -41, -40, 126, 0.5, 0.8, 9]])


def put_out(points: np.ndarray, amount: float) -> np.ndarray:
    """Where points stand at tongueOut ``amount``."""
    turn, shift = jaw_path(JAW, TONGUE_NEEDS)
    out, droop = tongue_groups(points, PATH, JAW)
    assert (out.name, droop.name) == ("tongueOut", DROOP_RULE.group)
    return points @ turn.T + shift + amount * out.moves + amount**DROOP_RULE.power * droop.moves


def test_the_tongue_ends_where_its_path_says():
    tip = np.array([[0.0, -41.0, 98.0], [0.0, -41.0, 25.0]])
    np.testing.assert_allclose(put_out(tip, 1.0)[0], [0, -49, 126], atol=1e-3)
    assert all(np.abs(g.moves[1]).max() < 1e-6 for g in tongue_groups(tip, PATH, JAW))


def test_the_tongue_comes_out_straight_and_hangs_at_the_end():
    tip = np.array([[0.0, -41.0, 98.0]])
    start, half, whole = (put_out(tip, x)[0] for x in (0.0, 0.5, 1.0))
    assert half[1] > 0.5 * (start[1] + whole[1]) + 3.0
    np.testing.assert_allclose(half[2], 0.5 * (start[2] + whole[2]), atol=0.5)


def test_sections_of_the_tongue_stand_square_to_its_path():
    section = np.array([[0.0, -47.0, 80.0], [0.0, -41.0, 80.0], [0.0, -35.0, 80.0], [8.0, -41.0, 80.0]])
    ahead = np.array([[0.0, -41.0, 79.9], [0.0, -41.0, 80.1]])
    low, middle, high, side = put_out(section, 1.0)
    forward = np.subtract(*put_out(ahead, 1.0)[::-1])
    assert abs((high - low) @ forward) < 1e-3 * np.linalg.norm(high - low) * np.linalg.norm(forward) + 2e-4
    assert 5.9 < np.linalg.norm(high - low) < 6.1
    assert 6.4 < side[0] - middle[0] < 7.2


def test_lids_let_go_of_the_eyeball_between_three_and_eight_millimetres_and_behind_its_middle():
    eyes = np.array([[30.0, 0, 0], [-300.0, 0, 0]])

    def share(height: float, z: float) -> float:
        y = np.sqrt((12.0 + height) ** 2 - z**2)
        return float(lid_share(np.array([[30.0, y, z]]), eyes, 12.0)[0])

    wanted = {(-1, 5): 1, (3, 5): 1, (5.5, 5): 0.5, (6.75, 5): 0.15625, (8, 5): 0, (9, 5): 0}
    wanted |= {(0, 0): 1, (0, 1): 1, (0, -1.5): 0.5, (0, -0.75): 0.84375, (0, -3): 0, (0, -5): 0}
    for place, expected in wanted.items():
        assert abs(share(*place) - expected) < 1e-9, place
    other = lid_share(np.array([[30.0, 0, 17.5]]), eyes[::-1], 12.0)
    np.testing.assert_allclose(other, [-0.5])
