"""What keeps lids on an eyeball, and what lines them out of it."""

import numpy as np
import pytest
from face_measures import eye_height

from surface.fit.points.eyeball import surface_height
from surface.head.posing.contact import LID_MM, LIFT_GAIN, TOUCH_MM, by_lanes, height_limits
from surface.head.posing.contact_kernels import (
    MAX_SIGHT,
    angle,
    find_gaps,
    find_heights,
    find_lifts,
    find_overlap,
    follow_samples,
    hidden_to,
    lift_points,
    move_points,
    overlap_at,
    place_samples,
    trace_profiles,
    turn_of,
)
from surface.head.posing.rig import optical_axis

RADIUS = 12.1
LOOKS = ((0.0, 0.0), (0.5, -0.3), (-0.4, 0.5))


def directions(count: int) -> np.ndarray:
    """(count, 3) unit vectors in front of an eye."""
    out = np.random.default_rng(2).normal(size=(count, 3)) * [1.0, 1.0, 0.5] + [0.0, 0.0, 1.0]
    out = out[out[:, 2] > 0.1]
    return out / np.linalg.norm(out, axis=1, keepdims=True)


def samples_at(points: np.ndarray) -> np.ndarray:
    """(s, 4) as x, y, z and depth of points (s, 3) from the eyeball's centre."""
    start, ids, share = np.arange(len(points) + 1), np.arange(len(points)), np.zeros(8 * len(points), np.int16)
    share[::8] = 32767
    out, single = np.empty((8 * len(points), 4)), np.empty((len(points), 3), np.float32)
    place_samples(start, ids, share, np.zeros((len(out), 3)), points, True, single, np.empty(48, np.float32), out)
    return np.ascontiguousarray(out[::8])


def off_limits(rest: np.ndarray, samples: np.ndarray, axis: np.ndarray, *, held: bool) -> tuple[float, np.ndarray]:
    """Largest error and lifts of samples, of those whose places at rest are given."""
    heights, lifts = np.empty(len(rest)), np.empty(len(rest))
    find_heights(samples, RADIUS, axis, heights)
    return find_lifts(heights, *height_limits(rest, RADIUS, held=held), LIFT_GAIN, lifts), lifts


def test_angles_are_those_of_numpy_all_round():
    rng = np.random.default_rng(4)
    sides = [(0.0, 1.0), (1.0, 0.0), (-1.0, 0.0), (0.0, -1.0), (0.0, 0.0), (1e-300, 1e-300)]
    for y, z in [*rng.normal(size=(400, 2)), *sides]:
        assert angle(y, z) == pytest.approx(np.arctan2(y, z), abs=2e-8)


@pytest.mark.parametrize("look", LOOKS)
def test_heights_are_those_above_ball_and_cornea(look):
    way, axis = directions(300), optical_axis(np.array(look))
    points = way * (RADIUS + np.linspace(-1, 4, len(way)))[:, None]
    found = np.empty(len(way))
    find_heights(samples_at(points), RADIUS, axis, found)
    wanted = np.linalg.norm(points, axis=1) - RADIUS * eye_height(way, axis)
    np.testing.assert_allclose(found, wanted, atol=5e-3)
    assert (eye_height(way, axis) > 1.05).any()


@pytest.mark.parametrize("look", LOOKS)
def test_lids_are_seated_on_the_surface_that_is_measured(look):
    axis, way = optical_axis(np.array(look)), directions(300)
    np.testing.assert_allclose(surface_height(way, axis), eye_height(way, axis), atol=1e-9)


def test_what_is_too_low_is_lifted_and_what_is_too_high_laid_down():
    lifts = np.full(4, 9.0)
    heights, most = np.array([0.2, 1.0, 2.0, 2.0]), np.array([0.5, 1.5, 1.5, 1.5])
    worst = find_lifts(heights, np.array([0.5, 0.5, 0.5, 0.5]), most, np.array([1.0, 1.0, 1.0, 0.0]), 1.5, lifts)
    np.testing.assert_allclose(lifts, [0.45, 0.0, -0.75, 0.0])
    assert worst == pytest.approx(0.5)


