"""Trim loops as segments: crossings, corners, wanted sizes."""

from __future__ import annotations

import numpy as np
import pytest

from surface import Domain
from surface.mesh import loops
from tests.surface import shapes

CIRCLE = shapes.circle(0.0, 0.0, 1.0, n=400)


def test_crossings_lie_on_the_loop() -> None:
    segments = Domain((-2, 2, -2, 2), loops=[CIRCLE]).segments
    rng = np.random.default_rng(0)
    inner = rng.uniform(-0.6, 0.6, (200, 2))
    angle = rng.uniform(0, 2 * np.pi, 200)
    outer = 1.5 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    t = loops.crossings(segments, inner, outer)
    assert np.allclose(np.linalg.norm(inner + t[:, None] * (outer - inner), axis=1), 1, atol=1e-4)
    assert np.allclose(loops.crossings(segments, outer, inner), 1 - t, atol=1e-9)


def test_corners_are_found_and_kept_by_resampling() -> None:
    lens = shapes.eye(0.5, 0.5, 0.3, 0.15)
    sharp = loops.corners(lens, (1.0, 1.0))
    assert sharp.sum() == 2
    ring, kept = loops.resample(lens, (1.0, 1.0), 0.005)
    assert np.array_equal(ring[kept], lens[sharp])
    assert np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1).max() <= 0.005 + 1e-12
    assert not loops.corners(CIRCLE, (1.0, 1.0)).any()


def test_wanted_sizes_follow_curvature_and_gaps() -> None:
    for error in (0.01, 0.001):
        size = np.zeros(len(CIRCLE))
        loops.wanted_size(CIRCLE, np.zeros(len(CIRCLE), dtype=bool), error, 0.0, size)
        assert np.allclose(size, np.sqrt(8 * error), rtol=0.2)  # sagitta = chord^2 / 8 for radius 1
    ring, sharp = loops.resample(np.array([[0.0, 0], [1, 0], [1, 0.02], [0, 0.02]]), (1.0, 1.0), 0.01)
    size = np.zeros(len(ring))
    loops.wanted_size(ring, sharp, 0.001, 0.003, size)
    middle = np.abs(ring[:, 0] - 0.5) < 0.3
    assert size[middle].max() < 0.025
    assert size.min() >= 0.003


def test_even_odd_is_that_of_counted_crossings_at_every_height() -> None:
    """Against a loop over all segments, for places in, on and beyond the bands of v that segments are sorted into."""
    rng = np.random.default_rng(3)
    for ends in (3, 4, 9, 40):
        ring = rng.uniform(-1, 1, (ends, 2))
        segments = np.hstack([ring, np.roll(ring, -1, axis=0)])
        uv = np.vstack([rng.uniform(-1.3, 1.3, (400, 2)), np.column_stack([rng.uniform(-1, 1, ends), ring[:, 1]])])
        wanted = np.zeros(len(uv), dtype=bool)
        for u0, v0, u1, v1 in segments:
            low, high = min(v0, v1), max(v0, v1)
            meets = (uv[:, 1] >= low) & (uv[:, 1] < high)
            wanted[meets] ^= uv[meets, 0] < u0 + (uv[meets, 1] - v0) / (v1 - v0) * (u1 - u0)
        np.testing.assert_array_equal(loops.inside(segments, uv), wanted)


def test_bands_of_a_loop_list_every_segment_that_meets_them() -> None:
    rng = np.random.default_rng(7)
    segments = rng.uniform(2.0, 2.4, (31, 4))
    low, scale, start, ids = loops._by_band(segments)
    assert low == segments[:, [1, 3]].min() and len(start) == 16 and start[0] == 0 and start[-1] == len(ids)
    for band in range(15):
        bottom, top = low + band / scale, low + (band + 1) / scale
        ends = np.sort(segments[:, [1, 3]], axis=1)
        meets = np.flatnonzero((ends[:, 0] < top) & (ends[:, 1] >= bottom))
        assert ids[start[band] : start[band + 1]].tolist() == meets.tolist()
    flat = np.array([[0.0, 1.0, 2.0, 1.0]])  # no height at all
    assert [np.asarray(part).tolist() for part in loops._by_band(flat)[2:]] == [[0, 1], [0]]


