"""Spikes of known height on sheets; rings against scipy's tree, heights against plain arithmetic."""

from __future__ import annotations

import time
import tracemalloc

import numpy as np
import pytest
from scipy.spatial import cKDTree

from surface.check import spikes
from surface.check.borders import find_borders
from surface.check.places import Places
from surface.check.subject import Subject
from tests.surface.check import plain


def cone(x: float, y: float, height: float, radius: float = 4.0, **more: object):
    """A sheet with a cone on it, vertices 2 mm apart."""
    points, triangles = plain.sheet((-60, 60), (-90, 60), 2.0)
    away = np.hypot(points[:, 0] - x, points[:, 1] - y)
    points[:, 2] += height * np.clip(1.0 - away / radius, 0.0, None)
    return plain.part("face", points, triangles, **more)  # type: ignore[arg-type]


def texts(*parts, **options: object) -> list[str]:
    head: Subject = plain.subject(*parts, **options)
    return [f.text for f in spikes.spikes(head, Places(head, None), find_borders(head))]


def around(points: np.ndarray, i: int) -> np.ndarray:
    """The points between 4.5 and 7.8 mm from point i, 0.75 and 1.3 times 6 mm, by scipy's tree."""
    near = np.array(sorted(cKDTree(points).query_ball_point(points[i], 7.8 + 1e-9)))
    return near[np.linalg.norm(points[near] - points[i], axis=1) >= 4.5 - 1e-12]


