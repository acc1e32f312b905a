"""drivers.boards.hobby: angles as pulses and back."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.base.bus import ServoSpec
from drivers.base.errors import DriverError
from drivers.boards.hobby import PulseScale, ValueScale, hobby_model, known_models


def spec(model: str = "rc-180", low: float = -0.8, high: float = 0.8, **options: object) -> ServoSpec:
    return ServoSpec(3, "jaw", model, low, high, 5.0, 50.0, **options)


def us(servo: ServoSpec, *degrees: float) -> list[float]:
    scale = PulseScale([servo])
    return [round(float(scale.pulses(np.radians([deg]))[0]), 6) for deg in degrees]


def test_a_model_says_which_pulse_makes_which_angle() -> None:
    assert us(spec("rc-180"), -45, 0, 45) == [1000, 1500, 2000]
    assert us(spec("RC_90"), -45, 0, 45) == [1000, 1500, 2000]
    assert us(spec("rc-270"), -45, 0, 45) == pytest.approx([1166.667, 1500, 1833.333], abs=1e-3)


def test_reverse_and_zero_turn_and_shift_it() -> None:
    assert us(spec(reverse=True), 0, 45) == [1500, 1000]
    assert us(spec(zero_rad=math.radians(18)), 0, 9) == [1700, 1800]
    assert us(spec(zero_rad=math.radians(18), reverse=True), 0, 9) == [1700, 1600]


def test_measured_pulses_stand_in_place_of_the_model() -> None:
    points = tuple((math.radians(deg), pulse) for deg, pulse in ((-40, 1900.0), (0, 1510.0), (40, 1080.0)))
    assert us(spec(pulse_us=points), -40, -20, 0, 20, 40) == [1900, 1705, 1510, 1295, 1080]
    scale = PulseScale([spec(pulse_us=points)])
    assert scale.radians(np.array([1295.0])) == pytest.approx(math.radians(20))


@given(st.floats(-0.8, 0.8), st.sampled_from(sorted(known_models())), st.booleans())
def test_there_and_back_is_the_same_and_steps_stay_inside(angle: float, model: str, reverse: bool) -> None:
    half = hobby_model(model).rad[-1] * 0.9
    servo = spec(model, -min(half, 0.8), min(half, 0.8), reverse=reverse)
    scale, at = PulseScale([servo]), np.clip([angle], servo.min_rad, servo.max_rad)
    assert scale.radians(scale.pulses(at)) == pytest.approx(at, abs=1e-9)
    for per_us in (1, 4):
        sent = scale.radians(scale.steps(np.array([angle]), per_us) / per_us)[0]
        assert servo.min_rad - 1e-12 <= sent <= servo.max_rad + 1e-12


def test_limits_between_two_steps_of_the_wire_are_refused() -> None:
    """Any goal would pass one of them: 10 or 11 degrees, where 10.2 to 10.8 are allowed."""
    narrow = spec(low=math.radians(10.2), high=math.radians(10.8))
    with pytest.raises(DriverError, match=r"'jaw' \(id 3\): no value on the wire lies inside its limits, 10.2 to 10.8"):
        ValueScale([narrow], ["deg"], [0])
    assert ValueScale([narrow], ["deg"], [1]).values(np.zeros(1)) == pytest.approx(10.2)
    whole = spec(low=math.radians(10), high=math.radians(10.8))
    assert ValueScale([whole], ["deg"], [0]).values(np.ones(1)) == pytest.approx(10)
    between = spec(low=math.radians(45.01), high=math.radians(45.02))  # 2000.11 to 2000.22 us
    with pytest.raises(DriverError, match=r"no step of 0\.25 us lies inside"):
        PulseScale([between]).check_steps([between], 4)
    PulseScale([between]).check_steps([between], 5)


def test_no_pulse_is_no_angle() -> None:
    assert np.isnan(PulseScale([spec()]).radians(np.zeros(1))).all()


@pytest.mark.parametrize(
    ("servo", "message", "hint"),
    [
        (spec("rc-18"), "no hobby servo model 'rc-18'", "rc-180"),
        (spec("xl330-m288"), "no hobby servo model", "rc-180"),
        (spec(pulse_us=((0.0, 1500.0),)), "rise, or fall", "two or more points"),
        (spec(pulse_us=((0.0, 1500.0), (0.1, 1600.0), (0.2, 1550.0))), "rise, or fall", "two or more"),
        (spec(low=-3.0, high=3.0, pulse_us=((0.0, 1500.0), (1.0, 2500.0))), "outside 64 to 4080", "limit_deg"),
    ],
)
def test_what_cannot_be_is_told(servo: ServoSpec, message: str, hint: str) -> None:
    with pytest.raises(DriverError, match=message) as caught:
        PulseScale([servo])
    assert hint in caught.value.hint


def values(field: str, decimals: int, servo: ServoSpec, *degrees: float) -> list[float]:
    scale = ValueScale([servo], [field], [decimals])
    return [round(float(scale.values(np.radians([deg]))[0]), 9) for deg in degrees]


def test_every_value_of_an_angle() -> None:
    servo = spec(low=math.radians(-60), high=math.radians(40))
    assert values("deg", 1, servo, -60, 0, 12.34, 40) == [-60.0, 0.0, 12.3, 40.0]
    assert values("deg10", 0, servo, -12.34, 40) == [-123.0, 400.0]
    assert values("angle", 0, servo, -60, 0, 40) == [30.0, 90.0, 130.0]
    assert values("unit", 4, servo, -60, -10, 40) == [0.0, 0.5, 1.0]
    assert values("us", 0, servo, -45, 0, 36) == [1000.0, 1500.0, 1900.0]
    assert values("parameter", 4, servo, -45, 9, 40) == [-0.5, 0.1, 0.4444]


def test_reverse_and_zero_turn_and_shift_values() -> None:
    servo = spec(low=math.radians(-60), high=math.radians(40), reverse=True, zero_rad=math.radians(18))
    assert values("deg", 1, servo, 0, 10) == [18.0, 8.0]
    assert values("angle", 0, servo, 0, 10) == [108.0, 98.0]
    assert values("unit", 4, servo, -60, 40) == [0.0, 1.0]  # limits of the channel, whichever way it turns
    assert values("us", 0, servo, 0, 9) == [1700.0, 1600.0]


def test_no_value_passes_a_limit_by_its_rounding() -> None:
    servo = spec(low=math.radians(-10.06), high=math.radians(10.06))
    assert values("deg", 1, servo, -20, -10.06, 10.06, 20) == [-10.0, -10.0, 10.0, 10.0]
    assert values("deg", 0, servo, -20, 20) == [-10.0, 10.0]
    whole = spec(low=math.radians(-10), high=math.radians(10))
    assert values("deg", 0, whole, -10, 10) == [-10.0, 10.0]  # a limit that is a whole step is reached


def test_servos_of_one_scale_have_their_own_values() -> None:
    servos = [spec(), spec("rc-270", reverse=True), spec("any", zero_rad=0.1)]
    scale = ValueScale(servos, ["us", "us", "deg"], [1, 0, 2])
    angles = np.array([0.3, -0.2, 0.1])
    sent = scale.values(angles)
    np.testing.assert_allclose(sent, [1691.0, 1500 + round(0.2 * 1000 / math.radians(135)), 11.46], atol=1e-9)
    np.testing.assert_allclose(scale.radians(sent), angles, atol=1e-3)


def test_no_pulse_is_no_angle_of_a_scale() -> None:
    scale = ValueScale([spec(), spec()], ["us", "deg"], [0, 0])
    assert np.isnan(scale.radians(np.zeros(2))).tolist() == [True, False]


def test_calibrated_pulses_are_sent_as_such() -> None:
    points = ((0.0, 1510.0), (0.5, 1700.0), (0.8, 2000.0))
    scale = ValueScale([spec(low=0.0, pulse_us=points)], ["us"], [0])
    assert scale.values(np.array([0.65])).tolist() == [1850.0]
    assert scale.radians(np.array([1605.0])) == pytest.approx([0.25])


def test_limits_and_slopes_of_pulses() -> None:
    points = ((-0.8, 2000.0), (0.0, 1510.0), (0.8, 1430.0))
    scale = PulseScale([spec(pulse_us=points), spec()])
    np.testing.assert_allclose(scale.low_us, [1430.0, 1500 - 0.8 * 2000 / math.pi])
    np.testing.assert_allclose(scale.high_us, [2000.0, 1500 + 0.8 * 2000 / math.pi])
    np.testing.assert_allclose(scale.us_per_rad, [490 / 0.8, 2000 / math.pi])
    assert scale.steps(np.array([0.0, 2.0]), 1).tolist() == [1510, 2009]  # the limit, 2009.3, rounded inwards
    assert scale.steps(np.array([0.0, -2.0]), 4).tolist() == [6040, 3963]  # 990.7 us


@pytest.mark.parametrize(("end", "good"), [(64.0, True), (63.5, False), (4080.0, True), (4080.5, False)])
def test_pulses_of_every_board_are_the_widest_limits(end: float, good: bool) -> None:
    servo = spec(low=0.0, high=1.0, pulse_us=((0.0, 1500.0), (1.0, end)))
    if good:
        PulseScale([servo])
    else:
        with pytest.raises(DriverError, match="outside 64 to 4080"):
            PulseScale([servo])


def test_curves_with_different_numbers_of_points_go_on_straight_beyond_their_ends() -> None:
    bent = ((-0.8, 1000.0), (-0.4, 1200.0), (0.0, 1500.0), (0.3, 1900.0), (0.8, 2000.0))
    scale = PulseScale([spec(), spec(pulse_us=bent), spec(reverse=True)])
    slope = 2000 / math.pi
    for angle in (-0.79, -0.2, 0.15, 0.79, 2.0):  # the shorter ones have only two points
        pulses = scale.pulses(np.full(3, angle))
        assert pulses[[0, 2]] == pytest.approx([1500 + slope * angle, 1500 - slope * angle])
    assert scale.pulses(np.full(3, 0.9))[1] == pytest.approx(2020.0)
    assert scale.pulses(np.full(3, -0.9))[1] == pytest.approx(950.0)
    assert scale.radians(np.array([1500.0, 2020.0, 0.0]))[:2] == pytest.approx([0.0, 0.9])


def test_an_unknown_model_is_told_with_the_three_nearest_or_all() -> None:
    for name, names in (("rc-100", ["rc-120", "rc-180", "rc-90"]), ("mg996", ["rc-120", "rc-180", "rc-270", "rc-60"])):
        with pytest.raises(DriverError, match=f"there is no hobby servo model '{name}'") as caught:
            hobby_model(name)
        told = caught.value.hint.removeprefix("use one of ").split(", ")
        assert len(told) == (3 if name == "rc-100" else len(known_models()))
        assert set(names) <= set(told)
    assert hobby_model(" RC_180 ") == known_models()["rc-180"]
