"""drivers.boards.hobby: angles as pulses and back."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.base.bus import ServoSpec
from drivers.base.errors import DriverError
from drivers.boards.hobby import PulseScale, hobby_model, known_models


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
    assert scale.radian(0, 1295.0) == pytest.approx(math.radians(20))


@given(st.floats(-0.8, 0.8), st.sampled_from(sorted(known_models())), st.booleans())
def test_there_and_back_is_the_same_and_steps_stay_inside(angle: float, model: str, reverse: bool) -> None:
    half = hobby_model(model).rad[-1] * 0.9
    servo = spec(model, -min(half, 0.8), min(half, 0.8), reverse=reverse)
    scale, at = PulseScale([servo]), np.clip([angle], servo.min_rad, servo.max_rad)
    assert scale.radians(scale.pulses(at)) == pytest.approx(at, abs=1e-9)
    for per_us in (1, 4):
        sent = scale.radians(scale.steps(np.array([angle]), per_us) / per_us)[0]
        assert servo.min_rad - 1e-12 <= sent <= servo.max_rad + 1e-12


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
