"""Fidgets, smiles and swallows."""

from __future__ import annotations

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.layers.idle.draws import generator, mean_of
from controller.layers.idle.gestures import Gestures, Pose, draw_pose
from controller.layers.idle.settings import FidgetSettings, GestureSettings, IdleSettings, PoseSettings


def path_of(
    settings: GestureSettings, seconds: float, *, step_s: float = 0.1, wanted: bool = True, amount: float = 1.0
) -> np.ndarray:
    gestures, rows = Gestures(P, settings, generator(1, "x")), []
    gestures.begin(0.0)
    for t in np.arange(0.0, seconds, step_s):
        row = P.neutral()
        gestures.advance(t, wanted=wanted)
        gestures.add(row, t, amount)
        rows.append(row)
    return np.array(rows)


def test_swallows_come_as_often_as_published(settings: IdleSettings) -> None:
    path = path_of(settings.swallow, 7200.0, step_s=0.25)
    begun = np.count_nonzero(np.diff((path.any(axis=1)).astype(int)) > 0)
    assert begun / 120 == pytest.approx(0.98, abs=0.12)  # a minute: Bulmer et al. 2021
    moved = {P.names[i] for i in np.flatnonzero(path.any(axis=0))}
    assert moved == {"mouthPressLeft", "mouthPressRight", "mouthShrugLower", "mouthRollLower", "headPitch"}


def test_fidgets_are_small_combinations_that_never_jump(settings: IdleSettings) -> None:
    path = path_of(settings.fidget, 900.0, step_s=0.05)
    assert path.min() >= 0.0 and 0.15 < path.max() <= 0.28
    assert np.abs(np.diff(path, axis=0)).max() < 0.06
    moved = np.count_nonzero(path > 0.005, axis=1)
    assert np.mean(moved[moved > 0] >= 2) > 0.95 and np.median(moved[moved > 0]) >= 3
    weights = {frozenset(np.flatnonzero(row).tolist()) for row in path if row.any()}
    assert len(weights) == len(settings.fidget.poses)  # every pose was seen


def test_less_life_has_smaller_gestures_at_the_same_times(settings: IdleSettings) -> None:
    whole, part = (path_of(settings.smile, 120.0, amount=amount) for amount in (1.0, 0.25))
    np.testing.assert_allclose(part, 0.25 * whole, atol=1e-12)
    assert whole.any() and not path_of(settings.smile, 120.0, wanted=False).any()


def test_a_pose_of_one_side_shows_on_either_and_less_on_the_other() -> None:
    pose = Pose.of(P, PoseSettings(weights={"browOuterUp": 0.4, "jawOpen": 0.2}, side="either"))
    left, right, jaw = P.indices(["browOuterUpLeft", "browOuterUpRight", "jawOpen"])
    numbers, drawn = generator(1, "x"), []
    for _ in range(100):
        values = pose.draw(numbers)
        assert 0.6 * 0.2 <= values[jaw] <= 0.2 and min(values[left], values[right]) < 0.4 * max(
            values[left], values[right]
        )
        drawn.append(values[left] > values[right])
    assert 30 < sum(drawn) < 70
    both = Pose.of(P, PoseSettings(weights={"browOuterUp": 0.4}))
    ratios = [values[left] / values[right] for values in (both.draw(numbers) for _ in range(100))]
    assert 0.84 < min(ratios) < 1.0 < max(ratios) < 1.18


def test_single_parameters_can_be_listed_and_no_pose_is_no_movement(settings: IdleSettings) -> None:
    own = {**settings.fidget.model_dump(), "poses": {}, "parameters": ["jawOpen"], "amount": 0.1}
    path = path_of(FidgetSettings.model_validate(own), 60.0)
    assert {P.names[i] for i in np.flatnonzero(path.any(axis=0))} == {"jawOpen"} and path.max() <= 0.1
    assert not path_of(FidgetSettings.model_validate({**own, "parameters": []}), 60.0).any()
    assert draw_pose([], generator(1, "x")) is None


def test_gestures_follow_each_other_at_their_interval(settings: IdleSettings) -> None:
    path = path_of(settings.fidget, 3600.0, step_s=0.2)
    begun = np.count_nonzero(np.diff(path.any(axis=1).astype(int)) > 0)
    length_s = mean_of(settings.fidget.interval_s) + settings.fidget.rise_s + 0.7 + settings.fidget.fall_s
    assert 3600.0 / begun == pytest.approx(length_s, rel=0.1)


def test_the_first_gesture_comes_after_an_interval_too(settings: IdleSettings) -> None:
    first_s = []
    for seed in range(400):
        gestures = Gestures(P, settings.fidget, generator(seed, "x"))
        gestures.begin(10.0)
        first_s.append(gestures.next_s - 10.0)
    assert min(first_s) > 0.0 and np.mean(first_s) == pytest.approx(mean_of(settings.fidget.interval_s), rel=0.15)
