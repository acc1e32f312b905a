"""Motion limits, envelopes and easing."""

from __future__ import annotations

import math
from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.base.parameters import PARAMETERS as P
from controller.motion.motion import Envelope, MotionLimiter, minimum_jerk

TIGHT = 1 + 1e-9


def hostile_targets(seed: int, steps: int, share: float) -> np.ndarray:
    """(steps, 59): random values, range ends, values far outside, NaN and infinities, changing at random."""
    random = np.random.default_rng(seed)
    target = np.zeros(59)
    rows = np.empty((steps, 59))
    for row in rows:
        kind = random.integers(0, 5, 59)
        fresh = np.choose(kind, [random.uniform(P.low, P.high), P.low, P.high, random.normal(0, 50, 59),
                                 random.choice([math.nan, math.inf, -math.inf], 59)])  # fmt: skip
        target = np.where(random.random(59) < share, fresh, target)
        row[:] = target
    return rows


@settings(max_examples=9, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from([0.02, 0.2, 0.9]), st.sampled_from([0.002, 0.01, 0.02]))
def test_no_limit_is_ever_exceeded(seed: int, share: float, dt: float) -> None:
    limiter = MotionLimiter.of(P)
    targets = hostile_targets(seed, 600, share)
    path = np.zeros((602, 59))  # two rows at rest first
    for i, target in enumerate(targets):
        limiter.step(dt, target, path[i + 2])
    speed = np.diff(path, axis=0) / dt
    assert np.all(path >= P.low) and np.all(path <= P.high)
    assert np.all(np.abs(speed) <= P.max_speed * TIGHT)
    push = np.diff(speed, axis=0) / dt
    assert np.all(np.abs(push) <= P.max_acceleration * TIGHT + 1e-9)
    assert np.all(np.abs(np.diff(push, axis=0)) / dt <= P.max_jerk * TIGHT + 1e-6)


def test_a_late_step_keeps_the_limit_of_jerk_on_its_way() -> None:
    """Steps of several periods are divided: what comes out is what steps of one period would have given."""
    long, short = MotionLimiter.of(P), MotionLimiter.of(P)
    out, each = P.neutral(), P.neutral()
    for steps in (1, 3, 2, 5, 1, 1, 4):
        long.step(steps * 0.01, P.high, out)
        for _ in range(steps):
            short.step(0.01, P.high, each)
        np.testing.assert_allclose(out, each, atol=1e-12)


def test_where_it_would_come_to_rest() -> None:
    limiter = MotionLimiter.of(P)
    out = P.neutral()
    for _ in range(4):
        limiter.step(0.01, P.high, out)
    stopping_position = limiter.stopping_position(0.01)
    path = np.array([limiter.step(0.01, P.low, out).copy() for _ in range(200)])
    turned = path.max(axis=0)
    assert np.all(turned <= np.minimum(stopping_position, P.high) + 1e-9)
    moving = stopping_position < 0.9 * P.high
    assert moving.any() and np.all(turned[moving] > 0.6 * stopping_position[moving])


@pytest.mark.slow
def test_limits_hold_when_steps_differ_in_length() -> None:
    random = np.random.default_rng(3)
    limiter = MotionLimiter.of(P)
    out, speed, place = P.neutral(), P.neutral(), P.neutral()
    for target in hostile_targets(5, 1000, 0.1):
        dt = random.uniform(0.0005, 0.06)
        limiter.step(dt, target, out)
        assert np.all(out >= P.low) and np.all(out <= P.high)
        assert np.all(np.abs(limiter.velocity) <= P.max_speed * TIGHT)
        assert np.all(np.abs(limiter.velocity - speed) <= P.max_acceleration * dt * TIGHT)
        assert np.all(np.abs(out - place) <= P.max_speed * dt * TIGHT + 1e-12) or limiter.limited.any()
        speed, place = limiter.velocity.copy(), out.copy()


def test_a_step_arrives_without_overshoot_and_stays() -> None:
    limiter = MotionLimiter.of(P)
    goal = np.where(P.low < 0, -0.6, 0.7)
    path = np.array([limiter.step(0.01, goal, P.neutral()).copy() for _ in range(400)])
    assert np.all(np.abs(path) <= np.abs(goal) + 1e-12)
    assert np.all(np.diff(np.abs(path), axis=0) >= -1e-12)  # never turns back on its way
    np.testing.assert_allclose(path[-1], goal, atol=1e-6)


def test_a_turn_on_the_way_stays_in_range() -> None:
    limiter = MotionLimiter.of(P)
    out = P.neutral()
    for _ in range(5):
        limiter.step(0.01, P.high, out)
    reached = out.copy()
    path = np.array([limiter.step(0.01, P.low, out).copy() for _ in range(300)])
    assert path.max() <= 1.0 and np.all(path.max(axis=0) >= reached)
    np.testing.assert_allclose(path[-1], P.low, atol=1e-4)


def test_a_blink_closes_in_time_and_a_head_takes_its_time() -> None:
    limiter = MotionLimiter.of(P)
    path = np.array([limiter.step(0.01, P.high, P.neutral()).copy() for _ in range(100)])
    closed = np.argmax(path > 0.9, axis=0) * 10
    assert closed[P.index("eyeBlinkLeft")] <= 80
    assert 150 <= closed[P.index("headYaw")] <= 600


def test_a_long_pause_does_not_leap() -> None:
    limiter = MotionLimiter.of(P)
    out = P.neutral()
    limiter.step(0.01, P.high, out)
    before = out.copy()
    limiter.step(30.0, P.high, out)
    assert np.all(out - before <= P.max_speed * 0.1 * TIGHT)


