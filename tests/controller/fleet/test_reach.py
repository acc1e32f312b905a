"""controller.fleet.reach: each formula by hand, for a range from 0 to 1, 100 units/s^2, and steps of 10 ms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from controller.fleet.reach import _closing, _ends, _greatest, _means, pursue

ACCEL, TOP, T = 100.0, 4.0, 0.01
NEAR = math.sqrt(2.0 * ACCEL * 0.001)  # speed from which it can stop within a thousandth


@pytest.mark.parametrize(
    ("t", "room", "greatest"),
    [
        (T, 0.5, 10.0 - 0.5),  # from 10 units/s it stops within 0.5; half a step before, it was slower
        (T, 0.005, 0.5),  # braking takes the whole step
        (T, 0.002, 0.2),  # it arrives within the step
        (0.1, 0.5, 5.0),
        (T, 0.0, 0.0),
        (T, -0.3, 0.0),
    ],
)
def test_the_greatest_speed_leaves_room_to_stop(t: float, room: float, greatest: float) -> None:
    assert _greatest(t, room, ACCEL) == pytest.approx(greatest)


@pytest.mark.parametrize(
    ("t", "distance", "speed"),
    [
        (T, 0.03, -1.0),  # the last part takes 30 ms, whatever is left
        (T, -0.03, 1.0),
        (T, 0.054, -1.8),
        (T, 0.06, -math.sqrt(2 * 60.0 * (0.06 - 0.027))),  # braking at six tenths of the acceleration
        (T, 0.9, -0.6 * TOP),
        (T, -0.9, 0.6 * TOP),
        (0.1, 0.2, -2.0),  # no faster than a step
        (T, 0.0, 0.0),
    ],
)
def test_a_distance_is_closed_more_slowly_the_smaller_it_is(t: float, distance: float, speed: float) -> None:
    assert _closing(t, distance, TOP, ACCEL) == pytest.approx(speed)


@pytest.mark.parametrize(
    ("t", "shown", "ends", "means"),
    [
        (T, 0.5, (0.0, 0.0), (-0.5, 0.5)),
        (T, 0.5, (-1.0, 2.0), (-1.5, 2.5)),
        (T, 0.5, (3.8, 3.8), (3.3, TOP)),
        (T, 0.5, (-3.8, -3.8), (-TOP, -3.3)),
        (T, 0.999, (0.0, 0.0), (-0.5, 0.1)),
        (T, 0.001, (0.0, 0.0), (-0.1, 0.5)),
        (0.1, 0.5, (0.0, 0.0), (-TOP, TOP)),
        (0.2, 0.5, (0.0, 0.0), (-TOP / 2, TOP / 2)),  # after a pause no farther than in a tenth of a second
    ],
)
def test_a_step_changes_the_speed_within_the_acceleration_and_stays_in_range(
    t: float, shown: float, ends: tuple[float, float], means: tuple[float, float]
) -> None:
    assert _means(t, shown, *ends, TOP, ACCEL, 0.0, 1.0) == pytest.approx(means)


@pytest.mark.parametrize(
    ("mean", "shown", "ends"),
    [
        (1.0, 0.5, (0.5, 1.5)),
        (-1.0, 0.5, (-1.5, -0.5)),
        (3.8, 0.5, (3.3, TOP)),
        (-3.8, 0.5, (-TOP, -3.3)),
        (0.2, 0.999, (-0.3, NEAR)),
        (-0.2, 0.001, (-NEAR, 0.3)),
        (1.0, 0.999, (NEAR, NEAR)),  # never the slower one above the faster
        (0.0, 1.001, (-0.5, 0.0)),
        (0.0, -0.001, (0.0, 0.5)),
    ],
)
def test_a_step_ends_with_a_speed_about_its_mean_from_which_it_can_stop(
    mean: float, shown: float, ends: tuple[float, float]
) -> None:
    assert _ends(T, mean, shown, TOP, ACCEL, 0.0, 1.0) == pytest.approx(ends)


@pytest.mark.parametrize(
    ("face", "before", "ends", "passed_s", "stay", "met", "shown", "meets", "after"),
    [
        (0.503, 0.5, (0.0, 0.0), T, True, False, 0.503, True, (-0.2, 0.8)),
        (0.503, 0.5, (0.0, 0.0), T, False, True, 0.503, False, (-0.2, 0.8)),
        (0.506, 0.5, (0.0, 0.0), T, True, True, 0.505, False, (0.0, 1.0)),  # beyond the acceleration
        (0.494, 0.5, (0.0, 0.0), T, True, True, 0.495, False, (-1.0, 0.0)),
        (1.0, 0.5, (0.0, 0.0), T, True, False, 0.505, False, (0.0, 1.0)),
        (0.508, 0.5, (0.5, 0.5), T, True, False, 0.508, True, (0.3, 1.3)),  # a face that moves as fast is met
        (0.508, 0.5, (0.5, 0.5), 0.1, True, True, 0.508, True, (0.3, 1.3)),  # so is one that was met before
        (0.508, 0.5, (0.5, 0.5), 0.1, True, False, 0.5 + T * (0.08 + 0.0072 / 0.03), False, (-0.18, 0.82)),
        (math.nan, 0.5, (0.0, 0.0), T, True, True, 0.5, False, (-0.5, 0.5)),
        (math.inf, 0.5, (0.0, 0.0), T, True, True, 0.5, False, (-0.5, 0.5)),
    ],
)
def test_a_face_is_pursued_until_its_values_are_met(
    face: float, before: float, ends: tuple[float, float], passed_s: float, stay: bool, met: bool, shown: float,
    meets: bool, after: tuple[float, float],
) -> None:  # fmt: skip
    motion, flags = np.array([[0.5], [before], [ends[0]], [ends[1]]]), np.array([met])
    limits = np.array([[TOP], [ACCEL], [0.0], [1.0]])
    pursue(T, passed_s, stay, np.array([face]), flags, motion, limits)
    assert flags[0] == meets
    assert motion[:, 0] == pytest.approx([shown, face if math.isfinite(face) else 0.5, *after])
