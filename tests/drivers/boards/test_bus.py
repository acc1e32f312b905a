"""drivers.boards.bus: starting, switching off and states of a board, on a real pseudo-terminal."""

from __future__ import annotations

import logging
import math
import os
import select
import tty
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from drivers.base.bus import Floats, ServoSpec
from drivers.base.errors import NoReply, PortLost
from drivers.boards.bus import MAX_OFF_TRIES, BoardBus
from drivers.port.serialport import PSEUDO_MARGIN_S
from drivers.sim.serving.virtual import VirtualClock

SERVOS = tuple(ServoSpec(i, f"s{i}", "rc-180", -0.5, 0.4, 5.0, 50.0, rest_rad=rest) for i, rest in ((3, 0.2), (8, 0.9)))


class Plain(BoardBus):
    """A board that takes one line for each goal, and whose answers a test sets."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.present: Floats = np.full(len(self.servos), math.nan)
        self.answers: list[tuple[int, float]] = []
        self.confirmed: set[int] = set(range(len(self.servos)))
        self.refuses = False

    def _begin(self) -> Floats:
        return self.present

    def _go(self, angle_rad: Floats) -> Floats:
        for index in np.flatnonzero(np.isfinite(angle_rad)):
            self._port.write(f"{self.ids[index]}:{angle_rad[index]:.2f}\n".encode())
        if self.refuses:
            raise NoReply("refused")
        return angle_rad

    def _poll(self) -> None:
        for index, angle in self.answers:
            self._note(index, angle)

    def _off(self, index: int) -> None:
        self._port.write(f"{self.ids[index]}:off\n".encode())

    def _off_confirmed(self, index: int) -> bool:
        if index not in self.confirmed:
            raise NoReply("no answer")
        return True


@pytest.fixture
def far() -> Iterator[int]:
    """The far end of a pseudo-terminal."""
    master, slave = os.openpty()
    tty.setraw(slave)
    Plain.path_for_tests = os.ttyname(slave)  # type: ignore[attr-defined]
    yield master
    for descriptor in (master, slave):
        os.close(descriptor)


def board(**options: Any) -> Plain:
    return Plain(SERVOS, port=Plain.path_for_tests, **{"stagger_s": 0.0, "clock": VirtualClock()} | options)  # type: ignore[attr-defined]


def received(bus: Plain, far: int) -> list[str]:
    """The lines that have come since the last call."""
    bus._port.write(b"end\n")
    data = b""
    while not data.endswith(b"end\n"):
        assert select.select([far], [], [], 20)[0]
        data += os.read(far, 10_000)
    return data.decode().split()[:-1]


def test_servos_without_pulses_start_one_by_one_at_rest_inside_their_limits(far: int) -> None:
    with board() as bus:
        bus.start()
        assert received(bus, far) == ["3:0.20", "8:0.40"]
        np.testing.assert_allclose(bus.read().position_rad, [0.2, 0.4])
        assert bus.read().torque.all()


def test_pulses_that_are_there_are_taken_over(far: int) -> None:
    with board() as bus:
        bus.present = np.array([-0.3, math.nan])
        bus.start()
        assert received(bus, far) == ["8:0.40"]
        np.testing.assert_allclose(bus.read().position_rad, [-0.3, 0.4])


def test_a_servo_starts_again_where_it_was_last(far: int) -> None:
    with board() as bus:
        bus.start()
        bus.answers = [(0, -0.1)]
        bus.read()
        bus.stop()
        received(bus, far)
        bus.start()
        assert received(bus, far) == ["3:-0.10", "8:0.40"]


def test_servos_are_switched_on_with_pauses(far: int) -> None:
    with board(stagger_s=0.25) as bus:
        pauses: list[float] = []
        bus._port.sleep = pauses.append
        bus.start()
        assert pauses == [0.25, 0.25]
    with board() as bus:
        bus._port.sleep = pauses.append
        bus.start()
        assert len(pauses) == 2


def test_a_start_that_fails_leaves_nothing_on(far: int) -> None:
    with board() as bus:
        bus.refuses = True
        with pytest.raises(NoReply, match="refused"):
            bus.start()
        assert not bus.running
        assert received(bus, far)[:3] == ["3:0.20", "3:off", "8:off"]


def test_every_servo_is_switched_off_and_asked(far: int) -> None:
    with board() as bus:
        bus.start()
        received(bus, far)
        bus.stop()
        assert received(bus, far) == ["3:off", "8:off"] * 2
        assert not bus.read().torque.any()


def test_a_servo_that_is_not_confirmed_is_tried_several_times_and_named(far: int) -> None:
    with board() as bus:
        bus.start()
        received(bus, far)
        bus.confirmed = {0}
        with pytest.raises(NoReply, match=r"not confirmed off on .*: 8 \(s8\)$") as caught:
            bus.stop()
        assert caught.value.servo_ids == (8,)
        assert caught.value.hint == "switch the servos' power off"
        lines = received(bus, far)
        assert (lines.count("3:off"), lines.count("8:off")) == (2, 1 + MAX_OFF_TRIES)
        bus.confirmed = {0, 1}


def test_a_port_that_goes_while_switching_off_names_all_that_are_left() -> None:
    master, slave = os.openpty()
    bus = Plain(SERVOS, port=os.ttyname(slave), stagger_s=0.0)
    bus.open()
    bus.start()
    os.close(slave)
    os.close(master)
    with pytest.raises(PortLost, match=r"not confirmed off on .*: 3 \(s3\), 8 \(s8\) \(port .* went away") as caught:
        bus.stop()
    assert caught.value.servo_ids == (3, 8)
    assert not bus.is_open
    bus.close()


def test_states_say_what_the_board_says_and_how_old_it_is(far: int) -> None:
    clock = VirtualClock(100.0)
    with board(clock=clock) as bus:
        before = bus.read()
        assert np.isnan(before.position_rad).all() and np.isinf(before.age_s).all() and not before.torque.any()
        bus.start()
        clock.sleep(1.5)
        bus.answers = [(1, 0.3)]
        state = bus.read()
        assert state.time_s == 101.5
        np.testing.assert_allclose(state.position_rad, [0.2, 0.3])
        np.testing.assert_allclose(state.age_s, [1.5, 0.0])
        for name in ("velocity_rad_s", "current_a", "voltage_v", "temperature_c"):
            assert np.isnan(getattr(state, name)).all()
        for name in ("fresh", "error", "hardware_error", "silent"):
            assert not getattr(state, name).any()


def test_pulses_that_end_are_torque_lost_once_and_a_goal_brings_them_back(far: int) -> None:
    with board() as bus:
        bus.start()
        bus.answers = [(1, math.nan)]
        assert bus.read().torque.tolist() == [True, False]
        np.testing.assert_allclose(bus.read().position_rad, [0.2, 0.4])
        assert bus.report().errors_by_servo == {8: {"torque_lost": 1}}
        bus.write([0.2, 0.4])
        bus.answers = []
        assert bus.read().torque.all()
        bus.stop()
        bus.answers = [(0, math.nan)]
        bus.read()
        assert bus.report().errors == {"torque_lost": 1}


def test_silence_is_logged_when_it_begins_and_ends(far: int, caplog: pytest.LogCaptureFixture) -> None:
    with board() as bus, caplog.at_level(logging.WARNING):
        for answered in (True, True, False, False, True, True):
            bus._note_answer(answered)
            assert bus.read().silent.tolist() == [not answered] * 2
            assert bus.report().silent == (() if answered else (3, 8))
        assert [message.split("/")[-1].split(" ", 1)[1] for message in caplog.messages] == [
            "does not answer",
            "answers again",
        ]
        bus._mute = [1]
        assert bus.read().silent.tolist() == [False, True]
        bus.close()
        bus.open()
        assert bus.read().silent.tolist() == [False, False]


def test_discovery_lists_the_configured_channels(far: int) -> None:
    with board() as bus:
        bus.present = np.array([0.1, math.nan])
        assert [(info.id, info.model, info.torque) for info in bus.discover()] == [
            (3, "rc-180", True),
            (8, "rc-180", False),
        ]
        assert [info.id for info in bus.discover([8, 9])] == [8]
        bus.tells_torque = False  # type: ignore[misc]
        assert [info.torque for info in bus.discover()] == [None, None]
        assert received(bus, far) == []


def test_the_margin_is_that_of_the_port_unless_it_is_set(far: int) -> None:
    with board() as bus:
        assert bus._margin_s == PSEUDO_MARGIN_S
    for margin_s in (0.0, 0.3):
        with board(margin_s=margin_s) as bus:
            assert bus._margin_s == margin_s


def test_a_rest_position_below_the_limits_is_raised(far: int) -> None:
    servos = [replace(SERVOS[0], rest_rad=-2.0)]
    with Plain(servos, port=Plain.path_for_tests, stagger_s=0.0) as bus:  # type: ignore[attr-defined]
        bus.start()
        assert received(bus, far) == ["3:-0.50"]
