"""controller.robot.busloop on simulated servos: what is sent before, between and after, and what never is."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.base.stop_latch import StopLatch
from controller.robot import busloop as module
from controller.robot.buses import read_bus
from controller.robot.busloop import BusLoop
from controller.robot.settings import ChannelSettings, RuleSettings, TimingRule
from drivers.base.errors import DriverError, NoReply, PortBusy, PortLost
from drivers.sim import SimulatedBus

JAW, YAW = P.index("jawOpen"), P.index("headYaw")
TICKS = 4096 / 360


def channel(name: str, servo: int, mix: str, deg: float) -> ChannelSettings:
    return ChannelSettings.model_validate(
        {
            "name": name,
            "bus": "b",
            "id": servo,
            "model": "xl330-m288",
            "mix": {mix: 1.0},
            "map": {"at": [-1, 1], "deg": [-deg, deg]},
            "limit_deg": [-40, 40],
            "max_speed_deg_s": 120,
            "max_accel_deg_s2": 1200,
        }
    )


SHORT = {"margin_s": 0.2, "watchdog_ms": 0}
"""For buses with a silent servo: the others wait for it."""
CHANNELS = [channel("jaw", 1, "jawOpen", 30.0), channel("yaw", 2, "headYaw", 60.0)]


class Face:
    """The newest parameters, as the body hands them out."""

    def __init__(self) -> None:
        self.values, self.stamp = P.neutral(), 0

    def __call__(self) -> tuple[np.ndarray, int]:
        return self.values, self.stamp


def until(condition: Callable[[], bool]) -> None:
    """Wait by counting: a machine that stood still for a while is no fault of the program."""
    for _ in range(2000):
        if condition():
            return
        time.sleep(0.01)
    raise AssertionError("waited in vain")


def ticked(loop: BusLoop, count: int) -> None:
    """Wait until the loop has begun so many more ticks."""
    before = loop.clock.ticks
    until(lambda: loop.clock.ticks >= before + count)


def make(servos: SimulatedBus, face: Face, options: dict[str, Any] | None = None, **more: Any) -> BusLoop:
    table = {"name": "b", "kind": "dynamixel", "port": servos.path, "rate_hz": 50, "margin_s": 2.0} | (options or {})
    return BusLoop(read_bus(table), CHANNELS, P, face, **more)


@contextmanager
def running(servos: SimulatedBus, face: Face, options: dict[str, Any] | None = None, **more: Any) -> Iterator[BusLoop]:
    loop = make(servos, face, options, **more)
    loop.start()
    try:
        yield loop
    finally:
        loop.stop()


@pytest.fixture
def servos(tmp_path: Path) -> Iterator[SimulatedBus]:
    with SimulatedBus([1, 2], link=tmp_path / "port") as bus:
        yield bus


def degrees(servos: SimulatedBus, servo: int) -> float:
    return (servos.servo(servo).goal - 2048) / TICKS


def test_servos_are_held_where_they_are_until_the_face_begins(servos: SimulatedBus) -> None:
    servos.servo(1).place(2048 + 10 * TICKS)
    servos.servo(2).place(2048 - 50 * TICKS)  # outside of its limits
    face = Face()
    face.values[JAW] = 1.0
    with running(servos, face) as loop:
        ticked(loop, 5)
        assert loop._goals.period_s == pytest.approx(0.02) and loop.clock.period_ns == 20_000_000
        assert degrees(servos, 1) == pytest.approx(10.0, abs=0.2)
        until(lambda: abs(degrees(servos, 2) + 40.0) < 0.2)
        assert loop.report()["face_difference"] == {} and loop.held == 0
        loop.begin()
        until(lambda: abs(degrees(servos, 1) - 30.0) < 0.2)
        until(lambda: abs(degrees(servos, 2)) < 0.2)
        state = loop.measured()
        assert state is not None and loop.error is None
    assert not servos.servo(1).torque and not servos.servo(2).torque


@pytest.mark.slow
def test_the_report_counts_commands_limits_rules_and_differences(servos: SimulatedBus) -> None:
    face = Face()
    face.values[[JAW, YAW]] = 1.0
    face.stamp = time.monotonic_ns()
    rule = TimingRule(channels=["jaw"], toward="high", extreme=0.1, hold_s=0, fall_s=0.1, rest_s=60, recover_s=1)
    with running(servos, face, rules=RuleSettings(timing=[rule])) as loop:
        loop.begin()
        until(lambda: bool(loop.report()["rules"]))
        ticked(loop, 5)
        report = loop.report()
    assert report["name"] == "b" and report["servos"] == 2 and report["fault"] is None
    assert 0 < report["channels_held_at_limit"] <= loop.held  # type: ignore[operator]  # the yaw wants 60 of 40 degrees
    assert loop.latency_ms.count == 1  # one command, however many cycles show it
    assert report["command_to_wire_ms"]["max"] > 0.0  # type: ignore[index]
    assert report["rules"][0]["rule"] == "timing jaw toward high"  # type: ignore[index]
    assert set(report["face_difference"]["regions_rms_deg"]) == {"jaw", "head"}  # type: ignore[index]
    assert set(report["bus"]["errors"]) <= {"watchdog"}  # type: ignore[index]  # where the machine is busy for so long


def test_servos_are_led_to_the_neutral_face_before_they_go_limp(servos: SimulatedBus) -> None:
    face = Face()
    face.values[JAW] = 1.0
    with running(servos, face) as loop:
        loop.begin()
        until(lambda: servos.servo(1).position_ticks > 2048 + 29 * TICKS)
    assert servos.servo(1).position_ticks == pytest.approx(2048, abs=2 * TICKS)
    assert not servos.servo(1).torque


def test_nothing_is_sent_while_a_pose_is_not_known(servos: SimulatedBus, monkeypatch: pytest.MonkeyPatch) -> None:
    """A servo that came up and then keeps silent: where it is is not known, so no goal is safe."""
    servos.servo(1).place(2048 + 20 * TICKS)
    loop = make(servos, Face(), {"margin_s": 0.3})  # it is asked again and again
    real = loop.bus.start

    def start() -> None:
        real()
        servos.fault("silent:1")  # it would obey, but does not answer

    def close() -> None:
        servos.clear()  # so that the motors are confirmed off
        shut()

    shut, sent = loop.bus.close, []
    monkeypatch.setattr(loop.bus, "start", start)
    monkeypatch.setattr(loop.bus, "close", close)
    monkeypatch.setattr(loop.bus, "write", sent.append)
    monkeypatch.setattr(module, "_MAX_START_READS", 3)
    with pytest.raises(NoReply, match="the position of jaw is not known") as caught:
        loop.start()
    assert "yaw" not in str(caught.value) and caught.value.hint
    assert loop._thread is None and sent == []
    assert not servos.servo(1).torque
    with running(servos, Face()):  # the port was given back
        pass


@pytest.mark.slow
def test_a_single_missed_answer_is_asked_for_again(servos: SimulatedBus, monkeypatch: pytest.MonkeyPatch) -> None:
    loop = make(servos, Face())
    real = loop.bus.start

    def start() -> None:
        real()
        servos.fault("drop:1:count=1")

    monkeypatch.setattr(loop.bus, "start", start)
    loop.start()
    loop.stop()
    assert loop.error is None


def test_a_lost_port_comes_back_and_motion_goes_on_from_the_measured_pose(
    servos: SimulatedBus, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(module, "_RETRY_INTERVAL_NS", 50_000_000)
    face = Face()
    with running(servos, face) as loop, caplog.at_level(logging.WARNING):
        loop.begin()
        ticked(loop, 3)
        servos.fault("unplug:for=0.3s")
        until(lambda: loop._retry_ns is not None)
        servos.servo(1).put("Torque Enable", 0)
        servos.servo(1).place(2048 - 25 * TICKS)
        before = loop._goals.sent[0]
        until(lambda: loop._retry_ns is None)
        assert before == pytest.approx(0.0, abs=0.01)
        first = loop._goals.sent[0]
        assert first < np.radians(-2.0)  # not a jump back to 0, whatever little of the ramp is over
        until(lambda: abs(degrees(servos, 1)) < 0.2)
        assert loop.error is None
    messages = [record.getMessage() for record in caplog.records]
    assert any("trying again every 0.05 s" in message for message in messages)
    assert sum("is not back" in message for message in messages) <= 1  # one reason is logged once
    assert sum(message == "bus b is back" for message in messages) == 1


@pytest.mark.slow
def test_no_goal_is_sent_to_a_servo_that_does_not_say_where_it_is_after_a_reconnect(
    servos: SimulatedBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The port is back and takes goals, and all servos came up, but one does not answer: it alone stays where it is."""
    monkeypatch.setattr(module, "_RETRY_INTERVAL_NS", 20_000_000)
    face = Face()
    with running(servos, face, SHORT) as loop:
        loop.begin()
        ticked(loop, 3)
        real = loop.bus.reconnect

        def reconnect() -> None:
            real()
            servos.fault("silent:2")
            face.values[[JAW, YAW]] = 1.0

        monkeypatch.setattr(loop.bus, "reconnect", reconnect)
        servos.fault("unplug:for=0.2s")
        until(lambda: abs(degrees(servos, 1) - 30.0) < 0.2)
        # On a busy machine a late reply may take the jaw out for a moment, too; it comes back by itself.
        until(lambda: loop.report()["bus"]["not_driven"] == (2,))  # type: ignore[index]
        assert abs(degrees(servos, 2)) < 0.5
        servos.clear()
        until(lambda: abs(degrees(servos, 2) - 40.0) < 0.2)
        assert loop.error is None


