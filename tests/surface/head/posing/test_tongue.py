"""surface.head.posing.tongue: what the tongue lies on; measured by crossing triangles, not by the contact's samples."""

from __future__ import annotations

import itertools
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from surface.head import Head
from surface.head.posing import tongue
from surface.head.posing.part import SkinPart
from surface.head.posing.tongue import find_rise, gather_below, go_aside, sort_by_depth

ROOT = Path(__file__).parents[4]
sys.path.insert(0, str(ROOT / "benchmarks"))
from head_pairs import TongueCrossings  # noqa: E402


@pytest.fixture(scope="module")
def head() -> Head:
    return Head.load(ROOT / "configs" / "heads" / "ict")


@pytest.fixture(scope="module")
def crossings(head: Head) -> TongueCrossings:
    return TongueCrossings(head)


@pytest.mark.slow
@pytest.mark.parametrize(
    "pose",
    [*({"tongueOut": amount} for amount in (0.2, 0.4, 0.6, 0.8, 1.0)), {"tongueOut": 0.5, "mouthRollLower": 0.8},
     {"tongueOut": 1.0, "mouthShrugLower": 1.0}, {"tongueOut": 1.0, "mouthPucker": 1.0},
     {"tongueOut": 1.0, "mouthRight": 1.0}, {"tongueOut": 1.0, "mouthLeft": 1.0}, {"tongueOut": 0.5, "mouthRight": 1.0},
     {"tongueOut": 0.15, "mouthRight": 1.0}, {"tongueOut": 0.25, "mouthLeft": 1.0},
     {"mouthRollLower": 1.0, "mouthLowerDownLeft": 1.0}, {"mouthRollLower": 1.0, "mouthFrownRight": 1.0},
     {"mouthRollLower": 1.0, "cheekSquintLeft": 1.0}],
)  # fmt: skip
def test_the_tongue_pierces_neither_lips_nor_teeth(
    head: Head, crossings: TongueCrossings, pose: dict[str, float]
) -> None:
    head.pose(head.values(pose))
    assert max(crossings.depths().values()) < 0.5


@pytest.mark.slow
def test_the_tongue_comes_out_without_a_jump(head: Head) -> None:
    part, tips = head.part("tongue"), []
    for amount in np.linspace(0.0, 1.0, 101):
        head.pose(head.values({"tongueOut": amount}))
        tips.append(part.vertices.astype(float).copy())
    assert max(np.linalg.norm(b - a, axis=1).max() for a, b in itertools.pairwise(tips)) < 2.0


def test_a_station_rises_over_what_is_below_it_and_less_over_what_is_beside() -> None:
    under, rise = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [20.0, 0.0, 0.0]]), np.zeros(3)
    most = find_rise(under, np.array([[0.0, 2.0, 0.0]]), 5.0, 0.5, 0.4, False, rise)
    np.testing.assert_allclose(rise, [2.5, 2.5 * (1.0 - 0.64) ** 2, 0.0])
    assert most == 2.5


def test_only_what_is_near_lifts_a_station() -> None:
    rng = np.random.default_rng(2)
    under, below = rng.uniform(-10, 10, (40, 3)), rng.uniform(-10, 10, (300, 3))
    below, rise = below[np.argsort(below[:, 2])], np.zeros(40)
    find_rise(under, below, 3.0, 0.5, 0.4, False, rise)
    need = below[:, 1] + 0.5 - under[:, None, 1]
    near = np.clip(need + 0.4, 0.0, 0.8)
    need = np.where(need > 0.4, need, near * near / 1.6)
    square = ((under[:, None, [0, 2]] - below[:, [0, 2]]) ** 2).sum(axis=2) / 9.0
    np.testing.assert_allclose(rise, (need * np.maximum(1.0 - square, 0.0) ** 2).max(axis=1), atol=1e-12)


def test_a_tongue_in_the_mouth_is_not_computed_again_where_lips_move(head: Head) -> None:
    part = head.part("tongue")
    assert isinstance(part, SkinPart)
    head.pose(head.values({"mouthSmileLeft": 0.2}))
    before = part.rig.version
    head.pose(head.values({"mouthSmileLeft": 0.9}))
    assert part.rig.version == before
    head.pose(head.values({"tongueOut": 0.9, "jawOpen": 0.5}))
    put_out = part.rig.points.copy()
    head.pose(head.values({"tongueOut": 0.9, "jawOpen": 0.5, "mouthShrugLower": 1.0}))
    assert np.abs(part.rig.points - put_out).max() > 0.1


