"""The jaw's path, shares and groups."""

import numpy as np
import pytest

from surface.fit.features.rigging import (
    DROOP_RULE,
    affine_fit,
    drawn_back_tongue,
    find_jaw,
    jaw_share,
    lid_share,
    lowered_tongue,
    make_groups,
    take_tongue,
    tongue_groups,
)
from surface.fit.source.mesh import FitMesh
from surface.head.model.data import Jaw
from surface.head.model.parameters import TONGUE_JAW
from surface.head.posing.rig import jaw_path

RNG = np.random.default_rng(2)
POINTS = RNG.normal(size=(40, 3)) * 20 + [0, -40, 80]
JAW = Jaw((0.0, 6.0, 12.0), 0.4, (0.0, -3.0, 5.0))


def test_the_jaw_is_found_from_its_teeth():
    turn, shift = jaw_path(JAW, 1.0)
    delta = POINTS @ turn.T + shift - POINTS
    none = np.zeros((0, 4), np.int64)
    mesh = FitMesh(POINTS, none, np.zeros((0, 2)), none, ("jawOpen",), delta[None])
    found = find_jaw(mesh, {"jawOpen": [0]}, np.arange(40), np.array(JAW.centre))
    assert found.angle_rad == pytest.approx(JAW.angle_rad)
    np.testing.assert_allclose(found.glide, JAW.glide, atol=1e-9)


@pytest.mark.parametrize(("share", "taken"), [(0.1, True), (0.3, True), (0.5, False), (1.0, False)])
def test_a_tongue_that_the_jaw_leaves_behind_is_taken_along(share, taken):
    turn, shift = jaw_path(JAW, 1.0)
    whole = POINTS @ turn.T + shift - POINTS
    chin, tongue, other = np.arange(20), np.arange(20, 35), np.arange(35, 40)
    delta = whole * np.where(np.arange(40) < 20, 1.0, share)[:, None]
    none = np.zeros((0, 4), np.int64)
    mesh = FitMesh(POINTS, none, np.zeros((0, 2)), none, ("cheekPuff", "jawOpen"), np.stack([0.5 * delta, delta]))
    made, notes = take_tongue(mesh, tongue, chin)
    np.testing.assert_allclose(made.deltas[1][tongue], whole[tongue] * (1.0 if taken else share), atol=1e-9)
    np.testing.assert_array_equal(made.deltas[1][other], delta[other])
    np.testing.assert_array_equal(made.deltas[0], mesh.deltas[0])
    assert bool(notes) is taken and (not taken or notes[0].startswith("jawOpen left the tongue behind, "))
    for lacking in ((tongue, chin[:0]), (tongue[:0], chin)):
        assert take_tongue(mesh, *lacking) == (mesh, [])


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
    turn, shift = jaw_path(JAW, TONGUE_JAW)
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


NONE = np.zeros((0, 4), np.int64)


def mesh_of(points: np.ndarray, *moves: np.ndarray) -> FitMesh:
    names = tuple(f"shape {k}" for k in range(len(moves)))
    return FitMesh(points, NONE, np.zeros((0, 2)), NONE, names, np.array(moves))


def test_without_opening_or_teeth_a_jaw_does_not_move():
    mesh, hinge, still = mesh_of(POINTS, 0 * POINTS), np.array([0.5, 6.0, 12.0]), Jaw((0.5, 6.0, 12.0), 0.0, (0, 0, 0))
    assert find_jaw(mesh, {"jawLeft": [0]}, np.arange(40), hinge) == still
    assert find_jaw(mesh, {"jawOpen": [0]}, np.arange(0), hinge) == still


def test_the_jaw_is_the_sum_of_its_sources_glides_straight_and_tilts_by_maps_of_its_teeth():
    turn, shift = jaw_path(JAW, 1.0)
    half = 0.5 * (POINTS @ turn.T + shift + [0.7, 0, 0] - POINTS)
    ahead = POINTS @ np.diag([0.0, 0.01, 0.02]) + [0, 0, 6.0]
    none = np.full((10, 3), 99.0)  # of what is no tooth
    mesh = mesh_of(np.vstack([none, POINTS]), *(np.vstack([none, m]) for m in (half, ahead, half)))
    found = find_jaw(mesh, {"jawOpen": [0, 2], "jawForward": [1]}, np.arange(10, 50), np.array(JAW.centre))
    assert found.angle_rad == pytest.approx(JAW.angle_rad)
    np.testing.assert_allclose(found.glide, [0.0, *JAW.glide[1:]], atol=1e-9)
    assert set(found.tilts) == {"jawForward"}
    np.testing.assert_allclose(found.tilts["jawForward"], [[0, 0, 0, 0], [0, 0.01, 0, 0], [0, 0, 0.02, 6.0]], atol=1e-9)


