"""drivers.servos.telemetry: what is known of servos of every protocol, and how silent ones are asked again."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from drivers.base.bus import Bus, BusState
from drivers.packets.packet import ALERT
from drivers.servos.telemetry import FAILED_GREETINGS, PROBE_S
from drivers.sim.serving.virtual import VirtualBus
from drivers.tables.tables import load_table
from tests.drivers import contract
from tests.drivers.contract import read_until

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
        wire.clear()


def silent(state: BusState) -> list[bool]:
    return state.silent.tolist()


def test_a_silent_servo_is_left_out_and_comes_back_by_itself(wire: VirtualBus, bus: Bus) -> None:
    assert silent(bus.read()) == [False, True, False]
    assert bus.report().silent == (SILENT,)
    assert bus.report().errors == {"no_reply": 1}
    wire.clear()
    wire.clock.sleep(1.0)
    bus.read()
    assert silent(bus.read()) == [False] * 3
    assert bus.report().silent == ()


def test_a_servo_that_was_recovered_is_silent_no_longer(wire: VirtualBus, bus: Bus) -> None:
    wire.clear()
    bus.recover([SILENT])
    assert silent(bus.read()) == [False] * 3
    assert bus.report().silent == ()


@pytest.fixture
def still(wire: VirtualBus) -> Iterator[Bus]:
    """A running bus that knows where its servos are."""
    with wire.bus() as running:
        running.start()
        for _ in range(8):
            running.read()
            wire.clock.sleep(0.02)
        yield running
        wire.clear()


def regroup(bus: Bus) -> None:
    """What the bus does when servos leave or join a group of reads."""
    bus._group_reads(getattr(bus, "_indirect_blocks", {}))


def test_a_regrouped_servo_has_no_position_until_it_is_read_again(wire: VirtualBus, still: Bus) -> None:
    before = still.read()
    assert np.isfinite(before.position_rad).all()
    wire.fault(f"mute:{SILENT}")
    wire.servo(SILENT).put("Torque Enable", 0)
    wire.servo(SILENT).place(wire.servo(SILENT).position_ticks + 50)  # moved by hand while it does not answer
    regroup(still)
    state = still.read()
    assert np.isnan(state.position_rad).tolist() == [False, True, False]
    assert state.fresh.tolist() == [True, False, True]
    assert np.isinf(state.age_s).tolist() == [False, True, False]
    wire.clear()
    wire.clock.sleep(1.0)
    state = read_until(still, lambda state: bool(state.fresh[1]))
    assert abs(state.position_rad[1] - before.position_rad[1]) > 30 * still.scale.rad_per_tick[1]


def test_regrouping_forgets_who_was_silent_and_whom_to_ask_first(wire: VirtualBus, bus: Bus) -> None:
    assert bus.report().errors == {"no_reply": 1}
    wire.clear()
    wire.clock.sleep(1.0)
    bus._telemetry._check_first(SILENT)
    wire.fault(f"mute:{SILENT}")
    regroup(bus)
    assert bus.report().silent == ()
    assert not bus._telemetry._urgent
    bus._port.suspects.clear()
    bus.read()
    assert bus.report().errors == {"no_reply": 2}, "counted again, for nothing is known of it any more"


def test_ages_grow_while_nothing_is_read_and_are_zero_when_it_is(wire: VirtualBus, still: Bus) -> None:
    wire.fault(f"mute:{SILENT}")
    first = still.read()
    wire.clock.sleep(0.25)
    second = still.read()
    assert second.age_s[1] - first.age_s[1] == pytest.approx(second.time_s - first.time_s)
    assert second.age_s[0] < 0.02
    assert not second.fresh[1]
    np.testing.assert_array_equal(first.position_rad[1], second.position_rad[1])


def test_states_cannot_be_written_to(still: Bus) -> None:
    state = still.read()
    for name in ("position_rad", "velocity_rad_s", "fresh", "age_s", "silent", "error", "torque", "voltage_v"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(state, name)[:] = 0


def test_slow_values_arrive_in_si_units(wire: VirtualBus, still: Bus) -> None:
    for servo in wire.servos:
        wire.fault(f"temp:{servo.id}:{30 + servo.id}")
    state = read_until(still, lambda state: state.temperature_c.tolist() == [31.0, 32.0, 37.0])
    assert state.torque.all()
    assert not state.error.any()
    table = load_table(wire.servos[0].model)
    np.testing.assert_allclose(state.voltage_v, table.voltage / 10, atol=0.11)


def test_an_alert_is_counted_once_as_long_as_it_lasts(wire: VirtualBus, still: Bus) -> None:
    wire.fault(f"hw:{SILENT}:0x20")
    read_until(still, lambda state: bool(state.error[1] & ALERT) and not state.torque[1])
    for _ in range(10):
        state = still.read()
    assert state.error.tolist() == [0, ALERT, 0]
    assert state.hardware_error.tolist() == [0, 0x20, 0]
    assert still.report().errors == {"alert": 1, "torque_lost": 1}
    assert still.report().errors_by_servo[SILENT] == {"alert": 1, "torque_lost": 1}


def test_torque_that_goes_while_the_bus_does_not_run_is_no_error(wire: VirtualBus) -> None:
    with wire.bus() as bus:
        bus.start()
        bus.stop()
        state = read_until(bus, lambda state: not state.torque.any())
        assert not state.torque.any()
        assert "torque_lost" not in bus.report().errors


def test_three_silent_servos_cost_one_cycle_three_greetings_at_most() -> None:
    servos = [replace(contract.SERVOS[0], id=i, name=f"s{i}") for i in range(1, 9)]
    wire = VirtualBus(servos, driver={"margin_s": 0.05, "watchdog_ms": 0})
    with wire.bus() as bus:
        bus.start()
        bus.read()
        wire.fault("mute:2-8")
        bus.read()  # all are missed
        greeted: list[bytes] = []
        wire.link.tap = lambda sent, data: greeted.append(data) if sent and data[7] == 1 else None
        counts = []
        for _ in range(3):
            del greeted[:]
            bus.read()
            counts.append(len(greeted))
        assert counts == [FAILED_GREETINGS, FAILED_GREETINGS, 1]
        assert bus.report().silent == tuple(range(2, 9))
        wire.clock.sleep(PROBE_S)
        del greeted[:]
        bus.read()
        assert len(greeted) == 1, "one of the silent servos a second"
        bus.read()
        assert len(greeted) == 1
        wire.clear()


def test_all_silent_servos_that_are_back_return_at_once() -> None:
    servos = [replace(contract.SERVOS[0], id=i, name=f"s{i}") for i in range(1, 5)]
    wire = VirtualBus(servos, driver={"margin_s": 0.05, "watchdog_ms": 0})
    with wire.bus() as bus:
        bus.start()
        wire.fault("mute:2-4")
        for _ in range(4):
            bus.read()
        assert bus.report().silent == (2, 3, 4)
        wire.clear()
        wire.clock.sleep(PROBE_S)
        bus.read()
        assert bus.report().silent == ()
