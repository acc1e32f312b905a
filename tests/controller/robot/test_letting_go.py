"""When a bus is let go, when it is taken again, and when it is held for the rest of the run."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from controller.robot.letting_go import LettingGo


def state(degrees: list[float], amperes: float = 0.0, fresh: bool = True) -> Any:
    at = np.radians(degrees)
    return SimpleNamespace(position_rad=at, current_a=np.full(len(at), amperes), fresh=np.full(len(at), fresh))


def ticks_until_let_go(letting: LettingGo, goals: list[float], measured: Any, most: int = 50) -> int | None:
    """How many ticks of 0.25 s it takes."""
    for tick in range(1, most + 1):
        if letting.may_let_go(np.radians(goals), measured, 0.25):
            return tick
    return None


def test_it_is_let_go_after_its_time_of_stillness_and_motion_starts_that_again() -> None:
    letting = LettingGo(1.0, 0.1)
    assert ticks_until_let_go(letting, [10, 20], state([10, 20])) == 5  # the first tick sees new goals
    letting.begin(np.radians([10, 20]), state([10, 20]))
    assert letting.times == 1 and ticks_until_let_go(letting, [10, 20], state([10, 20])) == 4
    assert ticks_until_let_go(letting, [10, 20.09], state([10, 20])) == 1  # hardly moved
    assert ticks_until_let_go(letting, [10, 20.2], state([10, 20])) == 5


@pytest.mark.parametrize(
    "measured",
    [None, state([10, 22.1]), state([10, 20], 0.1), state([10, 20], np.nan), state([10, 20], fresh=False)],
)
def test_a_servo_that_is_off_its_goal_loaded_or_not_known_is_held(measured: Any) -> None:
    letting = LettingGo(1.0, 0.1)
    assert ticks_until_let_go(letting, [10, 20], measured) is None
    assert ticks_until_let_go(letting, [10, 20], state([10, 21.9], 0.09)) == 4


def test_it_is_taken_again_where_something_else_is_wanted_or_a_servo_was_moved() -> None:
    letting, wanted = LettingGo(1.0, 0.1), np.radians([10, 20])
    assert letting.must_hold(wanted, state([10, 20]))  # it was never let go
    letting.begin(wanted, state([10.5, 20]))
    assert not letting.must_hold(wanted, state([13.4, 20])) and letting.sagged == 0
    assert not letting.must_hold(wanted + np.radians([0, 0.09]), state([10.5, 20]))
    assert letting.must_hold(wanted + np.radians([0, -0.11]), state([10.5, 20])) and letting.sagged == 0
    assert letting.must_hold(wanted, state([13.6, 20])) and letting.sagged == 1
    letting.begin(wanted, None)
    assert letting.must_hold(wanted, state([10, 20])) and letting.times == 2


def test_a_bus_that_sagged_twice_is_not_let_go_again() -> None:
    letting = LettingGo(1.0, 0.1)
    for count in (1, 2):
        assert ticks_until_let_go(letting, [10, 20], state([10, 20])) is not None
        letting.begin(np.radians([10, 20]), state([10, 20]))
        assert letting.must_hold(np.radians([10, 20]), state([10, 24])) and letting.sagged == count
    assert ticks_until_let_go(letting, [10, 20], state([10, 20])) is None
    assert ticks_until_let_go(LettingGo(0.0, 0.1), [10, 20], state([10, 20])) is None  # 0: never
