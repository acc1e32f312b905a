"""drivers.testing.servochecks: which goals and motions are faults, and what is said of them."""

from __future__ import annotations

import math
import re

import pytest

from drivers.testing.servochecks import SHOWN, beyond_limits, fail, jumps, name, still_on
from tests.drivers.testing.lines import START_S, Line, said

TICK_DEG = 360.0 / 4096.0


def test_nothing_found_says_nothing_and_the_first_faults_are_listed() -> None:
    fail("title", [])
    assert SHOWN == 5
    assert said(lambda: fail("title", ["a", "b", "c", "d", "e"])) == "title\n  a\n  b\n  c\n  d\n  e"
    assert said(lambda: fail("title", list("abcdefg"))) == "title\n  a\n  b\n  c\n  d\n  e\n  and 2 more"


def test_a_servo_is_named_by_its_id_and_model() -> None:
    line = Line("xl330-m288", "xm430-w350")
    assert [name(servo) for servo in line.chain.servos] == ["servo 1 (xl330-m288)", "servo 2 (xm430-w350)"]


# ---------------------------------------------------------------- limits
@pytest.mark.parametrize(("goal", "out"), [(2899, False), (2900, False), (2901, False), (2902, True), (1500, False)])
def test_a_goal_may_be_a_tick_beyond_its_limits(goal: int, out: bool) -> None:
    """The shaft is inside, at 2048; the limits are those of the test."""
    line = Line()
    line.write(1, "Goal Position", goal, 0.25)
    found = beyond_limits(line.record, (1000, 2900), line.settle(0.5))
    wanted = f"servo 1 (xl330-m288) got Goal Position = {goal} at 0.250 s; its limits are 1000 to 2900"
    assert found == ([wanted] if out else [])


@pytest.mark.parametrize(("goal", "out"), [(3501, False), (3502, True), (3000, False), (999, False), (998, True)])
def test_from_outside_a_goal_may_lead_back_but_not_further(goal: int, out: bool) -> None:
    line = Line()
    line.chain.servo(1).place(3500, START_S)
    line.write(1, "Goal Position", goal, 0.25)
    found = beyond_limits(line.record, {1: (1000, 2900)}, line.settle(0.5))
    assert len(found) == out, found


def test_limits_by_id_leave_the_others_free() -> None:
    line = Line("xl330-m288", "xl330-m288")
    for servo in (1, 2):
        line.write(servo, "Goal Position", 4000, 0.1)
    found = beyond_limits(line.record, {2: (0, 3000)}, line.settle(0.2))
    assert [re.match(r"servo \d", text)[0] for text in found] == ["servo 2"]  # type: ignore[index]


def test_limits_of_the_servo_are_its_registers_and_what_it_refused_counts() -> None:
    line = Line()
    line.write(1, "Max Position Limit", 3000, 0.0)
    line.write(1, "Min Position Limit", 1000, 0.0)
    line.write(1, "Goal Position", 3001, 0.125)
    line.write(1, "Goal Position", 999, 0.25)
    line.write(1, "Profile Velocity", 40_000, 0.5)
    line.write(1, "LED", 7, 0.75)
    found = beyond_limits(line.record, None, line.settle(1.0))
    assert found == [
        "servo 1 (xl330-m288) got Goal Position = 3001 at 0.125 s, which it refused (data limit); "
        "its limits are 1000 to 3000",
        "servo 1 (xl330-m288) got Goal Position = 999 at 0.250 s, which it refused (data limit); "
        "its limits are 1000 to 3000",
        "servo 1 (xl330-m288) refused Profile Velocity = 40000 at 0.500 s: data range",
        "servo 1 (xl330-m288) refused LED = 7 at 0.750 s: data range",
    ]
    assert len(beyond_limits(line.record, (0, 4095), line.settle(1.0))) == 0  # a test's own limits say only of goals


def test_servos_that_turn_without_end_have_no_limits_of_their_own() -> None:
    line = Line()
    line.write(1, "Operating Mode", 4, 0.0)
    line.write(1, "Goal Position", 100_000, 0.1)
    assert beyond_limits(line.record, None, line.settle(0.2)) == []
    assert len(beyond_limits(line.record, (0, 4095), line.settle(0.2))) == 1


def test_a_shaft_that_moves_beyond_a_limit_is_named_with_where_and_when() -> None:
    line = Line()
    line.write(1, "Torque Enable", 1, 0.0)
    line.write(1, "Goal Position", 2900, 0.5)
    end_s = line.settle(3.0)
    got, moved = beyond_limits(line.record, (1000, 2500), end_s)
    assert "got Goal Position = 2900" in got
    found = re.fullmatch(r"servo 1 \(xl330-m288\) moved to 2900 at (\d\.\d{3}) s, beyond 2500", moved)
    assert found and 0.6 < float(found[1]) < 3.0
    line.write(1, "Goal Position", 900, 3.0)
    assert [text for text in beyond_limits(line.record, (1000, 2500), line.settle(6.0)) if "beyond 1000" in text]