def test_points_are_sorted_by_depth_whatever_order_is_given() -> None:
    rng = np.random.default_rng(3)
    at, order, out = rng.normal(size=(50, 3)), rng.permutation(50), np.zeros((50, 3))
    sort_by_depth(at, order, out)
    np.testing.assert_array_equal(out, at[np.argsort(at[:, 2])])
    sort_by_depth(at[::-1].copy(), order, out)  # an order that is wrong by far
    np.testing.assert_array_equal(out, at[np.argsort(at[:, 2])])


def test_what_lies_below_is_the_lip_and_the_teeth_where_the_jaw_takes_them() -> None:
    rng = np.random.default_rng(4)
    lip, lower, linear, shift = (rng.normal(size=shape) for shape in ((4, 3), (5, 3), (3, 3), (3,)))
    out = np.zeros((9, 3))
    gather_below(lip, lower, linear, shift, out)
    np.testing.assert_allclose(out, np.concatenate([lip, lower @ linear.T + shift]), atol=1e-14)


def test_the_tip_goes_aside_with_the_lip() -> None:
    rng = np.random.default_rng(5)
    points, lip, sideways = rng.normal(size=(30, 3)), rng.normal(size=(7, 3)) + 4.0, rng.uniform(size=30)
    want = points.copy()
    want[:, 0] += 0.4 * (lip[:, 0].mean() - sideways @ points[:, 0] / sideways.sum()) * sideways
    go_aside(lip, sideways, 0.4, points)
    np.testing.assert_allclose(points, want, atol=1e-13)


def test_each_cross_section_lifts_by_its_greatest_rise_and_fades_along_the_tongue() -> None:
    rise = np.array([0.0, 2.0, 1.0, -1.0, 0.0, -2.0, 3.0, 0.0, 0.0])  # three stations in each of three sections
    fade = np.array([[1.0, 0.5, 0.0, 0.2], [1.0, 1.0, 1.0, 1.0], [0.0, 0.5, 1.0, 0.1]])
    part, lift, points = np.array([1.0, 0.5, 1.0, 0.0]), np.full(4, 99.0), np.ones((4, 3))
    tongue.lift_sections(rise, fade, part, 0.5, lift, points)
    np.testing.assert_allclose(lift, [2.0, 1.5, 3.0, 0.4])
    np.testing.assert_allclose(points, [[1, 2.0, 1], [1, 1.375, 1], [1, 2.5, 1], [1, 1, 1]])


@pytest.mark.parametrize(("near", "rises"), [(4.99, True), (5.0, False), (-4.99, True), (-5.0, False)])
def test_a_sample_lifts_nothing_from_5_mm_away_on(near: float, rises: bool) -> None:
    for axis in (0, 2):
        below = np.zeros((1, 3))
        below[0, axis], below[0, 1] = near, 1e6
        assert (tongue.rise_of(0.0, 0.0, 0.0, below, 5.0, 0.4) > 0.0) == rises


@pytest.mark.parametrize(
    ("need", "rise"), [(-0.41, 0.0), (-0.4, 0.0), (0.0, 0.1), (0.2, 0.225), (0.4, 0.4), (0.5, 0.5)]
)
def test_lifting_begins_softly(need: float, rise: float) -> None:
    """Within the soft distance on either side the rise is a parabola, which goes over into what is needed."""
    assert tongue.rise_of(0.0, 1.0, 0.0, np.array([[0.0, 1.0 + need, 0.0]]), 5.0, 0.4) == pytest.approx(rise)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_tongue_is_pressed_until_its_stations_are_0_6_mm_clear(sign: float) -> None:
    """One control point under one station: it clears what it lies on, or, turned over, what lies above it."""
    start, ids, weights = np.array([0, 2]), np.array([0, 1]), np.array([0.75, 0.25])
    against = np.array([[0.0, 0.5, 0.0]])
    points = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    tongue.press(start, ids, weights, against, np.ones((1, 2)), np.ones(2), sign, 1.0, points)
    assert sign * points[0, 1] == pytest.approx(1.1) and points[0, 1] == points[1, 1]
    assert not points[:, [0, 2]].any()
    part = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    tongue.press(start, ids, weights, against, np.ones((1, 2)), np.array([1.0, 0.0]), sign, 0.5, part)
    rises, at = 0.0, 0.0
    for _ in range(3):  # three times at most, while more than a tenth of a millimetre is missing
        need = 0.5 - (at - 0.6)
        rise = need if need > 0.4 else (need + 0.4) ** 2 / 1.6
        if rise < 0.1:
            break
        rises += 0.5 * rise
        at = 0.75 * rises
    assert sign * part[0, 1] == pytest.approx(rises) and part[1, 1] == 0.0


