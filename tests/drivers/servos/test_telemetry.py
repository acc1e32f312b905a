"""drivers.servos.telemetry: a silent servo is told of once, asked again now and then, and welcomed when it answers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest

from drivers.base.bus import Bus, BusState
from drivers.servos.telemetry import PROBE_S
from drivers.sim.serving.virtual import VirtualBus
from tests.drivers import contract

MODELS = {"xl330-m288": "dynamixel", "mx1-28": "dynamixel", "ax-12a": "dynamixel", "sts3215": "feetech"}
SILENT = contract.SERVOS[1].id


@pytest.fixture(params=MODELS)
def wire(request: pytest.FixtureRequest) -> VirtualBus:
    servos = [replace(servo, model=request.param) for servo in contract.SERVOS]
    return VirtualBus(servos, MODELS[request.param], driver={"margin_s": 0.05, "watchdog_ms": 0})


@pytest.fixture
def bus(wire: VirtualBus) -> Iterator[Bus]:
    with wire.bus() as running:
        running.start()
        wire.fault(f"mute:{SILENT}")
        for _ in range(3):
            running.read()
        yield running


def silent(state: BusState) -> list[bool]:
    return state.silent.tolist()


def test_a_silent_servo_is_left_out_and_comes_back_by_itself(wire: VirtualBus, bus: Bus) -> None:
    assert silent(bus.read()) == [False, True, False]
    assert bus.report().silent == (SILENT,)
    assert bus.report().errors == {"no_reply": 1}
    wire.clear()
    wire.clock.sleep(PROBE_S)
    bus.read()
    assert silent(bus.read()) == [False] * 3
    assert bus.report().silent == ()


def test_a_servo_that_was_recovered_is_silent_no_longer(wire: VirtualBus, bus: Bus) -> None:
    wire.clear()
    bus.recover([SILENT])
    assert silent(bus.read()) == [False] * 3
    assert bus.report().silent == ()
