"""drivers.dynamixel.telemetry over a simulated wire: who answers, who does not, and what the others notice.

Numbers are those of the fault list in docs/drivers.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drivers.base.bus import Bus
from drivers.dynamixel import telemetry
from drivers.servos.telemetry import PROBE_S
from drivers.sim.serving.virtual import VirtualBus
from tests.drivers.contract import SERVOS, pause, read_until, settle

MARGIN_S = 0.1
CALM = {"margin_s": MARGIN_S, "watchdog_ms": 0}
FIRST, SECOND, THIRD = range(3)


@pytest.fixture
def wire() -> VirtualBus:
    return VirtualBus(SERVOS)


@pytest.fixture
def bus(wire: VirtualBus) -> Iterator[Bus]:
    with wire.bus(**CALM) as running:
        running.start()
        yield running


# ---------------------------------------------------------------------------- 1: a silent servo


@pytest.mark.parametrize("how", ["mute:2", "silent:2"])
def test_a_silent_servo_costs_the_others_nothing_but_a_bounded_wait(wire: VirtualBus, bus: Bus, how: str) -> None:
    bus.read()
    wire.fault(how)
    state = bus.read()
    assert state.fresh.tolist() == [True, False, True]
    bus.read()
    waits = []
    for _ in range(50):
        wire.clock.sleep(0.05)
        start = wire.clock()
        state = bus.read()
        waits.append(wire.clock() - start)
        assert state.fresh.tolist() == [True, False, True]
        assert state.silent.tolist() == [False, True, False]
        assert state.age_s[SECOND] > 0
    assert sum(wait > MARGIN_S for wait in waits) <= 1 + 50 * 0.05 / PROBE_S + sum(waits) / PROBE_S
    report = bus.report()
    assert report.silent == (2,)
    assert report.errors == {"no_reply": 1}
    assert report.errors_by_servo == {2: {"no_reply": 1}}
    wire.clear()
    state = read_until(bus, lambda s: bool(s.fresh.all()))
    assert not state.silent.any()
    assert bus.report().silent == ()
    bus.stop()


def test_a_silent_servo_that_is_found_by_another_question_is_no_longer_silent(wire: VirtualBus, bus: Bus) -> None:
    wire.fault("mute:2")
    for _ in range(3):
        state = bus.read()
    assert state.silent.tolist() == [False, True, False]
    wire.clear()
    bus.recover()
    state = bus.read()
    assert state.fresh.all()
    assert not state.silent.any()
    assert bus.report().silent == ()


def test_the_last_known_position_of_a_silent_servo_stays_and_is_marked(wire: VirtualBus, bus: Bus) -> None:
    settle(bus, [0.3, 0.3, 0.3])
    wire.fault("mute:2")
    for _ in range(3):
        state = bus.read()
    assert not state.fresh[SECOND]
    assert state.position_rad[SECOND] == pytest.approx(0.3, abs=0.01)
    assert state.age_s[SECOND] > state.age_s[FIRST]
    wire.clear()


@pytest.mark.parametrize(("fast", "at_once"), [(True, [False, True, True]), (False, [False, False, False])])
def test_nobody_answers_behind_a_silent_servo(wire: VirtualBus, fast: bool, at_once: list[bool]) -> None:
    """A joint reply that is cut off is asked for plainly at once; where a plain one is, the next cycle has them."""
    with wire.bus(fast=fast, **CALM) as bus:
        bus.start()
        bus.read()
        wire.fault("mute:1", "chain-stop")
        assert bus.read().fresh.tolist() == at_once
        for _ in range(5):
            assert bus.read().fresh.tolist() == [False, True, True]
        assert bus.report().silent == (1,)
        wire.clear()


@pytest.mark.parametrize("mute", [1, 2, 7])
def test_a_servo_that_cuts_off_a_joint_reply_costs_the_others_nothing(wire: VirtualBus, bus: Bus, mute: int) -> None:
    bus.read()
    wire.fault(f"mute:{mute}")
    others = [servo.id != mute for servo in SERVOS]
    for _ in range(5):
        assert bus.read().fresh.tolist() == others
    assert bus._telemetry._fast, "the servos do know fast reads"
    wire.clear()


def test_when_all_supply_is_gone_and_back_all_return_at_once(wire: VirtualBus, bus: Bus) -> None:
    bus.read()
    wire.fault("mute:*")
    state = read_until(bus, lambda s: bool(s.silent.all()))
    assert not state.fresh.any()
    wire.clear()
    state = read_until(bus, lambda s: bool(s.fresh.any()))
    assert bus.read().fresh.all()


# ---------------------------------------------------------------------------- 6, 7, 8: alerts and lost torque


def test_an_overload_is_seen_while_the_others_move_on(wire: VirtualBus, bus: Bus) -> None:
    bus.read()
    wire.fault("hw:2:0x20")
    assert bus.read().error[SECOND] & 0x80
    state = read_until(bus, lambda s: bool(s.hardware_error[SECOND]) and not s.torque[SECOND])
    assert state.hardware_error.tolist() == [0, 0x20, 0]
    assert state.fresh.all()
    report = bus.report()
    assert (report.errors["alert"], report.errors["torque_lost"]) == (1, 1)
    settle_others(bus, 0.2)
    assert not wire.servo(2).torque, "torque must not come back by itself"


def settle_others(bus: Bus, target: float) -> None:
    end = bus._clock() + 10
    while bus._clock() < end:
        bus.write(np.full(3, target))
        state = bus.read()
        if np.abs(state.position_rad[[FIRST, THIRD]] - target).max() < 0.01:
            return
        pause(bus)
    raise AssertionError(state.position_rad)


def test_data_with_the_alert_bit_is_used(wire: VirtualBus, bus: Bus) -> None:
    wire.fault("alert:2")
    state = settle(bus, [0.2, 0.2, 0.2])
    assert state.fresh.all()
    assert state.error.tolist() == [0, 0x80, 0]
    assert bus.report().errors == {"alert": 1}
    wire.clear()
    assert read_until(bus, lambda s: not s.error.any()).fresh.all()


def test_torque_that_goes_without_a_word_is_noticed(wire: VirtualBus, bus: Bus) -> None:
    bus.read()
    wire.servo(7).put("Torque Enable", 0)
    cycles = 0
    while bus.read().torque[THIRD]:
        cycles += 1
        assert cycles < 50, "at 50 Hz it must be seen within a second"
    assert bus.report().errors_by_servo == {7: {"torque_lost": 1}}


# ---------------------------------------------------------------------------- 13, 14, 19: wrong bytes


@pytest.mark.parametrize(
    "fault", ["crc:2:every=3", "flip:2:every=3", "short:2:every=3", "noise:2:every=3", "wrongid:2:9:every=4"]
)
def test_damaged_answers_cost_a_cycle_and_give_no_wrong_value(wire: VirtualBus, bus: Bus, fault: str) -> None:
    settle(bus, [0.3, 0.3, 0.3])
    wire.fault(fault)
    stale = 0
    for _ in range(12):
        state = bus.read()
        stale = stale + 1 if not state.fresh[SECOND] else 0
        assert stale <= 2, "a damaged answer may cost its own cycle and, by chance of the fault, the next"
        np.testing.assert_allclose(state.position_rad, 0.3, atol=0.01)
        assert state.fresh[FIRST]
        assert state.fresh[THIRD]
    wire.clear()


def test_a_servo_that_answers_under_anothers_id_gives_nobody_a_wrong_value(wire: VirtualBus, bus: Bus) -> None:
    settle(bus, [0.3, -0.3, 0.1])
    wire.fault("wrongid:1:7:every=3")
    for _ in range(12):
        np.testing.assert_allclose(bus.read().position_rad, [0.3, -0.3, 0.1], atol=0.01)
    wire.clear()


def test_late_answers_are_never_taken_for_others(wire: VirtualBus) -> None:
    with wire.bus(margin_s=0.03, watchdog_ms=0) as bus:
        bus.start()
        settle(bus, [0.3, -0.2, 0.1])
        wire.fault("late:2:36ms:every=3")
        for _ in range(25):
            state = bus.read()
            np.testing.assert_allclose(state.position_rad, [0.3, -0.2, 0.1], atol=0.01)
            known = ~np.isnan(state.voltage_v)
            np.testing.assert_allclose(state.voltage_v[known], 5.0, atol=0.5)
        assert bus.report().errors_by_servo[2]["no_reply"] > 0
        wire.clear()
        read_until(bus, lambda s: bool(s.fresh.all()))


def test_an_adapter_that_echoes_loses_nothing(wire: VirtualBus) -> None:
    wire.fault("echo")
    with wire.bus(**CALM) as bus:
        bus.start()
        state = settle(bus, [0.2, 0.2, 0.2])
        assert state.fresh.all()
        assert bus.report().errors == {}


def test_header_bytes_in_the_data_are_read_right(wire: VirtualBus, bus: Bus) -> None:
    bus.stop()
    wire.servo(2).place(0x100 * 8 + 0xFD)
    wire.servo(7).place(4095)
    state = bus.read()
    assert state.fresh.all()
    assert bus.scale.ticks(state.position_rad).tolist()[1:] == [0x8FD, 4095]


# ---------------------------------------------------------------------------- fast reads


def test_servos_that_ignore_fast_reads_are_read_plainly(wire: VirtualBus) -> None:
    for servo in wire.chain.servos:
        servo.table.fast_read = False
    try:
        with wire.bus(fast=True, **CALM) as bus:
            bus.start()
            state = read_until(bus, lambda s: bool(s.fresh.all()))
            assert not state.silent.any()
    finally:
        for servo in wire.chain.servos:
            servo.table.fast_read = True


def test_fast_reads_come_back_after_a_fault_has_passed(wire: VirtualBus, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(telemetry, "FAST_RETRY_S", 0.2)
    table = wire.chain.servos[0].table
    with wire.bus(fast=True, **CALM) as bus:
        bus.start()
        try:
            for servo in wire.chain.servos:
                servo.table.fast_read = False
            read_until(bus, lambda s: not bus._telemetry._fast)
            assert bus.read().fresh.all(), "plain reads answer"
        finally:
            for servo in wire.chain.servos:
                servo.table.fast_read = True
        assert table.fast_read
        read_until(bus, lambda s: bus._telemetry._fast)
        for _ in range(5):
            assert bus.read().fresh.all()
        assert bus._telemetry._fast


def test_fast_reads_are_tried_again_after_twice_the_time_each_time_until_one_is_answered(wire: VirtualBus) -> None:
    lost, answered = (SimpleNamespace(joint_lost=is_lost, replies={1: b""}) for is_lost in (True, False))
    with wire.bus(fast=True, **CALM) as bus:
        reads: Any = bus._telemetry
        for pause_s in (5.0, 10.0, 20.0, 40.0, 80.0, 160.0, 320.0, 320.0):
            while reads._fast:
                reads._count_fast_failures(lost, 1000.0)
            assert reads._next_fast_s == 1000.0 + pause_s
            reads._try_fast_again()
        reads._count_fast_failures(answered, 1000.0)
        while reads._fast:
            reads._count_fast_failures(lost, 1000.0)
        assert reads._next_fast_s == 1005.0


def test_mixed_models_share_a_wire() -> None:
    servos = [
        SERVOS[0],
        type(SERVOS[0])(2, "eye", "xl320", -0.5, 0.5, 5.0, 100.0),
        type(SERVOS[0])(3, "neck", "xm430-w350", -0.5, 0.5, 4.0, 100.0),
    ]
    with VirtualBus(servos).bus(**CALM) as bus:
        bus.start()
        state = settle(bus, [0.2, 0.2, 0.2], tolerance=0.02)
        assert np.isnan(state.current_a).tolist() == [False, True, False]
        assert not np.isnan(state.velocity_rad_s).any()
        state = read_until(bus, lambda s: not np.isnan(s.voltage_v).any())
        np.testing.assert_allclose(state.voltage_v, [5.0, 7.4, 12.0], atol=0.5)