def test_a_lift_goes_away_from_the_eyeball_where_its_sample_stands():
    way = directions(60)[:21]
    points, rest, lifts = np.zeros((23, 3)), samples_at(13.0 * way), np.linspace(-0.5, 0.5, 21)
    table = np.random.default_rng(3).uniform(0, 1, (21, 19))  # three tiles of points, the last one not full
    lift_points(np.arange(19) + 1, lifts, rest, *by_lanes(table), np.empty(48, np.float32), points)
    np.testing.assert_allclose(points[1:20], (lifts[:, None] * table).T @ way, atol=1e-4)
    assert not points[0].any() and not points[20:].any() and lifts[10] == 0.0


def test_what_lay_on_the_ball_follows_the_cornea_and_what_stood_off_does_not():
    ahead, aside = optical_axis(np.zeros(2)), optical_axis(np.array([0.6, 0.0]))
    way = np.array([[0.0, 0.1, 1.0], [0.0, 0.1, 1.0], [0.0, 0.1, 1.0]]) / np.hypot(0.1, 1.0)
    ground = RADIUS * eye_height(way, ahead)
    rest = samples_at(way * (ground + np.array([0.3, LID_MM, 4.0]))[:, None])
    assert off_limits(rest, rest, ahead, held=True)[0] == pytest.approx(0.0, abs=1e-9)
    fall = ground[0] - RADIUS * eye_height(way, aside)[0]
    assert fall > 0.9  # the cornea turned away
    error, lifts = off_limits(rest, rest, aside, held=True)
    assert error == pytest.approx(fall, abs=0.01)
    assert lifts[0] < -fall and lifts[1] < -fall and lifts[2] == 0.0


def test_a_lining_only_keeps_out():
    way = np.array([[0.0, 0.3, 1.0]]) / np.hypot(0.3, 1.0)
    ahead = optical_axis(np.zeros(2))
    ground = RADIUS * eye_height(way, ahead)
    rest = samples_at(way * (ground + 0.5)[:, None])
    for height, wanted in ((2.0, 0.0), (0.1, 0.0), (-0.4, 0.4 + TOUCH_MM)):
        off, _ = off_limits(rest, samples_at(way * (ground + height)[:, None]), ahead, held=False)
        assert off == pytest.approx(wanted, abs=5e-3)


PRESS, SOFT = 0.3, 0.1
DEPTHS = np.array([0.0, 2.0, 4.0, 6.0, 8.0])


def opening(overlap: float, columns: int = 4, slant: float = 0.0, shift: float = 0.0) -> np.ndarray:
    """(2, columns, 5, 3): profiles that are nearest at depth 0, the lower one higher by ``overlap`` there; the lower
    rim rises by ``slant`` a column, and its columns lie ``shift`` columns beside the upper ones."""
    out = np.zeros((2, columns, 5, 3))
    for k in range(columns):
        out[0, k] = np.column_stack([np.full(5, float(k)), 0.5 * DEPTHS, DEPTHS])
        height = overlap + slant * (k + shift) - 0.5 * DEPTHS
        out[1, k] = np.column_stack([np.full(5, k + shift), height, DEPTHS])
    return out


@pytest.mark.parametrize(
    ("overlap", "wanted"),
    [(-2.0, 0.0), (0.0, 0.0), (PRESS - SOFT, 0.0), (PRESS - SOFT / 2, SOFT / 16), (PRESS, SOFT / 4),
     (PRESS + SOFT, SOFT), (PRESS + 1.0, 1.0)],
)  # fmt: skip
def test_sides_give_way_to_overlap_beyond_what_is_allowed(overlap, wanted):
    push = np.full((2, 4), 9.0)
    find_overlap(opening(overlap), PRESS, SOFT, push)
    np.testing.assert_allclose(push, wanted, atol=1e-9)


def test_sides_at_different_depths_do_not_overlap():
    samples, push = opening(1.0), np.full((2, 4), 9.0)
    samples[1, :, :, 2] += 9.0
    find_overlap(samples, PRESS, SOFT, push)
    assert not push.any()