@pytest.mark.parametrize("listed", [True, False])
@pytest.mark.parametrize("count", [40, 90])
def test_a_height_is_the_least_along_the_mean_way_from_the_ring(
    count: int, listed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(1)
    points, values = rng.uniform(-9.0, 9.0, (90, 3)), rng.normal(size=(90, 3))
    points[:3] = [[0, 0, 0], [4.5, 0, 0], [0, 7.8, 0]]  # which still belong to the ring
    points[-1] = [900.0, 0.0, 0.0]  # nothing is round it
    values[:9] *= 9.0
    if not listed:
        monkeypatch.setattr(spikes, "MAX_LISTED", 0)
    out = spikes.Rings(points, count, 6.0).heights(values)
    assert len(out) == count and {1, 2} <= set(around(points, 0))
    for i in range(count):
        ring = values[around(points, i)]
        if not len(ring):
            assert out[i] == 0.0 and i == 89
            continue
        way = (values[i] - ring).sum(axis=0)
        assert out[i] == pytest.approx(((values[i] - ring) @ (way / np.linalg.norm(way))).min())
    assert (out[:9] > 5.0).any()


def test_rings_as_lists_and_searched_for_give_the_very_same_heights(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(5)
    points, values = rng.uniform(-20.0, 20.0, (600, 3)), rng.normal(size=(600, 3))
    listed = spikes.Rings(points, 500, 6.0)
    monkeypatch.setattr(spikes, "MAX_LISTED", 10)
    searched = spikes.Rings(points, 500, 6.0)
    for enough in (0.0, 1.0):
        np.testing.assert_array_equal(searched.heights(values, enough), listed.heights(values, enough))


def test_rings_take_memory_for_their_points_however_far_apart_and_however_dense_these_are() -> None:
    """One far away once took a grid of all space between, 400,000 cubes along each axis; 12,000 in one place are near
    each other, 24 million pairs."""
    rng = np.random.default_rng(6)
    dense = rng.normal(size=(12_000, 3))
    dense *= rng.uniform(4.0, 5.0, (12_000, 1)) / np.linalg.norm(dense, axis=1)[:, None]
    points = np.vstack([dense, [[3e6, 3e6, 3e6]]])
    tracemalloc.start()
    try:
        rings = spikes.Rings(points, 12_001, 6.0)
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(rings.heights(points)) == 12_001
    assert most < 100e6


def test_heights_of_what_the_ring_is_too_near_to_are_left_out_and_the_others_are_the_same() -> None:
    rng = np.random.default_rng(3)
    points = rng.uniform(-12.0, 12.0, (200, 3))
    rings = spikes.Rings(points, 100, 6.0)
    values = rng.normal(size=(200, 3)) * np.where(rng.random(200) < 0.2, 9.0, 0.7)[:, None]
    every = rings.heights(values)
    for enough in (0.5, 2.0, 4.0):
        some = rings.heights(values, enough)
        assert (every > enough).any()
        np.testing.assert_array_equal(some[every >= enough], every[every >= enough])
        assert set(some[every < enough]) <= {0.0, *every[every < enough]} and (some[every < enough] == 0.0).any()


def test_nothing_sticks_out_where_the_ring_lies_round_it_evenly() -> None:
    values = 5.0 * np.array([[0.0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
    assert spikes.Rings(values, 1, 6.0).heights(values).tolist() == [0.0]


def test_samples_are_all_vertices_in_use_and_places_on_large_triangles() -> None:
    face = plain.part("face", np.array([[9.0, 9, 9], [0, 0, 0], [8, 0, 0], [0, 8, 0]]), [[1, 2, 3]])
    small = plain.part("small", np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), [[0, 1, 2]])
    others = [plain.part("e", small.rest, small.triangles, material="eye"),
              plain.part("s", small.rest, small.triangles, follows="skull")]  # fmt: skip
    head = plain.subject(face, *others, small)
    samples = spikes.find_samples(head, 3.0)
    assert samples.vertices == 6 and samples.part.tolist() == [0, 0, 0, 3, 3, 3] + [0] * 12
    at = samples.at(head.rest)
    np.testing.assert_allclose(at[:6], [[0, 0, 0], [8, 0, 0], [0, 8, 0], [0, 0, 0], [1, 0, 0], [0, 1, 0]])
    grid = {(2 * i, 2 * j) for i in range(5) for j in range(5) if i + j <= 4} - {(0, 0), (8, 0), (0, 8)}
    assert {(round(x), round(y)) for x, y, _ in at[6:]} == grid  # the hypotenuse takes four steps of 3 mm
    np.testing.assert_allclose(samples.share.sum(axis=1), 1.0)


def test_an_edge_is_filled_by_as_many_steps_as_it_needs_and_no_more_than_forty() -> None:
    at = np.array([[0.0, 0, 0], [6, 0, 0], [0, 3, 0], [900, 0, 0]])
    assert len(spikes._sample_triangles(at, np.array([[0, 1, 2]]), 6.8)[0]) == 0  # its longest edge is 6.7 mm
    assert len(spikes._sample_triangles(at, np.array([[0, 1, 2]]), 6.0)[0]) == 3
    assert len(spikes._sample_triangles(at, np.array([[0, 3, 2]]), 1.0)[0]) == 41 * 42 // 2 - 3


def test_the_corner_of_a_border_is_no_spike() -> None:
    points = np.array([[0.0, 0, 0], [9, 0, 0], [20, 0, 0]])
    high = spikes.drop_rims(points, np.array([[2.0, 0, 0], [50, 0, 0]]), np.array([5.0, 4.0, 1.0]), 3.0, 2.5)
    assert high.tolist() == [0.0, 4.0, 0.0]
    assert spikes.drop_rims(points, np.zeros((0, 3)), np.array([5.0, 4.0, 1.0]), 3.0, 2.5).tolist() == [
        5.0,
        4.0,
        0.0,
    ]


@pytest.mark.parametrize(("height", "named"), [(3.0, False), (3.6, True), (20.0, True)])
def test_a_spike_is_steeper_than_half_of_the_rings_radius(height: float, named: bool) -> None:
    found = texts(cone(40.0, 40.0, height))  # 0.55 of 6 mm are 3.3 mm
    assert len(found) == named
    for text in found:  # a ring about a high cone meets its foot
        assert text.startswith("part 'face' sticks out by ") and text.endswith(" mm or more: left brow")
        assert 3.4 < float(text.split()[5]) <= height + 0.05


def test_a_spike_that_nobody_sees_is_none_and_hair_hides_nothing() -> None:
    """As the end of the bag that lines the mouth of a head without shapes."""
    points, triangles, normals = plain.ball((0.0, 0.0, 0.0), 300.0)
    hull = plain.part("hull", points, triangles, normals=normals)
    hair = plain.part("hull", points, triangles, normals=normals, material="hair")
    spike = cone(30, 30, 12.0)
    assert len(texts(spike)) == len(texts(spike, hair)) == 1
    assert texts(spike, hull) == []


def test_a_spike_on_a_head_of_twice_the_size_is_twice_as_high() -> None:
    points, triangles = plain.sheet((-120, 120), (-180, 120), 4.0)
    for height, named in ((6.0, 0), (7.2, 1)):
        at = points.copy()
        at[:, 2] += height * (np.hypot(at[:, 0] - 80, at[:, 1] - 80) < 1.0)
        assert len(texts(plain.part("face", at, triangles), eyes=2.0 * plain.EYES)) == named


def test_what_has_its_like_on_the_other_side_is_no_spike() -> None:
    both, left = cone(40.0, 40.0, 9.0), cone(40.0, 40.0, 9.0)
    mirror = np.hypot(both.rest[:, 0] + 40.0, both.rest[:, 1] - 40.0) < 1.0
    both = plain.part("face", both.rest + np.outer(mirror, [0.0, 0.0, 6.0]), both.triangles)
    assert texts(both) == [] and len(texts(left)) == 1
    weak = plain.part("face", left.rest + np.outer(mirror, [0.0, 0.0, 1.0]), left.triangles)
    assert len(texts(weak)) == 1  # what is less than 0.6 times as steep as a spike is no like
    beside = np.hypot(left.rest[:, 0] + 40.0, left.rest[:, 1] - 26.0) < 1.0  # 14 mm off its mirror image
    assert len(texts(plain.part("face", left.rest + np.outer(beside, [0.0, 0.0, 6.0]), left.triangles))) == 1


@pytest.mark.parametrize(("x", "y", "z", "usual"), [
    (0.0, -30.0, 14.0, True), (21.0, -30.0, 14.0, True), (24.0, -30.0, 14.0, False), (0.0, 18.0, 14.0, True),
    (0.0, 20.0, 14.0, False), (0.0, -60.0, 14.0, True), (0.0, -62.0, 14.0, False), (0.0, -30.0, 11.0, False),
])  # fmt: skip
def test_a_nose_may_stick_out(x: float, y: float, z: float, usual: bool) -> None:
    """0.35 eye distances (22.3 mm) to each side, 0.3 (19.1 mm) up, and 0.9 of the way to the lips (60.7 mm) down."""
    head = plain.subject(cone(0.0, -30.0, 9.0))
    found = spikes._may_stick_out(head, np.array([[x, y, z]]), np.array([5.0]), Places(head, None))
    assert found.tolist() == [usual]


def test_a_pose_that_throws_a_point_out_is_named() -> None:
    face = cone(0.0, 0.0, 0.0)

    def thrown(x: float, y: float, mm: float) -> np.ndarray:
        return np.outer(np.hypot(face.rest[:, 0] - x, face.rest[:, 1] - y) < 1.0, [0.0, 0.0, mm])

    def found(**moves: np.ndarray) -> list[str]:
        return texts(plain.part("face", face.rest, face.triangles, moves=moves))

    assert found(cheekPuff=thrown(40, -40, 2.9), headYaw=thrown(40, -40, 50.0)) == []  # half of 6 mm
    assert found(cheekPuff=thrown(40, -40, 3.1)) == [
        "with cheekPuff = 1 part 'face' sticks out by 3.1 mm or more: left cheek"
    ]
    worst = found(cheekPuff=thrown(40, -40, 5.0), jawOpen=thrown(-40, -40, 8.0), mouthLeft=thrown(-40, 40, 7.0))
    assert worst == ["with jawOpen = 1 part 'face' sticks out by 8.0 mm or more: right cheek"]


def test_corners_that_move_alike_may_move_further() -> None:
    face = cone(0.0, 0.0, 0.0)

    def found(left: float, right: float) -> list[str]:
        moves = np.zeros_like(face.rest)
        for x, mm in ((20.0, left), (-20.0, right)):
            moves[np.hypot(face.rest[:, 0] - x, face.rest[:, 1] + 70.0) < 1.0, 0] = mm
        return texts(plain.part("face", face.rest, face.triangles, moves={"mouthPucker": moves}))

    assert found(-4.5, 4.5) == []  # half of 6 mm is for one side alone, 0.8 for both
    assert len(found(-4.5, 0.0)) == len(found(-4.5, 1.0)) == 1
    assert len(found(-5.0, 5.0)) == 1


def test_a_head_without_skin_has_no_spikes() -> None:
    assert texts(plain.eyeball(0)) == []


@pytest.mark.parametrize("spread", [30.0, 300.0])
def test_mirror_images_are_those_that_every_pair_of_points_shows(spread: float) -> None:
    rng = np.random.default_rng(4)
    points = rng.uniform(-spread, spread, (700, 3)) * [1.0, 0.3, 0.1]
    height = np.where(rng.random(700) < 0.8, 1.0, 0.0)
    subject = plain.subject(plain.part("face", *plain.sheet((-60, 60), (-90, 60), 10.0)))
    places = Places(subject, None)
    far, middle = spikes.MIRROR_MM * subject.scale, places.centre[0]
    expected = np.zeros(700, bool)
    for i in np.flatnonzero(height):
        place = points[i] * [-1.0, 1.0, 1.0] + [2.0 * middle, 0.0, 0.0]
        near = np.linalg.norm(points - place, axis=1) < far
        expected[i] = (near & (height > 0.0) & (np.abs(points[:, 0] - points[i, 0]) > far)).any()
    np.testing.assert_array_equal(spikes._has_mirror_image(subject, points, height, places), expected)
    assert expected.any() and not expected[height > 0.0].all()


def test_mirror_images_are_searched_for_only_where_they_can_be() -> None:
    """All pairs of 200,000 points took minutes."""
    points = np.random.default_rng(4).uniform(-900.0, 900.0, (200_000, 3))
    subject = plain.subject(plain.part("face", *plain.sheet((-60, 60), (-90, 60), 10.0)))
    spikes._has_mirror_image(subject, points[:10], np.ones(10), Places(subject, None))  # compiled before it is timed
    started = time.process_time()
    spikes._has_mirror_image(subject, points, np.ones(len(points)), Places(subject, None))
    assert time.process_time() - started < 20.0
