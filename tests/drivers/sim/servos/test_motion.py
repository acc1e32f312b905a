"""drivers.sim.servos.motion: the plans keep their limits, join smoothly and end where and when they say."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.sim.servos.motion import Motion, Profile, Trajectory, hold, plan_move, plan_speed, plan_stop, plan_timed

TICKS = st.floats(-5000, 5000)
SPEEDS = st.floats(-3000, 3000)
TOP = st.floats(1, 3000)
ACCELERATION = st.floats(10, 1e5)


def samples(plan: Trajectory, count: int = 400) -> list[float]:
    return [plan.start_s + plan.duration * k / count for k in range(count + 1)]


@given(TICKS, SPEEDS, TICKS, TOP, ACCELERATION)
def test_a_move_is_smooth_keeps_its_limits_and_ends_at_rest_on_the_goal(start, velocity, goal, top, acceleration):
    plan = plan_move(3.0, Motion(start, velocity), goal, top, acceleration)
    assert plan.at(3.0)[:2] == pytest.approx((start, velocity))
    assert tuple(plan.at(3.0 + plan.duration + 1e-9)) == (goal, 0.0, 0.0)
    assert tuple(plan.at(1e6)) == (goal, 0.0, 0.0)
    step = plan.duration / 400
    last = plan.at(3.0)
    for t in samples(plan)[:-1]:
        now = plan.at(t)
        fastest = max(top, abs(velocity)) * (1 + 1e-9)
        assert abs(now.velocity) <= fastest
        assert abs(now.acceleration) <= acceleration * (1 + 1e-9)
        assert abs(now.position - last.position) <= fastest * step + 1e-6
        assert abs(now.velocity - last.velocity) <= acceleration * step * (1 + 1e-6) + 1e-6
        last = now
    near_end = plan.at(3.0 + plan.duration * (1 - 1e-9))
    assert near_end.position == pytest.approx(goal, abs=1e-2)


def test_a_long_move_is_a_trapezoid_of_the_textbook_duration():
    plan = plan_move(0.0, Motion(0.0), 1000.0, 500.0, 1000.0)
    assert plan.duration == pytest.approx(1000 / 500 + 500 / 1000)
    assert plan.profile == Profile.TRAPEZOIDAL
    assert tuple(plan.at(0.25)) == pytest.approx((31.25, 250.0, 1000.0))
    assert tuple(plan.at(1.0)) == pytest.approx((375.0, 500.0, 0.0))


def test_a_short_move_is_a_triangle():
    plan = plan_move(0.0, Motion(0.0), 90.0, 500.0, 1000.0)
    assert plan.duration == pytest.approx(2 * (90 / 1000) ** 0.5)
    assert plan.profile == Profile.TRIANGULAR


def test_a_new_goal_behind_a_moving_shaft_brakes_first():
    plan = plan_move(0.0, Motion(0.0, 400.0), -100.0, 500.0, 1000.0)
    assert max(plan.at(t).position for t in samples(plan)) == pytest.approx(400**2 / 2000, rel=1e-3)


@given(TICKS, TICKS, st.floats(0.01, 10), st.just(0.0) | st.floats(0.001, 10))
def test_a_timed_move_takes_its_time_and_its_ramp_at_most_half_of_it(start, goal, total, ramp):
    plan = plan_timed(1.0, Motion(start), goal, total, ramp)
    assert plan.duration == pytest.approx(total)
    assert plan.at(1.0 + total * (1 - 1e-12)).position == pytest.approx(goal, abs=1e-3)
    assert plan.at(1.0 + total / 2).position == pytest.approx((start + goal) / 2, abs=1e-6)
    fastest = abs(goal - start) / (total - min(ramp, total / 2))
    assert max(abs(plan.at(t).velocity) for t in samples(plan)) == pytest.approx(fastest, abs=1e-6)


def test_a_timed_move_continues_from_the_present_velocity():
    plan = plan_timed(0.0, Motion(0.0, 300.0), 500.0, 1.0, 0.2)
    assert plan.at(0.0).velocity == 300.0
    assert plan.at(1.0 - 1e-9).position == pytest.approx(500.0, abs=1e-3)


@pytest.mark.parametrize(("ramp", "profile"), [(0.0, 1), (0.5, 2), (0.2, 3)])
def test_profile_numbers_of_timed_moves(ramp, profile):
    assert plan_timed(0.0, Motion(0.0), 100.0, 1.0, ramp).profile == profile


def test_speed_control_ramps_and_goes_on_for_ever():
    plan = plan_speed(0.0, Motion(10.0, -100.0), 300.0, 200.0)
    assert tuple(plan.at(1.0)) == pytest.approx((10.0, 100.0, 200.0))
    assert tuple(plan.at(2.0)) == pytest.approx((210.0, 300.0, 0.0))
    assert plan.at(12.0).position == pytest.approx(3210.0)
    assert not plan.moving(2.0)


def test_stop_and_hold():
    plan = plan_stop(0.0, Motion(0.0, -100.0), 200.0)
    assert plan.end == pytest.approx(-25.0)
    assert tuple(plan.at(9.0)) == (plan.end, 0.0, 0.0)
    assert tuple(hold(5.0, 7.0).at(0.0)) == (7.0, 0.0, 0.0)
    assert tuple(plan_stop(0.0, Motion(3.0), 200.0).at(1.0)) == (3.0, 0.0, 0.0)


def test_profiles_have_the_numbers_of_moving_status():
    assert (Profile.STEP, Profile.RECTANGULAR, Profile.TRIANGULAR, Profile.TRAPEZOIDAL) == (0, 1, 2, 3)


@pytest.mark.parametrize(
    ("goal", "profile", "shown"), [(90.0, 1, 1), (90.0, 0, 0), (90.0, 3, 2), (1000.0, 3, 3), (1000.0, 1, 1)]
)
def test_only_a_trapezoid_without_a_level_is_reported_as_a_triangle(goal: float, profile: int, shown: int):
    assert plan_move(0.0, Motion(0.0), goal, 500.0, 1000.0, profile).profile == shown


def test_a_move_ends_at_its_duration_exactly():
    plan = plan_move(2.0, Motion(0.0), 1000.0, 500.0, 1000.0)
    assert (plan.moving(2.0), plan.moving(4.49), plan.moving(4.5)) == (True, True, False)
    assert plan.at(1.0) == Motion(0.0, 0.0, 1000.0), "before the start it is the start's"
    assert plan.end == 1000.0


def test_a_move_that_ends_where_the_shaft_would_stop_only_brakes():
    plan = plan_move(0.0, Motion(0.0, 400.0), 80.0, 500.0, 1000.0)
    assert plan.duration == pytest.approx(0.4)
    assert plan.at(0.2) == pytest.approx((60.0, 200.0, -1000.0))
    back = plan_move(0.0, Motion(0.0, -400.0), -80.0, 500.0, 1000.0)
    assert back.at(0.2) == pytest.approx((-60.0, -200.0, 1000.0))


def test_no_move_takes_no_time():
    plan = plan_move(0.0, Motion(5.0), 5.0, 500.0, 1000.0)
    assert (plan.duration, plan.at(0.0)) == (0.0, Motion(5.0))


def test_a_move_from_above_the_top_speed_slows_down_to_it():
    plan = plan_move(0.0, Motion(0.0, 1000.0), 5000.0, 500.0, 1000.0)
    assert plan.at(0.25).acceleration == -1000.0
    assert plan.at(1.0).velocity == 500.0
    assert plan.at(0.5).position == pytest.approx(375.0)


def test_the_ramps_of_a_timed_move_start_at_the_present_velocity():
    plan = plan_timed(1.0, Motion(100.0, 50.0), 600.0, 2.0, 0.5)
    speed = (500.0 - 0.5 * 50.0 * 0.5) / 1.5
    assert plan.at(1.0).acceleration == pytest.approx((speed - 50.0) / 0.5)
    assert plan.at(2.0) == pytest.approx((100.0 + (50.0 + speed) / 4 + speed * 0.5, speed, 0.0))
    assert plan.at(2.75).acceleration == pytest.approx(-speed / 0.5)
    jump = plan_timed(1.0, Motion(100.0, 50.0), 600.0, 2.0)
    assert jump.at(1.0) == Motion(100.0, 250.0)