def test_of_several_crossings_the_nearest_to_the_middle_counts() -> None:
    walls = np.array([[x, -1.0, x, 1.0] for x in (0.1, 0.55, 0.2, 0.9)] + [[0.0, 0.5, 1.0, 0.5]])
    a, b = np.array([[0.0, 0.0]]), np.array([[1.0, 0.0]])
    for first in range(len(walls)):  # whatever comes first, also the one that the edge is parallel to
        turned = np.roll(walls, first, axis=0)
        np.testing.assert_allclose(loops.crossings(turned, a, b), 0.55)
        np.testing.assert_allclose(loops.crossings(turned, b, a), 0.45)


def test_crossings_end_where_edge_and_segment_end() -> None:
    wall = np.array([[1.0, -1.0, 1.0, 1.0]])
    for edge, expected in (
        (((0.0, 0.0), (1.0, 0.0)), 1.0),  # it ends on the wall
        (((1.0, 0.0), (2.0, 0.0)), 0.0),  # it begins there
        (((0.0, 1.0), (4.0, 1.0)), 0.25),  # through the wall's end
        (((0.0, -1.0), (4.0, -1.0)), 0.25),
        (((0.0, 0.0), (0.9, 0.0)), 0.5),  # none: the middle
        (((1.2, 0.0), (4.0, 0.0)), 0.5),
        (((0.0, 1.1), (4.0, 1.1)), 0.5),
        (((0.0, -1.1), (4.0, -1.1)), 0.5),
        (((1.0, -0.5), (1.0, 0.5)), 0.5),  # along the wall
        (((0.0, 0.0), (1.0 - 5e-10, 0.0)), 1.0),  # as near as rounding
        (((1.0 + 5e-10, 0.0), (2.0, 0.0)), 0.0),
    ):
        a, b = np.array([edge[0]]), np.array([edge[1]])
        np.testing.assert_allclose(loops.crossings(wall, a, b), expected, atol=1e-9)
        assert 0.0 <= loops.crossings(wall, a, b)[0] <= 1.0


def test_edges_that_run_up_and_down_find_crossings_in_every_band_between_their_ends() -> None:
    ring = shapes.circle(0.0, 0.0, 1.0, n=60)
    segments = np.hstack([ring, np.roll(ring, -1, axis=0)])
    angle = np.linspace(0.01, 2 * np.pi, 47)
    way = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    t = loops.crossings(segments, 0.0 * way, 4.0 * way)
    np.testing.assert_allclose(t, 0.25, atol=1e-3)


def test_corners_turn_by_more_than_forty_degrees_in_lengths_either_way() -> None:
    def turning(degrees: float) -> np.ndarray:
        angle = np.radians(degrees)
        return np.array([[0.0, 0.0], [2.0, 0.0], [2.0 + np.cos(angle), np.sin(angle)], [1.0, 7.0 * np.sign(degrees)]])

    for degrees, expected in ((39.0, False), (41.0, True), (-39.0, False), (-41.0, True)):
        ring = turning(degrees)
        assert loops.corners(ring, (1.0, 1.0))[1] == expected
        assert loops.corners(ring / [3.0, 0.2], (3.0, 0.2))[1] == expected
        assert loops.corners(ring, (1.0, 1.0), angle=60.0).tolist()[1] is False
        assert loops.corners(ring, (1.0, 1.0), angle=20.0).tolist()[1] is True


def test_resampling_divides_segments_equally_into_as_few_pieces_as_the_step_allows() -> None:
    ring = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 0.5], [0.0, 0.5]])  # 4 x 5 in lengths
    points, sharp = loops.resample(ring, (2.0, 10.0), 1.5)
    wanted = [[0, 0], [2 / 3, 0], [4 / 3, 0], [2, 0], [2, 0.125], [2, 0.25], [2, 0.375],
              [2, 0.5], [4 / 3, 0.5], [2 / 3, 0.5], [0, 0.5], [0, 0.375], [0, 0.25], [0, 0.125]]  # fmt: skip
    np.testing.assert_allclose(points, wanted, atol=1e-12)
    assert np.flatnonzero(sharp).tolist() == [0, 3, 7, 10]
    np.testing.assert_array_equal(loops.resample(ring, (2.0, 10.0), 5.0)[0], ring)


def sizes(ring: np.ndarray, error: float, floor: float, sharp: np.ndarray | None = None) -> np.ndarray:
    out = np.full(len(ring), -1.0)
    loops.wanted_size(ring, np.zeros(len(ring), bool) if sharp is None else sharp, error, floor, out)
    return out


