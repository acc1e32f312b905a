"""drivers.core.wirebus: losing a port, coming back, and stopping whatever happens, over a simulated board."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest

from drivers.base.bus import Bus, BusState, ServoSpec
from drivers.base.errors import BusError, DriverError, NoReply, PortLost, PortMissing, ServoRefused
from drivers.core.wirebus import MAX_ATTEMPT_S, RETRY_DELAY_FACTOR
from drivers.sim.serving.virtual import VirtualBus

SERVOS = tuple(ServoSpec(i, f"s{i}", "rc-180", -0.5, 0.5, 2.0, 50.0) for i in (1, 4))


CHAIN = tuple(ServoSpec(i, f"s{i}", "xl330-m288", -0.5, 0.5, 2.0, 50.0) for i in (1, 4))


@pytest.fixture
def board() -> VirtualBus:
    return VirtualBus(SERVOS, "maestro", driver={"stagger_s": 0.0, "margin_s": 0.02}, baud=115_200)


def outputs(board: VirtualBus) -> list[float]:
    rows = {row["id"]: row["pulse_us"] for row in board.line.describe(board.clock())}
    return [rows[servo.id] for servo in SERVOS]


def test_goals_need_a_started_bus_and_an_angle_for_each_servo(board: VirtualBus) -> None:
    with board.bus() as bus:
        with pytest.raises(BusError, match="the bus on virtual is not started") as caught:
            bus.write([0.0, 0.0])
        assert (caught.value.hint, caught.value.port) == ("call start()", "virtual")
        bus.start()
        for wrong in ([0.0], [0.0] * 3, [[0.0, 0.0]], 0.0):
            with pytest.raises(ValueError, match=r"angle_rad: shape .*, expected \(2,\)"):
                bus.write(wrong)
        assert bus.report().writes == 0


def test_a_closed_bus_says_what_to_call(board: VirtualBus) -> None:
    bus = board.bus()
    for use in (bus.read, bus.start, bus.discover):
        with pytest.raises(PortLost, match="port virtual is not open") as caught:
            use()
        assert (caught.value.hint, caught.value.servo_ids) == ("call open()", (1, 4))
    assert bus.report().errors == {}


def test_cycles_and_writes_are_counted_and_goals_limited(board: VirtualBus) -> None:
    with board.bus() as bus:
        bus.start()
        board.clock.sleep(0.01)
        sent = bus.write([0.5, np.nan])
        np.testing.assert_allclose(sent, [0.02, 0.0], atol=1e-3)
        assert not sent.flags.writeable
        bus.read()
        bus.read()
        report = bus.report()
        assert (report.cycles, report.writes, report.speed_limited, report.refused_targets) == (2, 1, 1, 1)


def test_starting_twice_brings_nothing_up_again(board: VirtualBus) -> None:
    with board.bus() as bus:
        bus.start()
        bus._bring_up = None  # a second one would fail
        bus.start()
        assert bus.running


@pytest.mark.parametrize("use", ["write", "read"])
def test_a_loss_is_counted_once_and_nothing_goes_out_until_it_is_back(
    board: VirtualBus, use: str, caplog: pytest.LogCaptureFixture
) -> None:
    with board.bus() as bus:
        bus.start()
        board.fault("unplug")
        call = {"write": lambda: bus.write([0.0, 0.0]), "read": bus.read}[use]
        with caplog.at_level(logging.ERROR), pytest.raises(PortLost, match="went away"):
            call()
        assert caplog.messages == ["port virtual went away"]
        for again in (lambda: bus.write([0.0, 0.0]), bus.read):
            with pytest.raises(PortLost, match="port virtual is lost") as caught:
                again()
            assert "reconnect()" in caught.value.hint
        assert bus.report().errors == {"port_lost": 1}
        assert bus.running and not bus.is_open
        board.clear()
        bus.reconnect()
        bus.write([0.0, 0.0])
        assert bus.read().torque.all()


def test_coming_back_starts_from_where_the_servos_are(board: VirtualBus) -> None:
    with board.bus() as bus:
        bus.start()
        board.fault("unplug")
        with pytest.raises(PortLost):
            bus.read()
        board.clear()
        board.line.channels[1].go(4 * 1700.0, board.clock())  # another hand moved it
        bus.reconnect()
        sent = bus.write([0.0, 0.0])
        np.testing.assert_allclose(sent, [200 * np.pi / 2000, 0.0], atol=0.1)
        assert sent[0] > 0.2  # no jump to the old goal


def test_a_start_that_fails_on_the_way_back_leaves_the_bus_lost(board: VirtualBus) -> None:
    with board.bus() as bus:
        bus.start()
        board.fault("unplug")
        with pytest.raises(PortLost):
            bus.read()
        with pytest.raises(PortMissing):
            bus.reconnect()
        board.clear()
        board.fault("mute:*")
        with pytest.raises(NoReply):
            bus.reconnect()
        assert not bus.is_open
        with pytest.raises(PortLost, match="is lost"):
            bus.write([0.0, 0.0])
        board.clear()
        bus.reconnect()
        bus.write([0.0, 0.0])


def test_a_bus_that_was_not_started_is_not_started_on_the_way_back(board: VirtualBus) -> None:
    with board.bus() as bus:
        bus.reconnect()
        assert bus.is_open and not bus.running
        assert outputs(board) == [0, 0]


def test_a_loss_while_starting_is_a_loss(board: VirtualBus) -> None:
    with board.bus() as bus:
        board.fault("unplug")
        with pytest.raises(PortLost):
            bus.start()
        assert bus.report().errors == {"port_lost": 1}
        assert not bus.running
        board.clear()


def test_stopping_takes_a_lost_port_again_to_switch_off(board: VirtualBus) -> None:
    bus = board.bus()
    bus.open()
    bus.start()
    board.fault("unplug")
    with pytest.raises(PortLost):
        bus.read()
    board.clear()
    assert all(outputs(board))
    bus.stop()
    assert outputs(board) == [0, 0]
    assert not bus.running
    bus.stop()  # nothing is left to do
    bus.close()


def test_servos_behind_a_port_that_does_not_come_back_are_not_confirmed_off(board: VirtualBus) -> None:
    bus = board.bus()
    bus.open()
    bus.start()
    board.fault("unplug")
    with pytest.raises(PortLost):
        bus.read()
    with pytest.raises(
        PortLost, match="servos not confirmed off, because their port is gone: no port virtual"
    ) as caught:
        bus.stop()
    assert (caught.value.hint, caught.value.servo_ids) == ("switch the servos' power off", (1, 4))
    assert not bus.running


def test_an_error_of_a_bus_names_port_and_servos(board: VirtualBus) -> None:
    bus = board.bus()
    every = bus._error(ServoRefused, "no", "try again")
    assert (type(every), str(every), every.hint) == (ServoRefused, "no", "try again")
    assert (every.port, every.servo_ids) == ("virtual", (1, 4))
    assert bus._error(NoReply, "no", indices=[1]).servo_ids == (4,)
    assert bus._error(NoReply, "no", indices=[]).servo_ids == ()


def test_the_report_is_a_copy_in_depth(board: VirtualBus) -> None:
    with board.bus() as bus:
        bus.report().count("no_reply", 1)
        assert bus.report().errors == {} and bus.report().errors_by_servo == {}


def test_a_bus_whose_servos_all_fail_when_the_port_is_back_is_started_again_by_the_next_try() -> None:
    wire = VirtualBus(CHAIN, "dynamixel")
    bus = wire.bus()
    with bus:
        bus.start()
        wire.fault("unplug:for=1s")
        with pytest.raises(PortLost):
            bus.read()
        wire.clock.sleep(1.1)
        wire.fault("silent:*")
        for _ in range(2):
            with pytest.raises(DriverError):
                bus.reconnect()
            assert bus.running and not bus.is_open
        wire.clear()
        bus.reconnect()
        assert bus.driven.all()
        bus.write([0.0] * len(CHAIN))


def test_servos_that_may_be_on_after_a_start_that_failed_are_switched_off() -> None:
    wire = VirtualBus(CHAIN, "dynamixel")
    bus = wire.bus()
    with bus:
        bus.start()
        bus.stop()
        wire.fault("mute:*")
        with pytest.raises(DriverError):
            bus.start(partly=True)
        assert not bus.running
        for servo in wire.chain.servos:
            servo.plant.powered = True
        wire.clear()
        bus.stop()
        assert not any(servo.torque for servo in wire.chain.servos)


def drive(wire: VirtualBus, bus: Bus, seconds: float) -> list[int]:
    """Cycles with all servos wanted at 0.3 rad; returns the goals that servo 1 had."""
    goals, end = [], wire.clock() + seconds
    while wire.clock() < end:
        bus.write([0.3, 0.3])
        goals.append(wire.chain.servo(1).goal)
        bus.read()
        wire.clock.sleep(0.02)
    return goals


@pytest.mark.parametrize("model", ["xl330-m288", "sts3215", "ax-12a"])
def test_a_servo_that_comes_back_far_from_its_goal_is_started_again_from_there(
    model: str, caplog: pytest.LogCaptureFixture
) -> None:
    servos = [ServoSpec(i, f"s{i}", model, -1.0, 1.0, 2.0, 50.0) for i in (1, 4)]
    wire = VirtualBus(servos, "feetech" if model == "sts3215" else "dynamixel", driver={"margin_s": 0.02})
    servo = wire.chain.servo(1)
    rad = servo.table.rad_per_tick
    with wire.bus() as bus, caplog.at_level(logging.WARNING):
        bus.start()
        drive(wire, bus, 0.5)
        wire.fault("mute:1")
        drive(wire, bus, 0.5)
        servo.reboot(wire.clock())  # its supply was gone, and somebody has turned it
        servo.place(servo.table.center - 0.9 / rad, wire.clock())
        wire.clear()
        goals = drive(wire, bus, 3.0)
        assert "far from its last goal of 0.30 rad" in caplog.text
        assert "is driven again" in caplog.text
        on = [goal for goal in goals if goal < servo.table.center]
        assert abs(on[0] * rad - servo.table.center * rad + 0.9) < 0.1, "it begins where it is"
        assert np.abs(np.diff(on)).max() * rad < 0.2, "and goes on from there at its speed"
        assert servo.torque and goals[-1] == pytest.approx(servo.table.center + 0.3 / rad, abs=2)


def test_a_wrong_position_that_is_read_twice_becomes_no_goal(monkeypatch: pytest.MonkeyPatch) -> None:
    wire = VirtualBus(CHAIN, "dynamixel", driver={"margin_s": 0.02})
    with wire.bus() as bus:
        bus.start()
        drive(wire, bus, 0.5)
        wire.fault("mute:1")
        drive(wire, bus, 0.5)
        wire.clear()
        ask = bus._ask

        def wrong() -> BusState:
            state = ask()
            position = state.position_rad.copy()
            position[0] = np.where(state.fresh[0], -1.57, position[0])
            return replace(state, position_rad=position)

        with monkeypatch.context() as patch:
            patch.setattr(bus, "_ask", wrong)
            goals = drive(wire, bus, 1.5)
        goals += drive(wire, bus, 2.0)
        center, rad = wire.chain.servo(1).table.center, wire.chain.servo(1).table.rad_per_tick
        assert min(goals) > center + 0.2 / rad, "it was sent to a position that it never had"
        assert bus.driven.all()


def test_a_port_that_goes_away_while_it_is_opened_is_not_left_open(
    board: VirtualBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone(data: bytes) -> None:
        raise PortLost("it went away")

    bus = board.bus()
    monkeypatch.setattr(board.link, "write", gone)  # a Maestro is sent a byte by which it finds the rate
    with pytest.raises(PortLost):
        bus.open()
    assert not bus.is_open
    monkeypatch.undo()
    with bus:
        bus.start()


def stuck(
    wire: VirtualBus, bus: Bus, monkeypatch: pytest.MonkeyPatch, *indices: int, takes_s: float = 3.0
) -> list[float]:
    """Leave all servos out; an attempt to start one of these takes so long and fails. Returns the times of attempts."""
    attempts: list[float] = []
    join = bus._join

    def slow(index: int) -> float:
        if index not in indices:
            return join(index)
        attempts.append(wire.clock())
        wire.clock.sleep(takes_s)
        raise BusError("it does not run")

    monkeypatch.setattr(bus, "_join", slow)
    for index in range(len(bus.ids)):
        bus._give_up(index, BusError("it is off"))
    return attempts


def test_one_that_takes_long_to_fail_does_not_hold_up_those_that_wait_to_join(monkeypatch: pytest.MonkeyPatch) -> None:
    wire = VirtualBus(CHAIN)
    with wire.bus(watchdog_ms=0) as bus:
        bus.start()
        attempts = stuck(wire, bus, monkeypatch, 0)
        while not bus.driven[1]:
            bus.read()
            wire.clock.sleep(0.02)
            assert wire.clock() < 10.0, "the second servo waits for the first"
        assert len(attempts) == 1


def test_all_servos_wait_a_tenth_of_the_time_at_most_for_those_that_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    wire = VirtualBus(CHAIN)
    with wire.bus(watchdog_ms=0) as bus:
        bus.start()
        attempts = stuck(wire, bus, monkeypatch, 0, 1)
        while wire.clock() < 600.0:
            bus.read()
            wire.clock.sleep(0.02)
        assert 0.05 < 3.0 * len(attempts) / wire.clock() < 0.11


def test_a_process_that_was_stopped_in_an_attempt_tries_again_within_minutes(monkeypatch: pytest.MonkeyPatch) -> None:
    """The pause of the process is not how long the servo takes to fail."""
    wire = VirtualBus(CHAIN)
    with wire.bus(watchdog_ms=0) as bus:
        bus.start()
        attempts = stuck(wire, bus, monkeypatch, 0, takes_s=6 * 3600.0)
        for _ in range(round(2.0 * RETRY_DELAY_FACTOR * MAX_ATTEMPT_S)):
            bus.read()
            wire.clock.sleep(1.0)
        assert len(attempts) >= 2 and bus.driven[1]
