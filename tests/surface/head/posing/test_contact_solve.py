"""surface.head.posing.contact_solve: samples that are control points themselves, whose solution is known exactly."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from surface.head.posing import contact_solve as module
from surface.head.posing.contact import by_lanes, tile_weights

AWAY = np.array([0.0, 0.0, -1.0])  # an eye that looks away: no cornea at samples before it
RADIUS = 12.0


class Samples:
    """Every sample is one control point, and a lift moves that point alone by ``gain`` times the error.

    Control points are given among others, which must stay; only ``own`` of the samples' points may be moved.
    """

    def __init__(self, places: np.ndarray, *, radius: float, own: np.ndarray | None = None, gain: float = 1.0,
                 least: float = 1.0, most: float = 1e9, hold: float = 0.0) -> None:  # fmt: skip
        s = len(places)
        self.eye, self.places = np.array([0.1, -0.7, 5.3]), places
        self.near = 2 * np.arange(s) + 1  # every second point is near
        self.points = np.full((2 * s + 1, 3), 77.0)
        self.points[self.near] = places + self.eye
        self.own = np.arange(s) if own is None else own
        identity = np.eye(s)[:, self.own]
        tiles = tile_weights(np.arange(s + 1), np.arange(s), np.ones(s))
        self.sampling = self.near, *tiles, self.own, np.arange(s), np.zeros((s, 3))
        self.limits = (*(np.full(s, x) for x in (least, most, hold)), radius, gain, *by_lanes(identity))
        single, room = np.zeros((s, 3), np.float32), np.zeros(48, np.float32)
        self.work = (np.zeros((s, 3)), np.full((s, 3), np.nan), single, room, np.zeros((s, 4)), np.zeros(s),
                     np.zeros(s), np.zeros(4))  # fmt: skip

    def clear(self, passes: int, tolerance: float, axis: np.ndarray = AWAY) -> float:
        """Run :func:`clear_eyeball`."""
        return float(module.clear_eyeball(self.points, self.eye, axis, passes, tolerance, self.sampling, self.limits,
                                          self.work))  # fmt: skip

    @property
    def now(self) -> np.ndarray:
        """(s, 3) the samples' points, from the eye."""
        assert (np.delete(self.points, self.near, axis=0) == 77.0).all()  # nobody else was moved
        return self.points[self.near] - self.eye


def before_the_eye(distances: list[float]) -> np.ndarray:
    """Places at these distances from the eye's centre, in different directions."""
    ways = np.random.default_rng(len(distances)).normal(size=(len(distances), 3))
    ways[:, 2] = np.abs(ways[:, 2]) + 1.0
    return np.asarray(np.array(distances)[:, None] * ways / np.linalg.norm(ways, axis=1, keepdims=True))


def test_points_that_are_too_low_go_straight_out_to_the_least_height_and_others_stay() -> None:
    places = before_the_eye([11.0, 12.5, 13.5, 14.0, 12.0, 16.0, 10.0, 13.0, 12.9])  # more than one tile of eight
    samples = Samples(places, radius=RADIUS)
    error = samples.clear(3, 1e-4)
    wanted = np.maximum(np.linalg.norm(places, axis=1), RADIUS + 1.0)
    np.testing.assert_allclose(np.linalg.norm(samples.now, axis=1), wanted, atol=2e-5)
    np.testing.assert_allclose(samples.now, places * (wanted / np.linalg.norm(places, axis=1))[:, None], atol=2e-5)
    assert error < 1e-4


@pytest.mark.parametrize("passes", [1, 2, 4])
def test_every_pass_takes_its_share_of_the_error_and_the_last_one_found_is_returned(passes: int) -> None:
    samples = Samples(before_the_eye([RADIUS - 3.0] * 3), radius=RADIUS, gain=0.5)
    error = samples.clear(passes, 1e-6)
    assert error == pytest.approx(4.0 * 0.5 ** (passes - 1), rel=1e-5)
    left = RADIUS + 1.0 - np.linalg.norm(samples.now, axis=1)
    np.testing.assert_allclose(left, 4.0 * 0.5**passes, rtol=1e-4)


