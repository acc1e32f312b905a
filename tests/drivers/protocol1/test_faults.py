"""The fault list of docs/drivers.md over the drivers of Protocol 1.0 framing, each with its pass condition.

Tests run over every way of reading back: STS (sync read), AX (one by one), and AX, MX and X-series on one wire; some
over SCS (one by one, high byte first) too. Numbers are those of the list; see test_protocol1_startup.py for those
about starting.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from drivers import open_bus
from drivers.base.bus import Bus, BusState
from drivers.base.errors import NoReply, PortBusy, PortLost, PortMissing, ServoFault
from drivers.protocol1.exchange import Exchanges
from drivers.servos.exchange import Exchange
from drivers.sim import SimulatedBus
from drivers.sim.serving.virtual import VirtualBus
from tests.drivers import contract
from tests.drivers.contract import pause, read_until, settle

MARGIN_S = 0.1
SHORT_S = 0.03
CALM = {"margin_s": MARGIN_S, "watchdog_ms": 0}
FAMILIES = {
    "sts": ("feetech", ("sts3215",) * 3),
    "scs": ("feetech", ("scs0009",) * 3),
    "ax": ("dynamixel", ("ax-12a",) * 3),
    "both": ("dynamixel", ("xm430-w350", "ax-12a", "mx1-28")),
}
POSE = [0.2, -0.3, 0.5]
STEP_RAD = np.deg2rad(300) / 1024


class Head:
    """Simulated servos in time that does not pass by itself, and drivers over them."""

    def __init__(self, family: str) -> None:
        self.kind, models = FAMILIES[family]
        self.servos = tuple(replace(servo, model=model) for servo, model in zip(contract.SERVOS, models, strict=True))
        self.wire = VirtualBus(self.servos, self.kind, driver=CALM)
        self.ids = [servo.id for servo in self.servos]

    def torques(self) -> list[bool]:
        """What the motors do."""
        return [self.wire.servo(servo).torque for servo in self.ids]


@pytest.fixture(params=["sts", "ax", "both"])
def head(request: pytest.FixtureRequest) -> Head:
    return Head(request.param)


@pytest.fixture
def bus(head: Head) -> Iterator[Bus]:
    with head.wire.bus() as running:
        running.start()
        yield running


def pose(bus: Bus) -> BusState:
    return settle(bus, POSE, 2 * STEP_RAD)


def wait_for(bus: Bus, margin_s: float) -> None:
    """Another time to wait for replies."""
    for half in getattr(bus, "_halves", (bus,)):
        half._port.margin_s = margin_s


def cycles(bus: Bus, count: int) -> list[BusState]:
    states = []
    for _ in range(count):
        bus.write(POSE)
        states.append(bus.read())
        pause(bus)
    return states


def assert_nothing_is_wrong(states: list[BusState]) -> None:
    """Every value that counts is the one it was while the servos stand still."""
    for state in states:
        wrong = np.abs(state.position_rad - POSE)[state.fresh] > 3 * STEP_RAD
        assert not wrong.any(), state
        assert np.all(np.isnan(state.temperature_c) | (np.abs(state.temperature_c - 30) < 5)), state
        assert np.all(np.isnan(state.voltage_v) | (state.voltage_v > 5) & (state.voltage_v < 13)), state
        assert not state.hardware_error.any()


# ---------------------------------------------------------------------------- 1: a silent servo


@pytest.mark.parametrize("how", ["mute:2", "silent:2"])
def test_1_a_silent_servo_costs_the_others_one_bounded_wait_a_second(
    head: Head, bus: Bus, how: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    bus.read()
    head.wire.fault(how)
    assert bus.read().fresh.tolist() == [True, False, True]
    bus.read()
    exchange, waits = Exchanges.exchange, []

    def counted(*arguments: Any) -> Exchange:
        got = exchange(*arguments)
        waits.extend(got.missing)
        return got

    monkeypatch.setattr(Exchanges, "exchange", counted)
    start = head.wire.clock()
    for _ in range(50):
        head.wire.clock.sleep(0.05)
        state = bus.read()
        assert state.fresh.tolist() == [True, False, True]
        assert state.silent.tolist() == [False, True, False]
    assert set(waits) <= {2}
    assert len(waits) <= 1 + (head.wire.clock() - start)
    report = bus.report()
    assert (report.silent, report.errors_by_servo) == ((2,), {2: {"no_reply": 1}})
    head.wire.clear()
    assert not read_until(bus, lambda state: bool(state.fresh.all())).silent.any()


def test_1_who_is_cut_off_by_a_silent_servo_is_back_in_the_next_cycle(head: Head, bus: Bus) -> None:
    bus.read()
    head.wire.fault("mute:1", "chain-stop")
    bus.read()
    for _ in range(3):
        assert bus.read().fresh.tolist() == [False, True, True]
    assert bus.report().silent == (1,)
    head.wire.clear()


# ---------------------------------------------------------------------------- 2: unplugged and back


def test_2_the_bus_comes_back_where_the_servos_are(head: Head, bus: Bus) -> None:
    pose(bus)
    head.wire.fault("unplug")
    with pytest.raises(PortLost, match="went away"):
        cycles(bus, 3)
    with pytest.raises(PortLost, match="is lost"):
        bus.read()
    with pytest.raises(PortMissing):
        bus.reconnect()
    assert bus.report().errors == {"port_lost": 1}
    head.wire.clear("unplug")
    bus.reconnect()
    assert head.torques() == [True] * 3
    here = [head.wire.servo(i).position_ticks for i in head.ids]
    assert [head.wire.servo(i).goal for i in head.ids] == here
    np.testing.assert_allclose(bus.read().position_rad, POSE, atol=3 * STEP_RAD)
    bus.stop()
    assert head.torques() == [False] * 3


@pytest.mark.parametrize("head", ["sts", "both"], indirect=True)
def test_2_stop_while_unplugged_names_everybody(head: Head, bus: Bus) -> None:
    head.wire.fault("unplug")
    with pytest.raises(PortLost):
        cycles(bus, 2)
    with pytest.raises(PortLost, match="not confirmed off") as caught:
        bus.stop()
    assert sorted(caught.value.servo_ids) == head.ids
    assert "power off" in caught.value.hint


# ---------------------------------------------------------------------------- 4: a dead servo on the way out


@pytest.mark.parametrize("head", ["sts", "both"], indirect=True)
def test_4_one_dead_servo_leaves_no_other_on(head: Head) -> None:
    bus = head.wire.bus()
    with pytest.raises(NoReply, match="not confirmed off") as caught, bus:
        bus.start()
        head.wire.fault("mute:2")
    assert caught.value.servo_ids == (2,)
    assert head.torques() == [False, True, False]
    assert not bus.is_open


# ---------------------------------------------------------------------------- 6, 7, 8, 18: servos in trouble


@pytest.mark.parametrize("how", ["hw:2:0x20", "temp:2:95"])
def test_6_18_a_servo_that_shuts_down_is_seen_and_stays_limp(head: Head, bus: Bus, how: str) -> None:
    pose(bus)
    head.wire.fault(how)
    head.wire.clock.sleep(0.12)
    state = read_until(bus, lambda state: not state.torque[1])
    assert state.error.tolist() == [0, 0x80, 0]
    assert state.hardware_error[1] == (0x20 if how.startswith("hw") else 0x04)
    goal = head.wire.servo(2).goal
    for _ in range(20):  # the others get new goals
        bus.write([0.0, 0.0, 0.0])
        bus.read()
        head.wire.clock.sleep(0.01)
    assert head.torques() == [True, False, True]
    assert head.wire.servo(2).goal == goal, "a goal could switch it on"
    report = bus.report()
    assert {"alert": 1, "torque_lost": 1}.items() <= report.errors_by_servo[2].items()
    np.testing.assert_allclose(bus.read().position_rad[[0, 2]], 0.0, atol=3 * STEP_RAD)


def test_6_it_comes_back_only_when_asked_and_without_a_jump(head: Head, bus: Bus) -> None:
    pose(bus)
    servo = head.wire.servo(2)
    servo.latch(0x20)
    read_until(bus, lambda state: not state.torque[1])
    with pytest.raises(ServoFault, match="0x20"):
        bus.recover([2])
    servo.place(servo.position_ticks + 60)
    here = servo.position_ticks
    for half in getattr(bus, "_halves", (bus,)):
        object.__setattr__(half.policy, "reboot_faulted", True)
    bus.recover([2])
    assert head.torques() == [True] * 3
    assert servo.position_ticks == pytest.approx(here, abs=1)
    pose(bus)


@pytest.mark.parametrize("head", ["sts", "both"], indirect=True)
def test_7_data_that_come_with_an_alert_are_used(head: Head, bus: Bus) -> None:
    bus.read()
    head.wire.fault("alert:2")
    state = bus.read()
    assert state.fresh.all()
    assert state.error.tolist() == [0, 0x80, 0]
    assert bus.read().torque.all()
    assert bus.report().errors_by_servo == {2: {"alert": 1}}


def test_8_torque_that_goes_without_a_word_is_told_and_not_given_back(head: Head, bus: Bus) -> None:
    """A dip of the supply: the servo starts again, limp and with none of its limits."""
    pose(bus)
    head.wire.chain.servo(2).reboot(head.wire.clock())
    read_until(bus, lambda state: not state.torque[1] and bool(state.fresh[1]), timeout_s=60.0)
    assert bus.report().errors_by_servo[2]["torque_lost"] == 1
    cycles(bus, 10)
    assert head.torques() == [True, False, True]
    assert not bus.read().torque[1]
    bus.recover()
    pose(bus)


# ---------------------------------------------------------------------------- 10: the port


def test_10_a_second_program_is_told() -> None:
    servos = [replace(contract.SERVOS[0], model="sts3215")]
    with SimulatedBus(servos) as wire:
        first, second = (open_bus("feetech", servos, port=wire.path, **CALM) for _ in range(2))
        with first, pytest.raises(PortBusy):
            second.open()


@pytest.mark.parametrize("head", ["sts", "both"], indirect=True)
def test_10_an_interrupt_in_a_transaction_leaves_the_bus_usable(
    head: Head, bus: Bus, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(head.wire.link, "read", interrupt)
        with pytest.raises(KeyboardInterrupt):
            bus.read()
    pose(bus)


# ---------------------------------------------------------------------------- 13, 14, 19: what comes back is wrong


@pytest.mark.slow
@pytest.mark.parametrize(
    "how",
    [
        (f"late:2:{1.2 * SHORT_S}:every=3",),
        ("short:2:1:every=2", "short:7:2:every=3"),
        ("wrongid:1:2:every=2",),
        ("flip:*:every=3", "crc:2:every=5"),
        ("noise:*:7:every=2", "drop:*:every=5"),
        ("echo", "silent:2"),
    ],
    ids=lambda how: how[0],
)
@pytest.mark.parametrize("head", FAMILIES, indirect=True)
def test_13_14_19_nothing_wrong_is_believed(head: Head, bus: Bus, how: tuple[str, ...]) -> None:
    pose(bus)
    wait_for(bus, SHORT_S)
    head.wire.fault(*how)
    states = cycles(bus, 15)
    assert_nothing_is_wrong(states)
    goals = [head.wire.servo(i).goal for i in head.ids]
    head.wire.clear()
    wait_for(bus, MARGIN_S)
    read_until(bus, lambda state: bool(state.fresh.all()))
    assert [head.wire.servo(i).goal for i in head.ids] == goals
    assert head.torques() == [True] * 3


@pytest.mark.parametrize("head", ["sts", "both"], indirect=True)
def test_19_the_echo_costs_no_cycle(head: Head, bus: Bus) -> None:
    head.wire.fault("echo")
    pose(bus)
    assert all(state.fresh.all() for state in cycles(bus, 10))
    assert bus.report().errors == {}
    assert bus.discover([1])[0].torque


def test_14_everything_at_once_while_the_head_moves(head: Head, bus: Bus) -> None:
    """Positions of moving servos are compared with the shafts', goals with the ramp."""
    pose(bus)
    head.wire.fault("flip:*:p=0.1", "drop:*:p=0.05", "noise:*:9:p=0.1", "late:*:0.12:p=0.01", "short:*:1:p=0.05")
    per_rad = [tick_per_rad(servo.model) for servo in head.servos]
    last = [head.wire.servo(i).goal for i in head.ids]
    clock = head.wire.clock
    start = at = clock()
    while at - start < 2.0:
        bus.write(0.25 * np.sin(4.0 * (at - start) + np.arange(3)))
        now = clock()
        goals = [head.wire.servo(i).goal for i in head.ids]
        for goal, before, scale in zip(goals, last, per_rad, strict=True):
            assert abs(goal - before) <= (8.0 * (now - at + 0.05)) * scale + 2
        last, at = goals, now
        head.wire.clock.sleep(0.01)
        state = bus.read()
        shafts = [head.wire.servo(i).position_ticks for i in head.ids]
        told = (state.position_rad + np.array([0, 0, 0.2])) * [1, -1, 1]
        for k in np.flatnonzero(state.fresh):
            middle = 2048 if per_rad[k] > 400 else 512
            late = clock() - at + 0.02
            assert abs(middle + told[k] * per_rad[k] - shafts[k]) <= 8.0 * late * per_rad[k] + 3
    head.wire.clear()


def tick_per_rad(model: str) -> float:
    return 1024 / np.deg2rad(300) if model in ("scs0009", "ax-12a") else 4096 / (2 * np.pi)


# ---------------------------------------------------------------------------- 20: a stalled host


@pytest.mark.parametrize("head", ["sts", "both"], indirect=True)
def test_20_after_a_stall_replies_count_and_goals_are_a_ramp(head: Head, bus: Bus) -> None:
    pose(bus)
    before = bus.write(POSE)
    head.wire.clock.sleep(0.2)
    assert np.abs(bus.write([0.4, 0.5, -0.3]) - before).max() <= 8.0 * 0.05 + 2 * STEP_RAD
    assert bus.read().fresh.all()
