"""benchmarks/process_kill.py, shortly: starts of omote run that are killed, and one on a full disk."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import ModuleType

import pytest

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="finds its processes in /proc")


@pytest.fixture
def program(benchmark: Callable[[str], ModuleType]) -> ModuleType:
    return benchmark("process_kill")


@pytest.mark.slow
def test_servos_are_safe_and_nothing_is_left_after_a_kill_and_on_a_full_disk(program: ModuleType) -> None:
    with program.Head(7) as head:
        head.start("SIGKILL")
        head.start("disk")
    assert head.result.failures == [] and head.result.done["no disk"] == 1
    assert head.result.ends["disk: 0"] == 1  # a full disk ends the recording alone