def test_points_that_rest_are_brought_back_as_firmly_as_they_are_held() -> None:
    for hold, height in ((1.0, 2.0), (0.25, 3.5), (0.0, 4.0)):
        samples = Samples(before_the_eye([RADIUS + 4.0]), radius=RADIUS, most=2.0, hold=hold)
        error = samples.clear(1, 1e-6)
        assert np.linalg.norm(samples.now) == pytest.approx(RADIUS + height, abs=1e-5)
        assert error == pytest.approx(2.0 * hold, abs=1e-6)


def test_an_error_within_the_tolerance_leaves_every_bit() -> None:
    samples = Samples(before_the_eye([12.95, *np.linspace(13.1, 15.0, 20)]), radius=RADIUS)
    samples.points += 1e-6 / 3.0  # numbers with all their digits
    before = samples.points.copy()
    assert ((before[samples.near] - samples.eye) + samples.eye != before[samples.near]).any()  # what moving would round
    assert samples.clear(3, 0.06) == pytest.approx(0.05, abs=1e-5)
    np.testing.assert_array_equal(samples.points, before)


def test_only_points_that_may_move_do() -> None:
    samples = Samples(before_the_eye([11.0, 11.0, 11.0]), radius=RADIUS, own=np.array([2]))
    error = samples.clear(2, 1e-3)
    np.testing.assert_allclose(np.linalg.norm(samples.now, axis=1), [11.0, 11.0, 13.0], atol=1e-5)
    assert error == pytest.approx(2.0, abs=1e-5)


def test_the_cornea_of_an_eye_that_looks_there_is_higher() -> None:
    """Its sphere: centre 0.4447 and radius 0.65 of the eyeball's."""
    ahead = np.array([0.0, 0.0, 1.0])
    samples = Samples(np.array([[0.0, 0.0, 13.0]]), radius=RADIUS)
    samples.clear(2, 1e-4, ahead)
    assert samples.now[0, 2] == pytest.approx(RADIUS * (0.4447 + 0.65) + 1.0, abs=1e-4)


# ---------------------------------------------------------------- sides of an opening
COLUMNS, ROWS = 5, 3
SHARE = 0.75  # of a gap that the upper side takes


class Sides:
    """Two sides of five columns and three rows, whose samples are control points; the upper side takes 3/4 of a gap."""

    def __init__(self, places: np.ndarray, *, radius: float = 0.0, least: float = -1e9, rows: int = ROWS) -> None:
        self.samples = Samples(places.reshape(-1, 3), radius=radius, least=least)
        s, profiles = len(self.samples.places), (2, COLUMNS, rows, 3)
        side_column = np.repeat(np.arange(2 * COLUMNS), ROWS)
        share = np.where(side_column < COLUMNS, SHARE, SHARE - 1.0)
        self.apart = np.zeros((2 * COLUMNS, s))
        for column in range(2 * COLUMNS):  # a column's amount moves the same column of both sides
            same = side_column % COLUMNS == column % COLUMNS
            self.apart[column, same] = 0.5 * share[same]  # both sides find the same overlap
        self.opening = (np.zeros(profiles), np.zeros(profiles), np.zeros((2, COLUMNS)), np.zeros((s, 3)),
                        np.zeros((2, COLUMNS)), np.zeros((2, COLUMNS)), np.zeros(COLUMNS))  # fmt: skip
        self.push = np.full(4 * COLUMNS * rows if radius else 2 * COLUMNS, 9.0)

    def part(self, *, seal: float = 0.0, passes: int = 3, axis: np.ndarray = AWAY, tolerance: float = 0.1) -> int:
        """Run :func:`part_sides` with an overlap of 0.3 allowed, softly from 0.1 before that."""
        samples = self.samples
        words: Any = (self.apart, self.opening, self.push, samples.sampling, samples.limits, samples.work)
        return int(
            module.part_sides(samples.points, samples.eye, axis, seal, passes, tolerance, 0.3, 0.1, ROWS, *words)
        )

    @property
    def heights(self) -> np.ndarray:
        """(2, columns, rows) y of both sides."""
        return self.samples.now[:, 1].reshape(2, COLUMNS, ROWS)


