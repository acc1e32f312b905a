"""What lies below the end of a scan's neck is placed as that end lies."""

import numpy as np

from surface.fit.transfer.detail.below_neck import neck_place, neck_share
from surface.fit.transfer.place_parts import ScaleShift
from surface.head.model.data import Neck

NECK = Neck((0.0, 0.0, 0.0), 0.0, -100.0, -20.0)
WHOLE = ScaleShift(1.1, np.array([1.0, 2.0, 3.0]))
OFF = np.array([9.0, 5.0, 12.0])


def tube(sectors: int = 24) -> np.ndarray:
    """A neck of 50 mm radius from y = 0 down to -60, and more places in front than elsewhere."""
    angle, y = np.meshgrid(2.0 * np.pi * (np.arange(sectors) + 0.5) / sectors, np.arange(-60.0, 1.0, 5.0))
    round_it = np.column_stack([50.0 * np.sin(angle.ravel()), y.ravel(), 50.0 * np.cos(angle.ravel())])
    front = round_it[round_it[:, 2] > 40.0]
    return np.concatenate([round_it, front + 0.1, front - 0.1])


def test_the_place_is_shifted_aside_and_forward_as_the_end_is_but_keeps_height_and_size() -> None:
    points = tube()
    found = np.ones(len(points), bool)
    place = neck_place(points, WHOLE.points(points) + OFF, found, NECK, WHOLE)
    assert place.scale == WHOLE.scale
    np.testing.assert_allclose(place.shift - WHOLE.shift, [9.0, 0.0, 12.0], atol=1e-9)


def test_a_neck_that_is_only_thicker_stays_in_its_place_though_more_of_it_is_seen_in_front() -> None:
    points = tube()
    thicker = WHOLE.points(points * [1.3, 1.0, 1.3])
    place = neck_place(points, thicker, np.ones(len(points), bool), NECK, WHOLE)
    np.testing.assert_allclose(place.shift, WHOLE.shift, atol=0.5)


def test_the_lowest_matches_count_and_what_lies_above_the_neck_does_not() -> None:
    points = tube()
    goals = WHOLE.points(points) + OFF * np.where(points[:, 1:2] < -40.0, 1.0, 0.0)
    place = neck_place(points, goals, points[:, 1] > -55.0, NECK, WHOLE)
    assert 4.0 < (place.shift - WHOLE.shift)[0] < 9.0
    head = np.concatenate([points, points + np.array([0.0, 80.0, 0.0])])
    far = np.concatenate([goals, WHOLE.points(points) + 500.0])
    every = neck_place(head, far, np.append(points[:, 1] > -55.0, np.ones(len(points), bool)), NECK, WHOLE)
    np.testing.assert_allclose(every.shift, place.shift, atol=1e-9)


def test_a_throat_alone_says_nothing_of_the_neck() -> None:
    points = tube()
    assert neck_place(points, WHOLE.points(points) + OFF, points[:, 2] > -10.0, NECK, WHOLE) is WHOLE


def test_the_neck_begins_gently() -> None:
    heights = np.array([-200.0, -20.0, -10.0, 0.0, 50.0])
    share = neck_share(np.column_stack([0 * heights, heights, 0 * heights]), NECK)
    np.testing.assert_allclose(share, [1.0, 1.0, 0.5, 0.0, 0.0])
