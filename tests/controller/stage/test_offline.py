"""The way from the layers to the wire, in a time of its own: hostile input, memory, latency."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.base.paths import find_config
from controller.layers.commands import CommandState
from controller.robot.robot import load_robot
from controller.stage.offline import OfflineRun


@pytest.fixture(scope="module")
def ticks(root: Path) -> ModuleType:
    """benchmarks/control_tick.py: the chain with 8 layers and what attacks it; a million ticks with --soak."""
    spec = importlib.util.spec_from_file_location("control_tick", root / "benchmarks/control_tick.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["control_tick"] = module
    spec.loader.exec_module(module)
    return module


def test_no_hostile_layer_breaks_a_limit_at_the_bus(ticks: ModuleType) -> None:
    chain = ticks.Chain(0)
    counts = ticks.faults(chain, range(3800))
    assert counts == dict.fromkeys(("not a number", "position", "speed", "acceleration", "jerk"), 0)
    assert len(chain.line.guard.report()) >= 3  # rules came to act
    assert np.ptp(chain.sent) > 0.0


def test_the_check_of_limits_finds_broken_ones(ticks: ModuleType) -> None:
    chain = ticks.Chain(0)
    chain.table.max_speed_rad_s[:] /= 4
    chain.table.max_accel_rad_s2[:] /= 4
    counts = ticks.faults(chain, range(2000, 2600))
    assert counts["acceleration"] > 0 and counts["speed"] > 0


def test_eight_layers_are_active_and_memory_does_not_grow(ticks: ModuleType) -> None:
    chain = ticks.Chain(1)
    assert ticks.growth(chain, 400) < 4096
    assert len(chain.state.mixer.active) == 8


def test_a_command_reaches_the_bus_with_the_next_tick(ticks: ModuleType) -> None:
    assert ticks.ticks_to_output(ticks.Chain(2)) == 1


def test_each_bus_has_its_own_pace() -> None:
    robot = load_robot(find_config("robots", "head24"), P)
    state = CommandState(P)
    jaw = P.index("jawOpen")
    rehearsal = OfflineRun(robot, state, lambda now_ns: state.set_parameters([jaw], [0.5], now_ns))
    rehearsal.run(1.0)
    sent = rehearsal.sent_rad["head"]
    assert sent.shape == (51, 24)
    assert np.degrees(sent[-1, 3]) == pytest.approx(14.0, abs=0.05)
    assert next(iter(rehearsal.rows()))["held by"] == "nothing"
