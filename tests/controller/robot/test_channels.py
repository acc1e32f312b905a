"""Channels: mixes, calibrated points and limits as flat arrays."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.base.parameters import PARAMETERS
from controller.robot.channels import ChannelTable, build_table, servo_specs
from controller.robot.settings import Calibration, ChannelSettings


def channel(**changes: object) -> ChannelSettings:
    settings: dict[str, object] = {
        "name": "lip",
        "bus": "b",
        "id": 7,
        "model": "xl330-m288",
        "mix": {"mouthSmileLeft": 1.0, "mouthFrownLeft": -1.0},
        "map": Calibration(at=[-1, 0, 1], deg=[-20, 5, 40]),
        "limit_deg": (-25, 30),
        "max_speed_deg_s": 300,
        "max_accel_deg_s2": 3000,
    }
    return ChannelSettings.model_validate(settings | changes)


def angle(table: ChannelTable, **values: float) -> tuple[float, int]:
    vector = PARAMETERS.neutral()
    for name, value in values.items():
        vector[PARAMETERS.index(name)] = value
    angles, held = table.angles(vector)
    return float(np.degrees(angles[0])), held


def test_goes_through_the_calibrated_points_and_stops_at_limits() -> None:
    table = build_table([channel()], PARAMETERS)
    assert angle(table) == (pytest.approx(5.0), 0)
    assert angle(table, mouthFrownLeft=1.0) == (pytest.approx(-20.0), 0)
    assert angle(table, mouthFrownLeft=0.5) == (pytest.approx(-7.5), 0)
    assert angle(table, mouthSmileLeft=0.5) == (pytest.approx(22.5), 0)
    assert angle(table, mouthSmileLeft=1.0) == (pytest.approx(30.0), 1)


def test_channels_with_different_numbers_of_points_share_one_table() -> None:
    two = channel(name="jaw", id=1, mix={"jawOpen": 1.0}, map=Calibration(at=[0, 1], deg=[10, -10]))
    table = build_table([channel(), two], PARAMETERS)
    values = PARAMETERS.neutral()
    values[PARAMETERS.index("jawOpen")] = 0.25
    assert np.degrees(table.angles(values)[0]) == pytest.approx([5.0, 5.0])


@given(st.floats(-3, 3), st.lists(st.floats(-1, 1), min_size=4, max_size=4, unique=True))
def test_equals_interpolation_between_the_points(mixed: float, at: list[float]) -> None:
    at = sorted(at)
    if min(np.diff(at)) < 1e-6:
        return
    deg = [-20.0, 10.0, -5.0, 30.0]
    one = channel(mix={"headYaw": 1.0}, map=Calibration(at=at, deg=deg), limit_deg=(-90, 90))
    values = PARAMETERS.neutral()
    values[PARAMETERS.index("headYaw")] = mixed
    angles, _ = build_table([one], PARAMETERS).angles(values)
    assert np.degrees(angles[0]) == pytest.approx(np.interp(mixed, at, deg), abs=1e-6)


def test_motion_keeps_speed_and_acceleration_for_hostile_targets() -> None:
    table = build_table([channel()], PARAMETERS)
    period = 0.02
    limiter = table.limiter(period)
    rng = np.random.default_rng(1)
    before = out = np.zeros(1)
    speed = 0.0
    for _ in range(5000):
        target = rng.choice([np.nan, np.inf, -1e9, 1e9, float(rng.normal())])
        out = limiter.step(period, np.array([target]), np.zeros(1)).copy()
        new_speed = float(out[0] - before[0]) / period
        assert table.low_rad[0] <= out[0] <= table.high_rad[0]
        assert abs(new_speed) <= table.max_speed_rad_s[0] * (1 + 1e-9)
        assert abs(new_speed - speed) / period <= table.max_accel_rad_s2[0] * (1 + 1e-6)
        before, speed = out, new_speed


def test_specs_are_in_radians() -> None:
    spec = servo_specs([channel(reverse=True, zero_deg=90)])[0]
    assert (spec.id, spec.model, spec.reverse) == (7, "xl330-m288", True)
    assert spec.min_rad == pytest.approx(np.radians(-25))
    assert spec.zero_rad == pytest.approx(np.pi / 2)
    assert spec.max_accel_rad_s2 == pytest.approx(np.radians(3000))
