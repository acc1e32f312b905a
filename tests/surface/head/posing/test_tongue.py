"""surface.head.posing.tongue: what the tongue lies on; measured by crossing triangles, not by the contact's samples."""

from __future__ import annotations

import itertools
import sys
from pathlib import Path

import numpy as np
import pytest

from surface.head import Head
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
    tongue, tips = head.part("tongue"), []
    for amount in np.linspace(0.0, 1.0, 101):
        head.pose(head.values({"tongueOut": amount}))
        tips.append(tongue.vertices.astype(float).copy())
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
    tongue = head.part("tongue")
    assert isinstance(tongue, SkinPart)
    head.pose(head.values({"mouthSmileLeft": 0.2}))
    before = tongue.rig.version
    head.pose(head.values({"mouthSmileLeft": 0.9}))
    assert tongue.rig.version == before
    head.pose(head.values({"tongueOut": 0.9, "jawOpen": 0.5}))
    put_out = tongue.rig.points.copy()
    head.pose(head.values({"tongueOut": 0.9, "jawOpen": 0.5, "mouthShrugLower": 1.0}))
    assert np.abs(tongue.rig.points - put_out).max() > 0.1


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
