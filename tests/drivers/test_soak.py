"""benchmarks/soak.py, shortly: the real driver under random faults in time that does not pass by itself."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

from drivers.errors import PortLost, PortMissing
from drivers.sim.bus import SimulatedChain
from drivers.sim.device import SimulatedServo
from drivers.sim.virtual import VirtualClock, VirtualLink


@pytest.fixture
def program(root: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location("soak", root / "benchmarks" / "soak.py")
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules["soak"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


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


def test_waiting_moves_the_clock_to_the_bytes_and_no_further() -> None:
    clock = VirtualClock(5.0)
    link = VirtualLink(SimulatedChain([SimulatedServo(1)], now_s=5.0, faults=("unplug:at=1s:for=1s",)), clock)
    with pytest.raises(PortLost):
        link.write(b"")
    link.open()
    link.write(bytes.fromhex("fffffd00010300 01194e"))  # ping
    reply = link.read(5.1)
    assert (len(reply), clock()) == (14, pytest.approx(5.0 + 24 * 10 / 1e6 + 500e-6))
    assert link.read(5.2) == b""
    assert clock() == 5.2
    clock.sleep(1.0)
    with pytest.raises(PortLost):
        link.write(b"x")
    link.close()
    with pytest.raises(PortMissing):
        link.open()
    clock.wait_until(7.5)
    link.open()
    assert link.is_open