def test_overlap_is_found_between_the_samples_of_a_profile():
    samples, push = opening(-9.0), np.zeros((2, 4))
    samples[1, :, :, 2] = [1.0, 1.0, 1.0, 1.0, 3.0]  # a lip that reaches up at depth 1 and 3, between samples
    samples[1, :, :, 1] = [-9.0, -9.0, -9.0, 2.0, 2.5]
    find_overlap(samples, PRESS, SOFT, push)
    np.testing.assert_allclose(push, 1.5 - PRESS, atol=1e-9)  # the upper is at 0.5 at depth 1, at 1.5 at depth 3


def test_a_profile_reaches_as_far_as_its_highest_line_at_a_depth():
    rng = np.random.default_rng(8)
    heights, depths = rng.normal(size=7), rng.uniform(2.0, 9.0, 7)
    depths[4] = depths[3]  # a step straight up
    for depth in (*rng.uniform(1.0, 10.0, 60), depths[0], depths[6]):
        lines = [
            np.interp(depth, *zip(*sorted(zip(depths[j : j + 2], heights[j : j + 2], strict=True)), strict=True))
            for j in range(6) if j != 3 and depths[j : j + 2].min() <= depth <= depths[j : j + 2].max()
        ]  # fmt: skip
        for sign in (1.0, -1.0):
            wanted = max((sign * (line - 0.3) for line in lines), default=-1e9)
            assert overlap_at(0.3, depth, heights, depths, sign) == pytest.approx(wanted)


def test_sides_are_compared_at_the_same_x():
    push = np.zeros((2, 4))
    find_overlap(opening(1.0, slant=0.5, shift=0.25), PRESS, SOFT, push)
    np.testing.assert_allclose(push[0, 1:], 1.0 + 0.5 * np.arange(1, 4) - PRESS, atol=1e-9)
    np.testing.assert_allclose(push[0, 0], 1.125 - PRESS)  # nothing further left: the first column counts
    np.testing.assert_allclose(push[1], 1.0 + 0.5 * (np.arange(4) + 0.25) - PRESS, atol=1e-9)


@pytest.mark.parametrize("ahead", [0.0, 6.0, -6.0])
def test_an_opening_is_as_wide_as_where_one_sees_farthest_into_it(ahead):
    """The lower rim rises by 0.5 a column, and lies ``ahead`` of the upper one: seen aside, it is beside it."""
    samples, gaps = opening(-2.0, columns=21, slant=0.5), np.zeros((2, 21))
    samples[1, :, :, 2] += ahead
    find_gaps(samples, gaps)
    seen = 2.0 - 0.5 * np.arange(21) + 0.5 * MAX_SIGHT * abs(ahead)
    np.testing.assert_allclose(gaps[0, 5:16], seen[5:16], atol=1e-9)


def test_an_opening_whose_line_runs_back_seen_aside_is_that_of_its_mirror_image():
    """The upper rim bulges forward between its columns 5 and 8, so steeply that it hides itself seen aside."""
    samples, gaps, mirrored = opening(-2.0, columns=21, slant=0.5), np.zeros((2, 21)), np.zeros((2, 21))
    samples[0, 5:9, :, 2] += 4.0
    samples[0, 6, :, 1] -= 1.5
    find_gaps(samples, gaps)
    find_gaps(samples[:, ::-1] * [-1.0, 1.0, 1.0], mirrored)
    np.testing.assert_allclose(mirrored[:, ::-1], gaps, atol=1e-12)


def test_of_the_pieces_of_a_line_at_one_place_the_one_that_hides_most_counts():
    across, edge = np.array([0.0, 3.0, 1.0, 4.0]), np.zeros((4, 3))
    edge[:, 1] = [0.0, 3.0, 7.0, 1.0]
    assert hidden_to(across, edge, 2.0, 1.0) == pytest.approx(5.0)
    assert hidden_to(across, edge, 2.0, -1.0) == pytest.approx(2.0)
    assert hidden_to(across, edge, -5.0, 1.0) == 0.0 and hidden_to(across, edge, 9.0, -1.0) == 1.0  # beyond its ends


