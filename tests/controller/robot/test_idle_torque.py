"""When a bus is let go, when it is taken again, and when it is held for the rest of the run."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from controller.robot.idle_torque import IdleTorqueOff


def state(degrees: list[float], amperes: float = 0.0, fresh: bool = True) -> Any:
    at = np.radians(degrees)
    return SimpleNamespace(position_rad=at, current_a=np.full(len(at), amperes), fresh=np.full(len(at), fresh))


def ticks_until_torque_off(idle: IdleTorqueOff, goals: list[float], measured: Any, most: int = 50) -> int | None:
    """How many ticks of 0.25 s it takes."""
    for tick in range(1, most + 1):
        if idle.update(np.radians(goals), measured, 0.25):
            return tick
    return None


def test_it_is_let_go_after_its_time_of_stillness_and_motion_starts_that_again() -> None:
    idle = IdleTorqueOff(1.0, 0.1)
    assert ticks_until_torque_off(idle, [10, 20], state([10, 20])) == 5  # the first tick sees new goals
    idle.note_torque_off(np.radians([10, 20]), state([10, 20]))
    assert idle.torque_off_count == 1 and ticks_until_torque_off(idle, [10, 20], state([10, 20])) == 4
    assert ticks_until_torque_off(idle, [10, 20.09], state([10, 20])) == 1  # hardly moved
    assert ticks_until_torque_off(idle, [10, 20.2], state([10, 20])) == 5


@pytest.mark.parametrize(
    "measured",
    [None, state([10, 22.1]), state([10, 20], 0.1), state([10, 20], np.nan), state([10, 20], fresh=False)],
)
def test_a_servo_that_is_off_its_goal_loaded_or_not_known_is_held(measured: Any) -> None:
    idle = IdleTorqueOff(1.0, 0.1)
    assert ticks_until_torque_off(idle, [10, 20], measured) is None
    assert ticks_until_torque_off(idle, [10, 20], state([10, 21.9], 0.09)) == 4


def test_it_is_taken_again_where_something_else_is_wanted_or_a_servo_was_moved() -> None:
    idle, wanted = IdleTorqueOff(1.0, 0.1), np.radians([10, 20])
    assert idle.check_wake(wanted, state([10, 20]))  # it was never let go
    idle.note_torque_off(wanted, state([10.5, 20]))
    assert not idle.check_wake(wanted, state([13.4, 20])) and idle.drift_wake_count == 0
    assert not idle.check_wake(wanted + np.radians([0, 0.09]), state([10.5, 20]))
    assert idle.check_wake(wanted + np.radians([0, -0.11]), state([10.5, 20])) and idle.drift_wake_count == 0
    assert idle.check_wake(wanted, state([13.6, 20])) and idle.drift_wake_count == 1
    idle.note_torque_off(wanted, None)
    assert idle.check_wake(wanted, state([10, 20])) and idle.torque_off_count == 2


def test_a_bus_that_sagged_twice_is_not_let_go_again() -> None:
    idle = IdleTorqueOff(1.0, 0.1)
    for count in (1, 2):
        assert ticks_until_torque_off(idle, [10, 20], state([10, 20])) is not None
        idle.note_torque_off(np.radians([10, 20]), state([10, 20]))
        assert idle.check_wake(np.radians([10, 20]), state([10, 24])) and idle.drift_wake_count == count
    assert ticks_until_torque_off(idle, [10, 20], state([10, 20])) is None
    assert ticks_until_torque_off(IdleTorqueOff(0.0, 0.1), [10, 20], state([10, 20])) is None  # 0: never