def test_stations_are_weighted_sums_of_control_points() -> None:
    points = np.array([[1.0, 2, 3], [5, 7, 9], [-4, 0, 8]])
    start, ids, weights, out = np.array([0, 2, 3]), np.array([0, 2, 1]), np.array([0.5, 0.25, 2.0]), np.zeros((2, 3))
    tongue.place_stations(start, ids, weights, -1.0, points, out)
    np.testing.assert_allclose(out, [[-0.5, -1.0, 3.5], [10.0, -14.0, 18.0]])


@pytest.mark.parametrize(
    ("x", "eased"), [(-9.0, 0.0), (0.02, 0.0), (0.16, 0.5), (0.09, 0.15625), (0.3, 1.0), (2.0, 1.0)]
)
def test_the_correction_sets_in_smoothly_between_two_amounts(x: float, eased: float) -> None:
    assert tongue._ease(x, 0.02, 0.3) == pytest.approx(eased)
    assert tongue.PUT_OUT == (0.02, 0.3) and tongue.BEYOND == (0.3, 0.5)


def test_a_slice_is_2_5_mm_to_either_side_and_holds_the_nearest_sample() -> None:
    at = np.array([[0.0, 0, z] for z in (-2.6, -2.5, 0.0, 2.5, 2.6, 9.0)])
    assert tongue._slice(at, 0.0).tolist() == [False, True, True, True, False, False]
    assert tongue._slice(at, 20.0).tolist() == [False] * 5 + [True]


def flat_tongue() -> tuple[np.ndarray, np.ndarray]:
    """Places and samples of a tongue of 20 mm by 50 mm, 6 mm thick, which is narrower towards its tip at z = 50."""
    x, z = (a.ravel() for a in np.meshgrid(np.linspace(-1, 1, 21), np.linspace(0, 50, 51)))
    wide = x * (10.0 - 0.1 * z)
    at = np.concatenate([np.column_stack([wide, np.full(len(x), y), z]) for y in (1.0, 7.0)])
    return np.column_stack([at[:, 0] + 100.0 * at[:, 1], at[:, 2]]), at


@pytest.mark.parametrize(("sign", "y"), [(1.0, 7.0), (-1.0, 1.0)])
def test_stations_stand_across_the_tongue_on_the_side_that_is_meant(sign: float, y: float) -> None:
    places, at = flat_tongue()
    found = tongue._stations(places, at, np.array([40.0, 10.0]), sign)
    half = [10.0 - 0.1 * z for z in (37.5 + 0.5, 7.5 + 0.5)]  # the widest of each slice
    wanted = [[share * wide + 100.0 * y, z] for z, wide in zip((40.0, 10.0), half, strict=True)
              for share in (-0.9, -0.6, -0.3, 0.0, 0.3, 0.6, 0.9)]  # fmt: skip
    assert found.shape == (14, 2)
    np.testing.assert_allclose(found[:, 0], np.array(wanted)[:, 0], atol=0.5)  # samples are 0.6 to 1 mm apart
    np.testing.assert_allclose(found[:, 1], np.array(wanted)[:, 1], atol=1.0)


def test_the_thickness_is_measured_slice_by_slice() -> None:
    _, at = flat_tongue()
    at[:, 1] *= 1.0 + at[:, 2] / 50.0
    low, high = tongue._thickness(at, np.array([-5.0, 10.0, 25.0, 47.5, 60.0]))
    np.testing.assert_allclose(high, 7.0 * (1 + np.array([2.0, 12.0, 27.0, 49.5, 49.5]) / 50), atol=0.15)
    np.testing.assert_allclose(low, 1.0 * (1 + np.array([0.0, 8.0, 23.0, 45.5, 45.5]) / 50), atol=0.03)