def test_edges_along_a_loop_are_at_most_a_quarter_of_it_and_at_least_the_floor() -> None:
    around = np.linalg.norm(CIRCLE - np.roll(CIRCLE, 1, axis=0), axis=1).sum()
    np.testing.assert_allclose(sizes(CIRCLE, 9.0, 0.0), around / 4)
    np.testing.assert_allclose(sizes(CIRCLE, 9.0, 1.7), 1.7)
    np.testing.assert_allclose(sizes(CIRCLE, 1e-3, 0.2), 0.2)
    turned = np.roll(CIRCLE[::-1], 123, axis=0)  # wherever it begins, whichever way it goes
    np.testing.assert_allclose(sizes(turned, 1e-3, 0.0), np.roll(sizes(CIRCLE, 1e-3, 0.0)[::-1], 123))


def brute_sizes(ring: np.ndarray, error: float, sharp: np.ndarray) -> np.ndarray:
    """As the docstring has it, point by point: chords over as many points on either side, until one bows too far or
    ends in a corner; no longer than the distance of any point that is half as far again along the loop."""
    k, out = len(ring), []
    step = np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1)
    for i in range(k):
        size, at = step.sum() / 4, np.roll(np.arange(k), -i)
        for w in range(1, k // 4):
            if sharp[i] or sharp[at[np.r_[1:w, 1 - w : 0]]].any():
                break
            chord = ring[at[w]] - ring[at[-w]]
            sag = abs(float(np.linalg.det([chord, ring[i] - ring[at[-w]]]))) / np.linalg.norm(chord)
            if sag > error:
                size = min(size, np.linalg.norm(chord) * np.sqrt(error / sag))
                break
        ahead = np.concatenate([[0.0], np.cumsum(step[at])[:-1]])  # of the point at each of `at`
        along, gap = np.minimum(ahead, step.sum() - ahead), np.linalg.norm(ring[at] - ring[i], axis=1)
        out.append(min([size, *gap[(along > 1.5 * gap) & (along > 0.0)]]))
    return np.array(out)


@pytest.mark.parametrize("error", [1e-3, 3e-2])
def test_sizes_are_those_of_every_chord_and_every_gap(error: float) -> None:
    rng = np.random.default_rng(12)
    angle = np.sort(rng.uniform(0, 2 * np.pi, 61))  # uneven steps
    ring = np.column_stack([np.cos(angle), 0.3 * np.sin(angle)]) * (1 + 0.1 * np.sin(5 * angle))[:, None]
    sharp = np.zeros(61, bool)
    sharp[[7, 30, 33]] = True
    np.testing.assert_allclose(sizes(ring, error, 0.0, sharp), brute_sizes(ring, error, sharp), rtol=1e-9)


def test_an_edge_bows_by_the_error_where_a_loop_bends() -> None:
    """The sagitta of a chord on a circle of radius r is chord^2 / (8 r)."""
    for radius in (0.5, 3.0):
        for error in (1e-3, 4e-3):
            found = sizes(radius * CIRCLE, error * radius, 0.0)
            np.testing.assert_allclose(found, radius * np.sqrt(8 * error), rtol=0.03)


def test_corners_bound_where_a_loop_is_looked_along() -> None:
    """Around a square the sides are straight; only what passes a corner bends."""
    square, sharp = loops.resample(np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]), (1.0, 1.0), 0.01)
    assert sharp.sum() == 4
    np.testing.assert_allclose(sizes(square, 1e-3, 0.0, sharp), 1.0, rtol=1e-9)
    smooth = sizes(square, 1e-3, 0.0)  # as if they were rounded
    assert smooth[0] < 0.1 and smooth[1:6].max() < 0.5


def test_opposite_sides_are_kept_apart_by_edges_no_longer_than_their_distance() -> None:
    slot, sharp = loops.resample(np.array([[0.0, 0], [1, 0], [1, 0.05], [0, 0.05]]), (1.0, 1.0), 0.01)
    found = sizes(slot, 1e-3, 0.0, sharp)
    middle = np.abs(slot[:, 0] - 0.5) < 0.4
    np.testing.assert_allclose(found[middle], 0.05, rtol=1e-6)
    wide, sharp = loops.resample(np.array([[0.0, 0], [1, 0], [1, 0.6], [0, 0.6]]), (1.0, 1.0), 0.01)
    found = sizes(wide, 1e-3, 0.0, sharp)
    np.testing.assert_allclose(found[np.abs(wide[:, 0] - 0.5) < 0.2], 0.6, rtol=1e-6)
    near_corner = (wide[:, 0] < 0.2) & (wide[:, 1] == 0.0) & (wide[:, 0] > 0.0)
    assert found[near_corner].min() > 0.5  # round a right angle the way along is less than 1.5 times as long