def lips(upper: float, lower: float) -> np.ndarray:
    """(2, columns, rows, 3) two plane sides at these heights, one before the other."""
    x, z = np.meshgrid(np.arange(COLUMNS, dtype=float), -np.arange(ROWS, dtype=float), indexing="ij")
    return np.stack([np.stack([x, np.full_like(x, y), z], axis=-1) for y in (upper, lower)])


def test_sides_part_by_what_they_overlap_too_much_each_by_its_share() -> None:
    sides = Sides(lips(-0.5, 0.7))  # 1.2 mm
    assert sides.part() == 2
    # the second pass finds them at the allowed overlap, where the soft edge is a quarter of its width high
    moved = (1.2 - 0.3) + 0.1 / 4.0
    np.testing.assert_allclose(sides.heights[0], -0.5 + SHARE * moved, atol=1e-5)
    np.testing.assert_allclose(sides.heights[1], 0.7 - (1.0 - SHARE) * moved, atol=1e-5)
    np.testing.assert_allclose(sides.push, moved, atol=1e-5)
    np.testing.assert_allclose(sides.samples.now[:, [0, 2]], sides.samples.places[:, [0, 2]], atol=1e-12)


def test_sides_that_may_overlap_as_they_do_stay_and_one_pass_finds_that() -> None:
    sides = Sides(lips(-0.05, 0.1))
    assert sides.part() == 1
    np.testing.assert_allclose(sides.samples.now, sides.samples.places, atol=1e-12)
    assert not sides.push.any()


def test_no_more_passes_than_were_asked_for() -> None:
    for passes in (1, 2):
        sides = Sides(lips(-0.5, 0.7))
        sides.apart *= 0.5
        assert sides.part(passes=passes) == passes
        left = (sides.heights[1] - sides.heights[0]).mean() - 0.3
        assert left == pytest.approx(0.9 * 0.5**passes, abs=1e-5)


def test_the_same_question_gets_the_last_answer_and_another_is_solved_again() -> None:
    sides = Sides(lips(-0.5, 0.7))
    begun = sides.samples.points.copy()
    sides.part()
    answer, push = sides.samples.points.copy(), sides.push.copy()
    sides.samples.points[:] = begun
    assert sides.part() == 0
    np.testing.assert_array_equal(sides.samples.points, answer)
    np.testing.assert_array_equal(sides.push, push)
    for change in ({"axis": np.array([0.0, 1.0, 0.0])}, {"seal": 0.5}):
        sides.samples.points[:] = begun
        assert sides.part(**change) > 0  # type: ignore[arg-type]
        np.testing.assert_allclose(sides.samples.points, answer, atol=1e-6)
    sides.samples.points[:] = begun
    sides.samples.points[sides.samples.near[0], 1] += 1e-9
    assert sides.part(seal=0.5, axis=AWAY) > 0


@pytest.mark.parametrize("seal", [0.25, 0.5, 1.0])
def test_a_seal_closes_its_share_of_what_stands_open_beyond_rest(seal: float) -> None:
    sides = Sides(lips(1.0, -2.0))
    sides.opening[4][:] = 0.2  # as open as at rest
    assert sides.part(seal=seal) == 1
    closed = seal * (3.0 - 0.2)
    np.testing.assert_allclose(sides.heights[0], 1.0 - SHARE * closed, atol=1e-5)
    np.testing.assert_allclose(sides.heights[1], -2.0 + (1.0 - SHARE) * closed, atol=1e-5)
    np.testing.assert_allclose(sides.push, -closed, atol=1e-5)


@pytest.mark.parametrize("seal", [0.0, 0.5])
def test_columns_whose_ends_close_more_do_so(seal: float) -> None:
    sides = Sides(lips(1.0, -2.0))
    ends = np.array([1.0, 0.75, 0.0, 0.25, 1.0])
    sides.opening[6][:] = ends
    sides.part(seal=seal)
    closed = np.maximum(ends, seal) * 3.0
    np.testing.assert_allclose(sides.push.reshape(2, COLUMNS), -np.tile(closed, (2, 1)), atol=1e-5)


def test_sides_are_brought_together_twice_at_most() -> None:
    sides = Sides(lips(1.0, -2.0))
    sides.apart *= 0.5
    sides.part(seal=1.0)
    assert module.SEAL_PASSES == 2
    np.testing.assert_allclose(sides.heights[0] - sides.heights[1], 3.0 * 0.5**2, atol=1e-5)