def resting(servos: SimulatedBus, measures: bool, states: list[tuple[bool, float]]) -> int:
    """How many goals lead to rest while the jaw answers or not, and is so many degrees away; then no more is read."""
    loop, reads = make(servos, Face()), iter(states)

    def read() -> SimpleNamespace:
        fresh, deg = next(reads, (None, 0.0))
        if fresh is None:
            raise NoReply("no more")
        at = loop.table.neutral_rad + np.radians([deg, 0.0])
        return SimpleNamespace(fresh=np.array([fresh, measures]), position_rad=at)

    sent: list[object] = []
    driven = np.ones(2, dtype=bool)
    loop.bus = SimpleNamespace(measures=measures, driven=driven, write=sent.append, read=read)  # type: ignore[assignment]
    loop._goals = SimpleNamespace(step=lambda goal, state: goal)  # type: ignore[assignment]
    loop._come_to_rest()
    return len(sent)


def test_servos_are_led_to_rest_until_each_of_them_says_that_it_is_there(
    servos: SimulatedBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    silent, far, near, there = (False, 0.0), (True, 3.0), (True, -1.2), (True, 0.0)
    assert resting(servos, True, [far, silent, near, there]) == 4
    assert resting(servos, True, [(True, -3.0), (True, 1.1), there]) == 2
    assert resting(servos, False, [silent, there]) == 1  # where nothing is measured, the goal counts
    monkeypatch.setattr(module, "_MAX_REST_NS", -(10**9))
    assert resting(servos, True, [far, far]) == 1  # not longer than the limit


def test_a_limp_bus_is_only_read(servos: SimulatedBus) -> None:
    face = Face()
    face.values[JAW] = 1.0
    goal = servos.servo(1).goal
    with running(servos, face, limp=True) as loop:
        loop.begin()
        assert not servos.servo(1).torque
        servos.servo(1).place(2048 + 15 * TICKS)
        until(lambda: (state := loop.measured()) is not None and state.position_rad[0] > np.radians(14.0))
        assert servos.servo(1).goal in (goal, 2048) and not servos.servo(1).torque
    assert servos.servo(1).position_ticks == pytest.approx(2048 + 15 * TICKS, abs=2)  # nothing led it to rest


def test_a_limp_bus_that_measures_nothing_is_warned_of_and_not_started(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = {"name": "b", "kind": "simulated", "simulates": "text", "template": "{us}\n"}
    loop = BusLoop(read_bus(table), [CHANNELS[0].model_copy(update={"model": "rc-180"})], P, Face(), limp=True)
    begun: list[bool] = []
    monkeypatch.setattr(loop.bus, "start", lambda **options: begun.append(True))  # it would move them to rest
    with caplog.at_level(logging.WARNING):
        loop.start()
    loop.stop()
    assert "does not measure its servos" in caplog.text and not begun


def test_an_error_of_the_loop_is_kept_and_the_servos_are_switched_off(servos: SimulatedBus) -> None:
    def newest() -> tuple[np.ndarray, int]:
        raise RuntimeError("mine")

    loop = make(servos, newest)  # type: ignore[arg-type]
    loop.start()
    assert servos.servo(1).torque
    loop.begin()
    until(lambda: loop.error is not None)
    loop.stop()
    assert str(loop.error) == "mine" == loop.report()["fault"]
    assert not servos.servo(1).torque


# ---------------------------------------------------------------------------- STOP and START


def stopping(servos: SimulatedBus, monkeypatch: pytest.MonkeyPatch) -> tuple[Face, StopLatch]:
    """A face with the jaw open, and a latch; failed attempts are repeated soon."""
    monkeypatch.setattr(module, "_RETRY_INTERVAL_NS", 50_000_000)
    face = Face()
    face.values[JAW] = 1.0
    return face, StopLatch()


def limp(servos: SimulatedBus) -> bool:
    return not any(servos.servo(i).register("Torque Enable") for i in (1, 2))


def test_stop_switches_off_and_start_ramps_from_where_the_servos_are(
    servos: SimulatedBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    face, latch = stopping(servos, monkeypatch)
    with running(servos, face, stop_latch=latch) as loop:
        loop.begin()
        until(lambda: abs(degrees(servos, 1) - 30.0) < 0.2)
        latch.stop("a test", 0)
        ticked(loop, 2)
        assert limp(servos) and loop.report()["stopped_by"] == "a test"
        goal = servos.servo(1).goal
        servos.servo(1).place(2048 - 25 * TICKS)
        until(lambda: (state := loop.measured()) is not None and state.position_rad[0] < np.radians(-24.0))
        ticked(loop, 3)
        assert limp(servos) and servos.servo(1).goal == goal and loop.bus.is_open, "it is only read"
        first = loop._goals.step
        steps: list[float] = []
        monkeypatch.setattr(loop._goals, "step", lambda *a: (steps.append(loop._goals.sent[0]), first(*a))[1])
        latch.start()
        until(lambda: bool(steps))
        assert np.degrees(steps[0]) == pytest.approx(-25.0, abs=0.5)
        until(lambda: abs(degrees(servos, 1) - 30.0) < 0.2)
        assert not limp(servos) and loop.report()["stopped_by"] is None
    assert loop.error is None


def test_stop_comes_before_anything_else_in_a_cycle(servos: SimulatedBus, monkeypatch: pytest.MonkeyPatch) -> None:
    """Between the latch and torque off there is no goal, and none until START."""
    face, latch = stopping(servos, monkeypatch)
    with running(servos, face, stop_latch=latch) as loop:
        loop.begin()
        ticked(loop, 3)
        calls: list[str] = []
        write, stop = loop.bus.write, loop.bus.stop
        monkeypatch.setattr(loop.bus, "write", lambda angles: (calls.append("write"), write(angles))[1])
        monkeypatch.setattr(loop.bus, "stop", lambda: (calls.append("stop"), stop())[1])
        newest = loop._newest
        monkeypatch.setattr(loop, "_newest", lambda: (latch.stop("the face itself", 0), newest())[1])
        until(lambda: "stop" in calls)
        ticked(loop, 3)
        assert calls == ["write", "stop"]


def test_stop_before_the_face_begins_and_before_the_start(
    servos: SimulatedBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    face, latch = stopping(servos, monkeypatch)
    latch.stop("a test", 0)
    powered: list[bool] = []
    with running(servos, face, stop_latch=latch) as loop:
        ticked(loop, 3)
        powered.append(limp(servos))
        latch.start()
        until(lambda: servos.servo(1).torque and servos.servo(2).torque)
        latch.stop("a test", 0)
        until(lambda: limp(servos))
        loop.begin()
        ticked(loop, 3)
        powered.append(limp(servos))
    assert powered == [True, True] and loop.error is None and limp(servos)


def test_a_port_that_comes_back_while_stopped_switches_nothing_on(
    servos: SimulatedBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    face, latch = stopping(servos, monkeypatch)
    with running(servos, face, stop_latch=latch) as loop:
        loop.begin()
        ticked(loop, 3)
        servos.fault("unplug:for=0.3s")
        until(lambda: not loop.bus.is_open)
        assert not limp(servos)
        latch.stop("a test", 0)
        until(lambda: limp(servos) and loop.bus.is_open and loop._retry_ns is None)
        servos.fault("unplug:for=0.2s")
        until(lambda: not loop.bus.is_open)
        until(lambda: loop.bus.is_open and loop._retry_ns is None)
        ticked(loop, 3)
        assert limp(servos)
        latch.start()
        until(lambda: abs(degrees(servos, 1) - 30.0) < 0.2)
    assert loop.error is None


@pytest.mark.slow
def test_a_servo_that_is_not_confirmed_off_is_switched_off_when_it_answers(
    servos: SimulatedBus, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    face, latch = stopping(servos, monkeypatch)
    with running(servos, face, SHORT, stop_latch=latch) as loop, caplog.at_level(logging.WARNING):
        loop.begin()
        ticked(loop, 3)
        servos.fault("mute:2")
        latch.stop("a test", 0)
        until(lambda: not servos.servo(1).torque and loop._retry_ns not in (None, 0))
        assert servos.servo(2).torque
        servos.clear()
        until(lambda: limp(servos) and loop._retry_ns is None)
        assert loop.bus.is_open
    assert sum("not off for certain" in record.getMessage() for record in caplog.records) == 1


def test_stop_ends_the_way_to_rest(servos: SimulatedBus, monkeypatch: pytest.MonkeyPatch) -> None:
    face, latch = stopping(servos, monkeypatch)
    with running(servos, face, stop_latch=latch) as loop:
        loop.begin()
        until(lambda: servos.servo(1).position_ticks > 2048 + 29 * TICKS)
        real = loop.bus.read

        def read() -> object:
            if loop._stopping.is_set():
                latch.stop("a test", 0)
            return real()

        monkeypatch.setattr(loop.bus, "read", read)
    assert limp(servos) and servos.servo(1).position_ticks > 2048 + 15 * TICKS


# ---------------------------------------------------------------------------- servos fail alone


@pytest.mark.slow
def test_with_a_silent_servo_the_others_are_driven_after_a_replug_and_it_joins_with_a_ramp(
    servos: SimulatedBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_RETRY_INTERVAL_NS", 50_000_000)
    monkeypatch.setattr("drivers.core.wirebus.JOIN_INTERVAL_S", 0.05)
    monkeypatch.setattr("drivers.servos.telemetry.PROBE_S", 0.2)
    face = Face()
    with running(servos, face, SHORT) as loop:
        loop.begin()
        servos.fault("mute:2")
        until(lambda: not loop.bus.driven[1])
        servos.fault("unplug:for=0.2s")
        until(lambda: not loop.bus.is_open)
        until(lambda: loop.bus.is_open and loop._retry_ns is None)
        face.values[[JAW, YAW]] = 1.0
        until(lambda: abs(degrees(servos, 1) - 30.0) < 0.2)
        until(lambda: loop.report()["bus"]["not_driven"] == (2,))  # type: ignore[index]
        assert abs(degrees(servos, 2)) < 0.5 and abs(np.degrees(loop._goals.sent[1])) < 0.5, "its goals wait for it"
        servos.clear()
        until(lambda: bool(loop.bus.driven.all()))
        assert abs(np.degrees(loop._goals.sent[1])) < 39.0, "a ramp"
        until(lambda: abs(degrees(servos, 2) - 40.0) < 0.2)
    assert loop.error is None


def test_a_second_instance_on_one_port_is_refused_and_the_first_goes_on(servos: SimulatedBus) -> None:
    face = Face()
    with running(servos, face) as loop:
        loop.begin()
        with pytest.raises(PortBusy, match="port"):
            make(servos, Face()).start()
        face.values[JAW] = 1.0
        until(lambda: abs(degrees(servos, 1) - 30.0) < 0.2)
        assert loop.error is None and loop.report()["bus"]["errors"].get("port_lost") is None  # type: ignore[index]


def test_still_servos_are_let_go_and_come_back_from_where_they_are(servos: SimulatedBus) -> None:
    face = Face()
    with running(servos, face, {"let_go_s": 0.3, "let_go_below_a": 5.0}) as loop:
        loop.begin()
        until(lambda: loop._is_idle)
        until(lambda: not servos.servo(1).torque and not servos.servo(2).torque)
        servos.servo(1).place(2048 + round(2 * TICKS))  # by hand, less than what counts as moved
        ticked(loop, 10)
        assert loop._is_idle
        goals: list[float] = []
        face.values[JAW] = 0.5
        until(lambda: not loop._is_idle)
        goals.append(degrees(servos, 1))
        assert goals[0] == pytest.approx(2.0, abs=3.0)  # from where it was, not from 15 degrees
        until(lambda: abs(degrees(servos, 1) - 15.0) < 0.2)
        assert servos.servo(1).torque
        assert loop.report()["let_go"] == {"times": 1, "sagged": 0}


@pytest.mark.parametrize("error", [NoReply("no answer", servo_ids=(2,)), PortLost("unplugged")])
@pytest.mark.parametrize("call", ["stop", "start"])
def test_a_failure_while_servos_are_let_go_or_taken_again_is_overcome(
    servos: SimulatedBus, monkeypatch: pytest.MonkeyPatch, call: str, error: DriverError
) -> None:
    """A servo that misses its confirmation, and an adapter that resets as torque goes off or comes on."""
    monkeypatch.setattr(module, "_RETRY_INTERVAL_NS", 50_000_000)
    face = Face()
    with running(servos, face, {"let_go_s": 0.2, "let_go_below_a": 5.0}) as loop:
        once, real = iter([error]), getattr(loop.bus, call)
        begun = threading.Event()

        def fails_once(**options: Any) -> None:
            failure = next(once, None) if begun.is_set() else None
            if failure is None or call == "stop":
                real(**options)
            if isinstance(failure, PortLost):
                loop.bus._note_loss()  # type: ignore[attr-defined]
            if failure is not None:
                raise failure

        monkeypatch.setattr(loop.bus, call, fails_once)
        loop.begin()
        begun.set()
        until(lambda: loop._is_idle or loop._off)
        face.values[JAW] = 1.0
        until(lambda: abs(degrees(servos, 1) - 30.0) < 0.2)
        assert loop.error is None and servos.servo(1).torque and servos.servo(2).torque


def test_a_servo_that_sags_is_taken_again_and_then_held(servos: SimulatedBus) -> None:
    face = Face()
    with running(servos, face, {"let_go_s": 0.2, "let_go_below_a": 5.0}) as loop:
        loop.begin()
        for count in (1, 2):
            until(lambda: loop._is_idle)
            servos.servo(2).place(2048 + round(10 * TICKS))
            until(lambda n=count: loop._idle.drift_wake_count == n)  # type: ignore[misc]
            until(lambda: abs(degrees(servos, 2)) < 0.2)
        ticked(loop, 40)
        assert not loop._is_idle and servos.servo(2).torque
        assert loop.report()["let_go"] == {"times": 2, "sagged": 2}