def test_a_shaft_that_a_hand_moves_is_no_fault() -> None:
    line = Line()
    line.chain.servo(1).place(3900, START_S + 0.5)
    line.record.after(START_S + 0.5)
    assert beyond_limits(line.record, (1000, 2500), line.settle(1.0)) == []


# ---------------------------------------------------------------- torque
def test_torque_that_is_left_on_is_said_with_when_it_came_on_last() -> None:
    line = Line("xl330-m288", "xl330-m288")
    assert still_on(line.record) == []
    for value, time_s in ((1, 0.25), (0, 0.5), (1, 0.75), (1, 1.0)):
        line.write(2, "Torque Enable", value, time_s)
    line.settle(2.0)
    assert still_on(line.record) == [
        "servo 2 (xl330-m288) still has its torque on, since 0.750 s; nothing switched it off"
    ]
    line.write(2, "Torque Enable", 0, 2.0)
    assert still_on(line.record) == []


# ---------------------------------------------------------------- jumps
def test_a_way_counts_by_its_length_and_its_speed() -> None:
    """No-load speed of the XL330-M288 at 5 V: 103 rev/min are 618 degrees/s (e-Manual)."""
    line = Line()
    line.write(1, "Torque Enable", 1, 0.0)
    line.write(1, "Goal Position", 2048 + 1024, 0.5)  # a quarter turn
    end_s = line.settle(2.0)
    (text,) = jumps(line.record, 60.0, 300.0, end_s)
    found = re.match(
        r"servo 1 \(xl330-m288\) went ([\d.]+) degrees in ([\d.]+) s, at up to (\d+) degrees/s, from (\d+) to (\d+) at "
        r"([\d.]+) s; its last goal was Goal Position = 3072 at 0.500 s: move in small steps",
        text,
    )
    assert found, text
    way, took_s, top, first, last, at_s = map(float, found.groups())
    assert top == pytest.approx(618, rel=0.03)
    assert way == pytest.approx((last - first) * TICK_DEG, abs=0.2)
    assert 0.5 <= at_s < 0.53 and way / took_s < top
    assert jumps(line.record, way + 1.0, 300.0, end_s) == []
    assert len(jumps(line.record, way - 1.0, 300.0, end_s)) == 1
    assert jumps(line.record, 60.0, 640.0, end_s) == []


def test_torque_that_comes_on_far_from_the_goal_is_told_what_to_do() -> None:
    line = Line()
    line.chain.servo(1).place(1024, START_S)
    line.write(1, "Torque Enable", 1, 0.5)
    (text,) = jumps(line.record, 45.0, 300.0, line.settle(2.0))
    assert ", and its torque had come on at 0.500 s: write its Present Position to its Goal Position" in text
    assert "its last goal" not in text
    line = Line()
    line.write(1, "Goal Position", 3072, 0.25)
    line.write(1, "Torque Enable", 1, 0.5)
    (text,) = jumps(line.record, 45.0, 300.0, line.settle(2.0))
    assert "its last goal was Goal Position = 3072 at 0.250 s, and its torque had come on at 0.500 s: write" in text


@pytest.mark.parametrize(("goal_s", "soon"), [(0.05, True), (0.25, False)])
def test_torque_that_came_on_long_before_is_no_cause(goal_s: float, soon: bool) -> None:
    line = Line()
    line.write(1, "Torque Enable", 1, 0.0)
    line.write(1, "Goal Position", 3072, goal_s)
    (text,) = jumps(line.record, 45.0, 300.0, line.settle(2.0))
    assert ("and its torque had come on at 0.000 s" in text) is soon
    assert "move in small steps from its Present Position, or set its Profile Velocity" in text


def test_the_last_goal_before_the_jump_is_named_and_one_that_was_refused_is_not() -> None:
    line = Line()
    line.write(1, "Torque Enable", 1, 0.0)
    line.write(1, "Goal Position", 3072, 0.5)
    line.write(1, "Goal Position", 5000, 0.5005)
    line.write(1, "Goal Position", 2048, 1.5)
    first, second = jumps(line.record, 45.0, 300.0, line.settle(3.0))
    assert "its last goal was Goal Position = 3072 at 0.500 s" in first
    assert "its last goal was Goal Position = 2048 at 1.500 s" in second


def test_steps_of_other_models_are_other_angles() -> None:
    """AX-12A: 1024 steps are 300 degrees, and Goal Position is 2 bytes (e-Manual)."""
    line = Line("ax-12a")
    line.write(1, "Torque Enable", 1, 0.0)
    line.write(1, "Goal Position", 512 + 300, 0.5)
    (text,) = jumps(line.record, 45.0, 200.0, line.settle(3.0))
    way = float(re.search(r"went ([\d.]+) degrees", text)[1])  # type: ignore[index]
    assert 60.0 < way <= 300 * math.degrees(math.radians(300.0) / 1023) + 0.5