def test_no_time_no_motion_and_nan_keeps_the_target() -> None:
    limiter = MotionLimiter.of(P)
    out = P.neutral()
    assert not limiter.step(0.0, P.high, out).any()
    for _ in range(300):
        limiter.step(0.01, P.high, out)
    np.testing.assert_allclose(limiter.step(0.01, np.full(59, math.nan), out), P.high, atol=1e-3)


def test_reset_puts_it_at_rest() -> None:
    limiter = MotionLimiter.of(P)
    for _ in range(3):
        limiter.step(0.01, P.high, P.neutral())
    limiter.reset(np.full(59, 0.5))
    assert not limiter.velocity.any()
    np.testing.assert_array_equal(limiter.step(0.01, np.full(59, 0.5), P.neutral()), np.full(59, 0.5))


@pytest.mark.parametrize("name", ["max_speed", "max_acceleration", "max_jerk", "response_s", "low"])
def test_wrong_limits_are_named(name: str) -> None:
    one = np.ones(3)
    given_: dict[str, np.ndarray] = {
        "max_speed": one, "max_acceleration": one, "low": 0 * one, "high": one, "response_s": one,
        "max_jerk": one,
    }  # fmt: skip
    given_[name] = np.array([0.5, 2.0, 0.5]) if name == "low" else np.array([1.0, 0.0, 1.0])
    with pytest.raises(ValueError, match=rf"{name}\[1\]"):
        MotionLimiter(**given_)  # type: ignore[arg-type]


def test_minimum_jerk() -> None:
    t = np.linspace(0, 1, 1001)
    x = np.array([minimum_jerk(v) for v in t])
    assert x[0] == 0 and x[-1] == 1 and x[500] == pytest.approx(0.5)
    assert np.all(np.diff(x) > 0)
    assert np.diff(x).max() / 0.001 == pytest.approx(1.875, abs=1e-3)  # peak speed of the curve
    assert minimum_jerk(-1) == 0 and minimum_jerk(7) == 1


def test_envelope() -> None:
    envelope = Envelope(start_s=10.0, onset_s=0.4, hold_s=1.0, offset_s=0.6)
    assert [envelope.level(t) for t in (9.0, 10.0, 10.2, 10.4, 11.0, 11.4, 11.7, 12.0, 13.0)] == pytest.approx(
        [0, 0, 0.5, 1, 1, 1, 0.5, 0, 0]
    )
    assert envelope.end_s == pytest.approx(12.0)
    sudden = Envelope(0.0, 0.0, 1.0, 0.0)
    assert sudden.level(0.5) == 1 and sudden.level(1.5) == 0


def one(speed: float, accel: float, **more: float) -> MotionLimiter:
    """A limiter of one value from -10 to 10."""
    return MotionLimiter(*(np.array([x]) for x in (speed, accel, -10.0, 10.0)), **more)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_rest_is_a_step_at_the_present_speed_and_then_the_braking_distance(sign: float) -> None:
    limiter, out, dt, accel = one(3.0, 20.0), np.zeros(1), 0.01, 20.0
    for _ in range(12):
        limiter.step(dt, np.array([9.0 * sign]), out)
    speed = float(limiter.velocity[0])
    assert abs(speed) == pytest.approx(2.4)
    place, small = float(out[0]) + speed * dt, 1e-6
    while speed * sign > 0.0:
        place += speed * small
        speed -= sign * accel * small
    assert limiter.stopping_position(dt)[0] == pytest.approx(place, abs=1e-5)


def test_at_rest_it_would_rest_where_it_is() -> None:
    limiter = one(3.0, 20.0)
    limiter.reset(np.array([0.7]))
    assert limiter.stopping_position(0.01)[0] == 0.7 and limiter.stopping_position(1.0)[0] == 0.7


def test_it_comes_to_an_exact_rest_at_its_target() -> None:
    limiter, out = one(3.0, 20.0, response_s=0.02), np.zeros(1)
    for _ in range(300):
        limiter.step(0.01, np.array([1.0]), out)
    assert out[0] == pytest.approx(1.0, abs=1e-9) and abs(limiter.velocity[0]) < 1e-7
    assert not limiter.limited[0]


def test_a_step_of_a_tenth_of_a_second_is_the_longest() -> None:
    for seconds, moved in ((0.05, 0.05), (0.1, 0.1), (0.2, 0.1), (9.0, 0.1)):
        limiter, out = one(1.0, 1e6, response_s=1e-6), np.zeros(1)
        limiter.step(1e-3, np.array([9.0]), out)
        before = float(out[0])
        limiter.step(seconds, np.array([9.0]), out)
        assert out[0] - before == pytest.approx(moved, rel=1e-6)


def test_a_limiter_starts_at_zero_or_at_the_end_of_its_range_that_is_nearest() -> None:
    limiter = MotionLimiter(np.ones(3), np.ones(3), np.array([-1.0, 0.5, -2.0]), np.array([1.0, 2.0, -1.0]))
    out = limiter.step(0.0, np.full(3, np.nan), np.empty(3))
    assert out.tolist() == [0.0, 0.5, -1.0]
    limiter.reset(np.array([5.0, 0.0, 0.0]))
    assert limiter.step(0.0, np.full(3, np.nan), np.empty(3)).tolist() == [1.0, 0.5, -1.0]


def test_envelope_without_a_plateau_and_with_ends_that_are_exact() -> None:
    envelope = Envelope(start_s=1.0, onset_s=0.5, hold_s=0.0, offset_s=0.25)
    assert envelope.end_s == 1.75
    assert [envelope.level(t) for t in (1.5, 1.625, 1.75)] == pytest.approx([1.0, 0.5, 0.0])
    assert 0.0 < envelope.level(1.0 + 1e-3) < 1e-5


def test_a_record_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        object.__new__(Envelope).anything = 1
