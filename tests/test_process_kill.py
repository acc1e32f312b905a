"""benchmarks/process_kill.py, shortly: starts of omote run that are killed, and one on a full disk."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="finds its processes in /proc")


@pytest.fixture
def program(root: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location("process_kill", root / "benchmarks" / "process_kill.py")
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules["process_kill"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_servos_are_safe_and_nothing_is_left_after_a_kill_and_on_a_full_disk(program: ModuleType) -> None:
    with program.Head(7) as head:
        head.start("SIGKILL")
        head.start("disk")
    assert head.result.failures == [] and head.result.done["no disk"] == 1
    assert head.result.ends["disk: 0"] == 1  # a full disk ends the recording alone
