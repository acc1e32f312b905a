"""controller.base.placement: a head by default stands in the middle of the room, and points go both ways."""

from __future__ import annotations

import pytest

from controller.base.placement import Placement


def test_a_head_by_default_sees_the_room_as_it_is() -> None:
    for point in ((0.0, 0.0, 0.0), (1.0, -2.0, 3.0)):
        assert Placement().to_head(point) == point and Placement().to_room(point) == point


@pytest.mark.parametrize(
    ("yaw_deg", "seen"), [(0.0, (3.0, -5.0, 9.0)), (90.0, (-9.0, -5.0, 3.0)), (180.0, (-3.0, -5.0, -9.0))]
)
def test_a_point_is_seen_from_where_the_head_is_and_looks(yaw_deg: float, seen: tuple[float, float, float]) -> None:
    place = Placement((7.0, 20.0, -8.0), yaw_deg)
    assert place.to_head((10.0, 15.0, 1.0)) == pytest.approx(seen)
    assert place.to_room(seen) == pytest.approx((10.0, 15.0, 1.0))