def test_points_move_up_straight_or_round_the_eyeball_or_away_from_it():
    rng = np.random.default_rng(5)
    table, amounts, ids = rng.random((3, 2)), np.array([0.5, 0.0, -1.5]), np.array([3, 1])
    rest, eye = rng.normal(size=(5, 3)) + np.array([0.0, 0.0, 12.0]), np.array([0.5, -0.5, 1.0])
    moves = amounts @ table
    straight, around, outward = rest.copy(), rest.copy(), rest.copy()
    move_points(ids, amounts, table, eye, 0.0, False, straight)
    np.testing.assert_allclose(straight[ids] - rest[ids], np.column_stack([0 * moves, moves, 0 * moves]))
    move_points(ids, amounts, table, eye, RADIUS, False, around)
    local, was = around[ids] - eye, rest[ids] - eye
    np.testing.assert_allclose(np.linalg.norm(local, axis=1), np.linalg.norm(was, axis=1))
    angle = np.arctan2(local[:, 1], local[:, 2]) - np.arctan2(was[:, 1], was[:, 2])
    np.testing.assert_allclose(angle, moves / RADIUS)
    move_points(ids, amounts, table, eye, RADIUS, True, outward)
    np.testing.assert_allclose(np.linalg.norm(outward[ids] - eye, axis=1), np.linalg.norm(was, axis=1) + moves)
    for points in (straight, around, outward):
        np.testing.assert_array_equal(points[[0, 2, 4]], rest[[0, 2, 4]])
    move_points(ids, 0.0 * amounts, table, eye, RADIUS, True, around := rest.copy())
    np.testing.assert_array_equal(around, rest)


def test_points_follow_the_two_samples_they_lie_beside():
    rng = np.random.default_rng(6)
    ids, beside, share = np.array([3, 1]), np.array([[0, 2], [1, 2]]), rng.random((2, 2))
    rest, eye = rng.normal(size=(5, 3)) + np.array([0.0, 0.0, 12.0]), np.array([0.5, -0.5, 1.0])
    for radius in (0.0, RADIUS):
        slid, lifted = rng.normal(size=3), rng.normal(size=3)
        wanted, found = rest.copy(), rest.copy()
        table = np.zeros((3, 2))
        table[beside, np.arange(2)[:, None]] = share
        move_points(ids, slid, table, eye, radius, False, wanted)
        follow_samples(ids, beside, share, slid, 3, eye, radius, found)
        np.testing.assert_allclose(found, wanted)
        if radius:
            move_points(ids, lifted, table, eye, radius, True, wanted)
            follow_samples(ids, beside, share, np.concatenate([slid, lifted]), 3, eye, radius, found := rest.copy())
            np.testing.assert_allclose(found, wanted)


@pytest.mark.parametrize("around", [False, True])
def test_samples_are_sums_of_points_by_tiles_of_eight(around):
    rng = np.random.default_rng(6)
    local = rng.normal(size=(4, 3)) + np.array([-1.0, 1.0, 9.0])
    start, ids = np.array([0, 2, 3]), np.array([1, 3, 0])
    packed = rng.integers(0, 32768, (3, 8)).astype(np.int16)
    share = packed / 32767
    out, single, offset = np.empty((11, 4)), np.empty((4, 3), np.float32), rng.normal(size=(11, 3))
    place_samples(start, ids, packed.ravel(), offset, local, around, single, np.empty(48, np.float32), out)
    sums = np.concatenate([share[:2].T @ local[[1, 3]], np.outer(share[2], local[0])])[:11] + offset
    np.testing.assert_allclose(out[:, :3], sums, rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(out[:, 3], np.linalg.norm(sums, axis=1) if around else sums[:, 2], rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("radius", [0.0, RADIUS])
def test_profiles_are_those_of_the_rows_that_can_touch(radius):
    samples = samples_at(directions(200)[:40] * 13.0)
    out = np.empty((2, 4, 3, 3))
    trace_profiles(samples, 5, radius, np.empty(len(samples)), out)
    own = samples.reshape(2, 4, 5, 4)[:, :, :3]
    np.testing.assert_array_equal(out[..., [0, 2]], own[..., [0, 3]])
    arc = radius * np.arctan2(own[..., 1], own[..., 2]) if radius else own[..., 1]
    np.testing.assert_allclose(out[..., 1], arc, atol=1e-6)


@pytest.mark.parametrize("angle", [0.0, 0.1, -0.249, 0.251, -2.0])
def test_small_turns_are_as_exact_as_large_ones(angle: float) -> None:
    np.testing.assert_allclose(turn_of(angle), (np.sin(angle), np.cos(angle)), rtol=0, atol=3e-16)
