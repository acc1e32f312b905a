"""benchmarks/fault_soak.py, shortly: groups of faults on real drivers in time that does not pass by itself."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from types import ModuleType

import pytest

from drivers.sim.wire.faults import KINDS


@pytest.fixture
def program(benchmark: Callable[[str], ModuleType]) -> ModuleType:
    return benchmark("fault_soak")


@pytest.mark.parametrize("family", ["dynamixel", "feetech", "both protocols"])
def test_groups_of_faults_cost_no_wrong_value_no_jump_and_no_healthy_servo(program: ModuleType, family: str) -> None:
    result = program.Result()
    head = program.Head(family, 5, result)
    head.start()
    head.run(("hw:{i}:0x20", "mute:{i}", "unplug"))
    head.finish()
    assert result.failures == []
    assert (result.groups, result.replugs) == (1, 1) and result.healthy > 500


@pytest.mark.parametrize(("silencing", "answers"), [("baud:3:57600", True), ("temp:3:40", False)])
def test_a_second_servo_that_answers_alone_is_told_from_a_wrong_value(
    program: ModuleType, silencing: str, answers: bool
) -> None:
    result = program.Result()
    head = program.Head("dynamixel", 5, result)
    head.start()
    for fault in ("dup:3:for=2s", f"{silencing}:for=2s"):
        head.wire.fault(fault)
    for _ in range(150):
        head._cycle()
    head.finish()
    assert result.wrong == 0 and (result.twins > 0) == answers


def test_every_pair_of_all_faults_comes(program: ModuleType) -> None:
    kinds = [spec.partition(":")[0] for spec in program.FAULTS]
    assert sorted(kinds) == sorted(set(KINDS) - {"stops", "weight"})  # these belong to a joint, and are no faults
    pairs = {tuple(sorted(pair)) for group in program.groups(1) for pair in itertools.combinations(group, 2)}
    assert {tuple(sorted(pair)) for pair in itertools.combinations(program.FAULTS, 2)} <= pairs
    assert any(len(group) == 3 for group in program.groups(1))


def test_what_is_wrong_is_told(program: ModuleType) -> None:
    bad = program.Result(wrong=1, jumps=1, left_on=1, healthy=100, driven=98, wanted=2)
    assert len(bad.failures) == 5
    assert program.Result(healthy=100, driven=99).failures == []
