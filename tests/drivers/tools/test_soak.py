"""benchmarks/soak.py, shortly: the real driver under random faults in time that does not pass by itself."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import pytest


@pytest.fixture
def program(benchmark: Callable[[str], ModuleType]) -> ModuleType:
    return benchmark("soak")


@pytest.mark.parametrize("seed", [1, 7])
def test_random_faults_cost_no_wrong_value_no_jump_and_no_servo_left_on(program: ModuleType, seed: int) -> None:
    program.FAULT_EVERY_S = 2.0
    result = program.soak(12.0, seed)
    assert result.failures == []
    assert result.cycles > 300
    assert sum(result.faults.values()) >= 4
    assert result.errors


def test_what_is_wrong_is_told(program: ModuleType) -> None:
    bad = program.Soak(wrong=1, jumps=2, left_on=3, growth_mb=6.0)
    bad.logs["x"] = 1
    assert len(bad.failures) == 5
    once = program.Soak(apart=True, errors={"reset": 1, "torque_lost": 1})
    once.faults["forget"] = 1
    assert once.failures == []
    once.errors["torque_lost"] = 2
    assert len(once.failures) == 1