def test_shares_lie_between_none_and_whole_and_hardly_moved_points_have_none():
    turn, shift = jaw_path(JAW, 1.0)
    whole = POINTS @ turn.T + shift - POINTS
    np.testing.assert_array_equal(jaw_share(POINTS, 3.0 * whole, JAW), np.ones(40))
    np.testing.assert_array_equal(jaw_share(POINTS, -whole, JAW), np.zeros(40))
    along = whole / np.linalg.norm(whole, axis=1, keepdims=True)
    assert not jaw_share(POINTS, 0.049 * along, JAW).any()
    np.testing.assert_allclose(jaw_share(POINTS, 0.051 * along, JAW), 0.051 / np.linalg.norm(whole, axis=1), rtol=1e-9)


def test_groups_leave_out_what_hardly_moves():
    moves = np.zeros((3, 40, 3))
    moves[0, [3, 5, 9], 1] = 0.251, 0.0041, 0.0039
    moves[1, :, 2] = 0.249
    moves[2, 3, 1] = 0.00008
    (only,), share = make_groups(POINTS, moves, {"cheekPuff": [0, 2], "mouthPucker": [1]}, JAW)
    assert only.name == "cheekPuff" and only.ids.tolist() == [3, 5] and only.ids.dtype == np.int32
    np.testing.assert_allclose(only.moves, [[0, 0.2511, 0], [0, 0.0041, 0]], atol=1e-7)
    assert not share.any()


def test_the_tongue_is_held_at_its_root_and_let_go_over_twenty_millimetres():
    still = Jaw((0.0, 0.0, 0.0), 0.0, (0.0, 0.0, 0.0))
    path = np.array([[z, -41.0, -41.0, z + 30.0, 1.0, 1.0, 4.0] for z in (30.0, 60.0, 98.0)])
    points = np.array([[3.0, -38.0, z] for z in (20.0, 30.0, 35.0, 40.0, 50.0, 90.0)])
    out, droop = tongue_groups(points, path, still)
    held = np.array([0.0, 0.0, 0.25, 0.5, 1.0, 1.0])
    np.testing.assert_allclose(out.moves, held[:, None] * [0, 0, 30.0], atol=1e-4)
    np.testing.assert_allclose(droop.moves, held[:, None] * [0, -4.0, 0], atol=1e-4)
    assert out.ids.tolist() == droop.ids.tolist() == list(range(6))


def test_displacements_are_rounded_to_a_tenth_of_a_micrometre():
    """So that they take little room in a head's file."""
    moves = RNG.normal(size=(1, 40, 3)) * 5
    made, _ = make_groups(POINTS, moves, {"cheekPuff": [0]}, JAW)
    np.testing.assert_allclose(made[0].moves, moves[0], atol=0.6e-4)
    section = np.array([[3.0, -44.0, 44.0], [1.0, -38.0, 71.0], [2.0, -41.0, 93.0]])
    for group in (*made, *tongue_groups(section, PATH, JAW)):
        steps = 1e4 * group.moves.astype(float)
        assert np.abs(steps - np.rint(steps)).max() < 0.06 and (np.rint(steps) % 10).any()


def test_the_front_of_a_lowered_tongue_sinks_and_its_root_stays():
    points = np.column_stack([np.full(5, 10.0), np.full(5, -40.0), [20.0, 50.0, 70.0, 90.0, 98.0]])
    path = np.zeros((5, 7))
    path[:, 0] = [30.0, 50.0, 70.0, 90.0, 98.0]
    group = lowered_tongue(points, path, 6.0)
    assert group.name == "tongueLow" and group.ids.tolist() == [2, 3, 4]
    assert group.moves == pytest.approx(np.outer([0.5, 1.0, 1.0], [-0.4, -6.0, -3.0]))


def test_the_tongue_draws_back_before_a_lip_that_rolls_in_its_tip_the_furthest() -> None:
    points = np.column_stack([np.zeros(5), np.full(5, -41.0), [20.0, 50.0, 70.0, 89.0, 98.0]])
    path = np.array([[z, -41.0, -41.0, z, 1.0, 1.0, 0.0] for z in (30.0, 50.0, 65.0, 79.0, 89.0, 98.0)])
    group = drawn_back_tongue(points, path, 3.0)
    assert group.name == "tongueBack" and group.ids.tolist() == [2, 3, 4]
    assert not group.moves[:, :2].any() and group.moves[0, 2] < 0.0
    np.testing.assert_allclose(group.moves[1:, 2], -3.0)