@pytest.mark.parametrize(("rim", "passes"), [(0.5, 3), (0.5, 1), (-0.05, 1)])
def test_lids_are_lifted_off_the_eyeball_and_say_how_far_they_slid_and_rose(rim: float, passes: int) -> None:
    """Arcs above the middle of the eyeball, and distances from its centre, of every sample; also of lids that pass each
    other, and after one pass."""
    angles = np.array([[rim, rim + 0.05, rim + 0.1], [-rim, -rim - 0.05, -rim - 0.1]])
    x = 0.5 * (np.arange(COLUMNS) - 2.0)
    places = np.zeros((2, COLUMNS, ROWS, 3))
    depth = 12.2  # too low by 0.8
    for side in range(2):
        for k in range(COLUMNS):
            flat = np.sqrt(depth**2 - x[k] ** 2)
            places[side, k] = np.stack(
                [np.full(ROWS, x[k]), flat * np.sin(angles[side]), flat * np.cos(angles[side])], -1
            )
    sides = Sides(places, radius=RADIUS, least=1.0)
    before = sides.samples.places
    assert 1 <= sides.part(passes=passes) <= passes
    after = sides.samples.now
    np.testing.assert_allclose(np.linalg.norm(after, axis=1), RADIUS + 1.0, atol=1e-3)
    arc = [RADIUS * np.arctan2(each[:, 1], each[:, 2]) for each in (before, after)]
    rose = [np.linalg.norm(each, axis=1) for each in (before, after)]
    np.testing.assert_allclose(sides.push, np.concatenate([arc[1] - arc[0], rose[1] - rose[0]]), atol=1e-5)


def test_moves_of_samples_are_said_kind_by_kind_side_by_side() -> None:
    rng = np.random.default_rng(4)
    before, after = rng.normal(size=(2, 2, 3, 4, 3))
    push = np.zeros(2 * 2 * 3 * 4)
    module.tell_moves(before, after, push)
    np.testing.assert_array_equal(push, np.concatenate([(after - before)[..., kind].ravel() for kind in (1, 2)]))


def test_points_and_axis_and_seal_are_compared_and_kept() -> None:
    local, axis, watched = np.random.default_rng(5).normal(size=(5, 3)), np.array([0.0, 0.6, 0.8]), np.arange(4)
    found, looked = np.full((5, 3), np.nan), np.zeros(4)
    assert not module.is_known(watched, local, axis, 0.5, found, looked)
    np.testing.assert_array_equal(found[:4], local[:4])
    assert looked.tolist() == [0.0, 0.6, 0.8, 0.5]
    assert module.is_known(watched, local, axis, 0.5, found, looked)
    for k in range(4):
        for c in range(3):
            other = local.copy()
            other[k, c] += 1e-12
            assert not module.is_known(watched, other, axis, 0.5, found, looked)
            assert not module.is_known(watched, local, axis, 0.5, found, looked)
    local[4] += 1.0  # a point that nobody watches
    assert module.is_known(watched, local, axis, 0.5, found, looked)
    assert not module.is_known(watched, local, axis, 0.25, found, looked) and looked[3] == 0.25
    for c in range(3):
        turned = axis.copy()
        turned[c] += 0.1
        assert not module.is_known(watched, local, turned, 0.25, found, looked)


def test_points_near_an_opening_are_copied_from_the_eye_s_centre_and_the_moved_ones_put_back() -> None:
    points, eye, near = np.random.default_rng(6).normal(size=(9, 3)), np.array([1.0, 2.0, 3.0]), np.array([7, 2, 5])
    local, before = np.zeros((3, 3)), points.copy()
    module.gather_near(points, near, eye, local)
    np.testing.assert_array_equal(local, points[near] - eye)
    local += 1.0
    module.put_back(points, near, np.array([2, 0]), eye, local)
    wanted = before.copy()
    wanted[[5, 7]] += 1.0
    np.testing.assert_allclose(points, wanted, rtol=1e-14)
    np.testing.assert_array_equal(points[[0, 1, 2, 3, 4, 6, 8]], before[[0, 1, 2, 3, 4, 6, 8]])