def test_of_teeth_the_edge_is_kept_in_columns_of_2_mm(monkeypatch: pytest.MonkeyPatch) -> None:
    at = np.array(
        [[0.1, 1.0, 0.1], [1.9, 3.0, 1.9], [2.1, 2.0, 0.5], [-0.1, 5.0, 0.1], [0.5, -4.0, 2.1], [1.0, 2.0, 1.0]]
    )
    monkeypatch.setattr(tongue, "make_surface", lambda part: None)
    monkeypatch.setattr(tongue, "_samples", lambda part, surface: (at[:, :2], at))
    highest = tongue._edge(None, 1.0)  # type: ignore[arg-type]
    lowest = tongue._edge(None, -1.0)  # type: ignore[arg-type]
    assert sorted(highest.tolist()) == sorted(at[[1, 2, 3, 4]].tolist())
    assert sorted(lowest.tolist()) == sorted(at[[0, 2, 3, 4]].tolist())
    assert highest.flags.c_contiguous
    parts = [SimpleNamespace(follows=f, material=m) for f, m in (("jaw", "teeth"), ("jaw", "gums"), ("skull", "teeth"))]
    head = SimpleNamespace(parts=parts)
    assert len(tongue._edges(head, "jaw", 1.0)) == 4  # type: ignore[arg-type]
    assert tongue._edges(SimpleNamespace(parts=[]), "jaw", 1.0).shape == (0, 3)  # type: ignore[arg-type]
    turned = tongue._sort_by_depth(at, -1.0)
    np.testing.assert_array_equal(turned, at[np.argsort(at[:, 2])] * [1, -1, 1])


@pytest.mark.parametrize(
    ("count", "length", "is_one"), [(50, 5.1, True), (49, 5.1, False), (50, 5.0, False), (50, -5.1, True)]
)
def test_a_tongue_has_50_samples_and_is_longer_than_5_mm(
    monkeypatch: pytest.MonkeyPatch, count: int, length: float, is_one: bool
) -> None:
    at = np.zeros((count, 3))
    at[-1, 2] = length
    made: list[object] = []
    monkeypatch.setattr(tongue, "make_surface", lambda part: "surface")
    monkeypatch.setattr(tongue, "_samples", lambda part, surface: (at[:, :2], at))
    monkeypatch.setattr(tongue, "TongueRest", lambda *given: made.append(given) or "made")
    found = tongue.tongue_rest("part", "head")  # type: ignore[arg-type]
    assert found == ("made" if is_one else None) and len(made) == is_one


def test_the_correction_of_the_shipped_tongue_reaches_from_its_tip_to_its_root(head: Head) -> None:
    part = next(p for p in head.data.parts if p.name == "tongue")
    rest = tongue.tongue_rest(part, head.data)
    assert rest is not None
    surface = tongue.make_surface(part)
    at = tongue._samples(part, surface)[1]
    length = min(55.0, 0.8 * np.ptp(at[:, 2]))
    along = at[:, 2].max() - np.linspace(1.0, length, 18)
    z = part.points[:, 2]
    away = np.abs(z - along[:, None])
    away[0, z > along[0]] = 0.0
    t = np.clip(away / 16.0, 0, 1)
    np.testing.assert_allclose(rest._fade, 1 - t * t * (3 - 2 * t))
    t = np.clip((z - along[0] + 0.7 * length) / (0.7 * length), 0, 1)
    np.testing.assert_allclose(rest._sideways, t * t * (3 - 2 * t))
    assert rest._thick.min() == 0.0 and rest._thick.max() == 1.0
    low, high = tongue._thickness(at, z)
    np.testing.assert_allclose(rest._thick, np.clip((part.points[:, 1] - low) / (high - low), 0, 1))
    assert [len(start) - 1 for start, _, _ in rest._sides] == [18 * 7] * 2
    points = part.points
    under, upper = (
        np.array([(w[s:e, None] * points[i[s:e]]).sum(axis=0) for s, e in itertools.pairwise(start)])
        for start, i, w in rest._sides
    )
    middle = np.interp(under[:, 2], np.sort(z), (0.5 * (low + high))[np.argsort(z)])
    assert (under[:, 1] < middle + 1.0).mean() > 0.95 and (upper[:, 1] > middle - 1.0).mean() > 0.95
    assert (np.diff(rest._upper[:, 2]) >= 0).all() and len(rest._upper) and len(rest._lower)


def test_places_all_over_a_part_are_a_grid_of_56(head: Head) -> None:
    part = next(p for p in head.data.parts if p.name == "tongue")
    grid = tongue._grid(part)
    domain = tongue.domain_of(part)
    u, v = np.linspace(*domain.rect[:2], 56), np.linspace(*domain.rect[2:], 56)
    whole = np.array([[a, b] for b in v for a in u])
    np.testing.assert_allclose(grid, whole[domain.inside(whole)])
    places, at = tongue._samples(part, tongue.make_surface(part))
    assert np.isfinite(at).all() and len(places) == len(at) <= len(grid)
