"""Channels: mixes, calibrated points and limits as flat arrays."""

from __future__ import annotations

from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.base.parameters import PARAMETERS
from controller.robot.channels import ChannelTable, PiecewiseLinear, Terms, build_table, servo_specs
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


def test_a_trim_is_added_to_every_angle_before_the_limits() -> None:
    table = build_table([channel(trim_deg=4.0)], PARAMETERS)
    assert angle(table) == (pytest.approx(9.0), 0)
    assert angle(table, mouthFrownLeft=1.0) == (pytest.approx(-16.0), 0)
    assert angle(table, mouthSmileLeft=0.8) == (pytest.approx(30.0), 1)
    assert angle(build_table([channel(trim_deg=-4.0)], PARAMETERS)) == (pytest.approx(1.0), 0)
    assert np.degrees(table.neutral_rad) == pytest.approx([9.0])


def test_the_table_holds_every_limit_in_radians() -> None:
    settings = {"max_jerk_deg_s3": 50_000, "dead_band_deg": 0.5, "slack_deg": 2.0}
    table = build_table([channel(**settings), channel(name="free")], PARAMETERS)
    assert table.names == ("lip", "free")
    assert np.degrees(table.low_rad) == pytest.approx([-25, -25])
    assert np.degrees(table.high_rad) == pytest.approx([30, 30])
    assert np.degrees(table.max_speed_rad_s) == pytest.approx([300, 300])
    assert np.degrees(table.max_accel_rad_s2) == pytest.approx([3000, 3000])
    assert np.degrees(table.max_jerk_rad_s3) == pytest.approx([50_000, np.inf])
    assert np.degrees(table.dead_band_rad) == pytest.approx([0.5, 0.0])
    assert np.degrees(table.slack_rad) == pytest.approx([2.0, 0.0])


def test_the_slope_of_a_mix_is_the_weights_and_the_mean_slopes_of_terms() -> None:
    mix = {
        "jawOpen": 0.5,
        "headYaw": {"at": [-1, 0, 1], "gives": [0, 0, 3]},
        "mouthFunnel": {"by": 2, "in": [0.2, 0.7]},
    }
    plain = channel(name="plain", mix={"jawOpen": -1.0})
    linear = build_table([channel(mix=mix), plain], PARAMETERS).linear
    assert linear.shape == (2, len(PARAMETERS))
    found = {PARAMETERS.names[i]: linear[0, i] for i in np.flatnonzero(linear[0])}
    assert found == pytest.approx({"jawOpen": 0.5, "headYaw": 1.5, "mouthFunnel": 2.0})
    assert linear[1, PARAMETERS.index("jawOpen")] == -1.0 and np.count_nonzero(linear[1]) == 1


def test_weights_of_a_channel_that_takes_the_least_are_terms() -> None:
    table = build_table(
        [channel(join="min", mix={"jawOpen": 1.0, "mouthFunnel": 1.0}), channel(name="sum")], PARAMETERS
    )
    assert not table.mix[0].any() and table.terms is not None
    assert table.terms.target.tolist() == [0] and table.terms.channel.tolist() == [0, 0]
    assert build_table([channel()], PARAMETERS).terms is None


def test_functions_with_different_numbers_of_pieces_are_constant_outside() -> None:
    curves = PiecewiseLinear.through(
        [(np.array([0.0, 1.0, 3.0]), np.array([2.0, 4.0, 0.0])), (np.array([-1.0, 1.0]), np.array([5.0, -5.0]))]
    )
    for x, wanted in ((-9.0, (2.0, 5.0)), (0.5, (3.0, -2.5)), (2.0, (2.0, -5.0)), (9.0, (0.0, -5.0))):
        assert curves(np.array([x, x])) == pytest.approx(wanted)


def test_specs_carry_what_the_driver_needs() -> None:
    pulse = {"deg": [-25, 30], "us": [1000, 2000]}
    one, two = servo_specs([channel(pulse=pulse, wire_name="lip_l"), channel(name="b", id=8)], np.array([0.1, -0.2]))
    assert (one.name, one.wire_name, two.name, two.wire_name) == ("lip", "lip_l", "b", "")
    assert one.pulse_us == ((pytest.approx(np.radians(-25)), 1000), (pytest.approx(np.radians(30)), 2000))
    assert two.pulse_us == () and (one.rest_rad, two.rest_rad) == (0.1, -0.2)
    assert one.max_rad == pytest.approx(np.radians(30)) and one.max_speed_rad_s == pytest.approx(np.radians(300))
    assert servo_specs([channel()])[0].rest_rad == 0.0 and servo_specs([channel()])[0].reverse is False


def test_records_cannot_be_changed() -> None:
    for record in (PiecewiseLinear, Terms, ChannelTable):
        with pytest.raises(FrozenInstanceError):
            object.__new__(record).anything = 1
