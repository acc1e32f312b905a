"""One step along the braking curve, against the formulas it is made of."""

from __future__ import annotations

import numpy as np
import pytest

from controller.motion import braking
from controller.motion.braking import move

DT, SPEED, ACCEL, RESPONSE = 0.01, 3.0, 40.0, 0.02


def step(target: float, position: float, velocity: float) -> tuple[float, float, bool]:
    """Position, velocity and whether a limit held it back, after one step."""
    place, speed, limited = np.array([position]), np.array([velocity]), np.zeros(1, dtype=bool)
    limits = (np.array([x]) for x in (SPEED, ACCEL, RESPONSE, -10.0, 10.0))
    move(DT, np.array([target]), place, speed, limited, *limits)
    return float(place[0]), float(speed[0]), bool(limited[0])


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_it_takes_the_speed_that_the_way_left_allows(way: float) -> None:
    for error in (0.03, 0.1):  # beyond the knee at a r^2: where an even step ends, just enough is left to brake
        now = np.sqrt(2 * ACCEL * (error - 0.5 * ACCEL * RESPONSE**2)) * 0.95
        place, speed, _ = step(way * error, 0.0, way * now)
        left = error - way * place
        assert abs(speed) == pytest.approx(np.sqrt(2 * ACCEL * (left - 0.5 * ACCEL * RESPONSE**2)), abs=ACCEL * DT)
        assert (abs(speed) - now) / DT <= ACCEL * (1 + 1e-9)
        assert np.sign(speed) == way
    assert step(way * 0.004, 0.0, way * 0.2)[1] == pytest.approx(way * (0.004 - 0.001) / 0.025)  # the linear end


@pytest.mark.parametrize("dt", [0.001, 0.01, 0.03])
@pytest.mark.parametrize(("accel", "response"), [(40.0, 0.02), (3.0, 0.2)])
def test_the_way_left_after_the_step_is_just_enough_to_brake(dt: float, accel: float, response: float) -> None:
    knee = accel * response  # below this speed, speed is proportional to the distance
    for distance in np.linspace(0.0, 3 * accel * (response**2 + response * dt), 50):
        speed = braking._braking_speed(dt, distance, accel, response)
        left = distance - 0.5 * dt * speed
        needed = speed * response if speed <= knee else speed**2 / (2 * accel) + 0.5 * accel * response**2
        assert left == pytest.approx(needed, rel=1e-9, abs=1e-12)
    assert speed > knee


def test_limits_of_speed_and_acceleration_hold_it_back_and_are_told() -> None:
    assert step(5.0, 0.0, 0.0) == (pytest.approx(0.5 * ACCEL * DT**2), pytest.approx(ACCEL * DT), True)
    assert step(5.0, 0.0, SPEED)[1:] == (SPEED, True)
    assert step(-5.0, 0.0, SPEED)[1] == pytest.approx(SPEED - ACCEL * DT)
    assert step(0.001, 0.0, 0.0)[2] is False


def test_it_stops_where_the_target_lies_on_the_way() -> None:
    assert step(0.001, 0.0, 0.25) == (0.001, 0.0, False)
    place, speed, _ = step(0.001, 0.0, 2.0)  # too fast to stop there
    assert (place > 0.001, speed) == (True, pytest.approx(2.0 - ACCEL * DT))


def test_nothing_is_compiled_at_its_first_call() -> None:
    kernels = [value for value in vars(braking).values() if hasattr(value, "signatures")]
    assert len(kernels) == 2
    assert all(len(kernel.signatures) == 1 and not kernel._can_compile for kernel in kernels)


def free(target: float, velocity: float, dt: float, speed: float, accel: float, response: float) -> tuple[float, bool]:
    """Velocity after one step from 0 within wide limits, and whether one held it back."""
    place, now, limited = np.zeros(1), np.array([velocity]), np.zeros(1, dtype=bool)
    limits = (np.array([x]) for x in (speed, accel, response, -10.0, 10.0))
    move(dt, np.array([target]), place, now, limited, *limits)
    return float(now[0]), bool(limited[0])


@pytest.mark.parametrize(("beyond", "held"), [(1e-6, True), (1e-10, False), (-1e-6, False)])
def test_a_limit_holds_back_only_what_is_more_than_rounding(beyond: float, held: bool) -> None:
    dt, response = 0.01, 0.1
    target = (1.0 + beyond) * (response + dt / 2)  # the linear end: just the speed limit of 1, and a little beyond
    assert free(target, 0.0, dt, 1.0, 1e6, response) == (pytest.approx(1.0, rel=2e-6), held)


@pytest.mark.parametrize(("short", "stops"), [(1e-13, True), (-1e-4, True), (1e-6, False), (1e-9, False)])
def test_it_stops_in_one_step_only_within_its_acceleration(short: float, stops: bool) -> None:
    now, accel = 0.5, 100.0  # needs 0.5 now^2 / accel to stop, and passes 0.5 now dt in one even step
    speed, _ = free(0.5 * now**2 / accel - short, now, 0.01, 10.0, accel, 0.02)
    assert (speed == 0.0) == stops


def test_it_does_not_stop_where_the_target_is_further_than_one_even_step() -> None:
    now, dt = 0.5, 0.01
    assert free(0.5 * now * dt + 1e-6, now, dt, 10.0, 100.0, 0.02)[0] != 0.0
    assert free(0.5 * now * dt - 1e-9, now, dt, 10.0, 100.0, 0.02)[0] == 0.0


def test_the_position_stays_in_range() -> None:
    place, speed, limited = np.array([0.999, -0.999]), np.array([3.0, -3.0]), np.zeros(2, dtype=bool)
    low, high = np.array([-1.0, -1.0]), np.array([1.0, 1.0])
    limits = (np.full(2, x) for x in (SPEED, ACCEL, RESPONSE))
    move(DT, np.array([1.0, -1.0]), place, speed, limited, *limits, low, high)
    assert place.tolist() == [1.0, -1.0]
