"""Boards of hobby servos over simulated ones: the contract, and the faults of servo buses that a board can have."""

from __future__ import annotations

import logging
import math
import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from drivers import open_bus
from drivers.base.bus import Bus, ServoSpec
from drivers.base.errors import BusError, NoReply, PortBusy, PortLost, PortMissing
from drivers.sim import SimulatedBus
from drivers.sim.serving.virtual import VirtualBus
from tests.drivers.contract import BusContract, pause, settle
from tests.drivers.programs import program

SERVOS = (
    ServoSpec(1, "jaw", "rc-180", -0.6, 0.4, 8.0, 200.0),
    ServoSpec(2, "brow", "rc-90", -0.5, 0.5, 8.0, 200.0, reverse=True),
    ServoSpec(7, "neck", "rc-270", -0.3, 0.9, 8.0, 200.0, zero_rad=0.2),
)
NAMED = tuple(replace(servo, model="parameter") for servo in SERVOS)
TEXTS = {"template": "S{ch},{us}\n", "off": "D{ch}\n"}
ASKED = TEXTS | {"query": "?{ch}\n", "answer": "{ch}={us}\n"}
NOISY = ("noise:*:5:p=0.3", "flip:*:p=0.3", "drop:*:p=0.2", "short:*:1:p=0.3", "late:*:70ms:p=0.2", "slow-reader:50ms")
QUICK = {"stagger_s": 0.0, "margin_s": 0.05}
PATIENT = QUICK | {"margin_s": 0.6}
"""Options over a real pseudo-terminal, whose far end may be late on a busy machine."""
FAMILIES: dict[str, tuple[str, tuple[ServoSpec, ...], dict[str, Any]]] = {
    "maestro": ("maestro", SERVOS, {}),
    "micro": ("maestro", tuple(replace(s, id=i) for i, s in enumerate(SERVOS)), {"board": "micro"}),
    "pololu": ("maestro", SERVOS, {"device": 12, "crc": True}),
    "ssc32": ("ssc32", SERVOS, {}),
    "text": ("text", SERVOS, TEXTS),
    "asked": ("text", SERVOS, ASKED),
    "omote": ("omote", NAMED, {}),
}


@contextmanager
def rig(family: str, **options: Any) -> Iterator[tuple[Bus, VirtualBus]]:
    """A started bus of a family in time that does not pass by itself, and the simulated board behind it."""
    board = far_end(family, **options)
    with board.bus() as bus:
        bus.start()
        yield bus, board


def far_end(family: str, **options: Any) -> VirtualBus:
    """A simulated board of a family."""
    kind, servos, more = FAMILIES[family]
    return VirtualBus(servos, kind, driver=QUICK | more | options, baud=115_200)


def outputs(board: SimulatedBus | VirtualBus) -> list[float]:
    """What the board puts out, by servo; 0 for nothing."""
    clock = getattr(board, "clock", time.monotonic)
    rows = {row["id"]: row for row in board.line.describe(clock())}
    keys = ("pulse_us", "us", "value")
    found = [next((row[key] for key in keys if row.get(key)), 0.0) for row in rows.values()]
    return [value for value in found if value]


def cycle(bus: Bus, target: list[float], count: int = 1, pause_s: float = 0.01) -> Any:
    for _ in range(count):
        bus.write(target)
        state = bus.read()
        pause(bus, pause_s)
    return state


class BoardContract(BusContract):
    SERVOS = SERVOS
    MODELS = ("rc-180", "rc-90", "rc-270")
    ABSENT_ID = None
    STEP_RAD = 0.002
    VOLTS = None
    TEMPERATURE = False
    MEASURES = False
    FAMILY = "maestro"

    @pytest.fixture
    def bus(self) -> Bus:
        return far_end(self.FAMILY).bus()


class TestMaestroBus(BoardContract):
    """Over a real pseudo-terminal, in time that passes by itself."""

    @pytest.fixture
    def bus(self) -> Bus:
        return open_bus("simulated", SERVOS, simulates="maestro", process=False, **PATIENT)


class TestMicroMaestroBus(BoardContract):
    FAMILY = "micro"
    SERVOS = FAMILIES["micro"][1]


class TestMaestroBusPololuProtocol(BoardContract):
    FAMILY = "pololu"


class TestSsc32Bus(BoardContract):
    FAMILY = "ssc32"
    STEP_RAD = 0.02


class TestTextBus(BoardContract):
    FAMILY = "text"
    TORQUE = False
    STEP_RAD = 0.003


class TestTextBusThatAsks(TestTextBus):
    FAMILY = "asked"


@pytest.mark.parametrize("family", FAMILIES)
def test_servos_begin_at_rest_or_where_the_board_holds_them(family: str) -> None:
    kind, servos, _ = FAMILIES[family]
    board = far_end(family)
    board.servos = tuple(replace(servo, rest_rad=0.3) for servo in servos)
    first = board.bus()
    with first:
        first.start()
        rest = [0.0, 0.0, -0.2] if kind == "omote" else 0.3  # a head that says what it shows is followed
        np.testing.assert_allclose(first.read().position_rad, rest, atol=0.02)
        settle(first, [0.1, 0.1, 0.1], 0.02, measured=False)
        held = outputs(board)
        if kind in ("text", "omote"):
            return  # these tell nothing of a program before
        first._close_link()  # as a program that was killed
        with board.bus() as second:
            second.start()
            np.testing.assert_allclose(second.read().position_rad, 0.1, atol=0.02)
            assert outputs(board) == pytest.approx(held, abs=11)
        first._lost = first._running = False


@pytest.mark.parametrize("family", FAMILIES)
def test_2_unplugged_and_back_goes_on_without_a_jump(family: str) -> None:
    with rig(family) as (bus, board):
        settle(bus, [0.2, 0.2, 0.2], 0.02, measured=False)
        before = outputs(board)
        board.fault("unplug")
        with pytest.raises(PortLost):
            cycle(bus, [0.0, 0.0, 0.0], 50)
        with pytest.raises(PortMissing):
            bus.reconnect()
        board.clear("unplug")
        bus.reconnect()
        assert bus.running
        sent = bus.write([0.2, 0.2, 0.2])
        np.testing.assert_allclose(sent, 0.2, atol=0.1)
        bus.read()
        assert outputs(board) == pytest.approx(before, rel=0.12)
        assert bus.report().errors["port_lost"] == 1


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("how", ["close", "error"])
def test_3_every_way_out_switches_all_off(family: str, how: str) -> None:
    board = far_end(family)
    with suppress(ZeroDivisionError), board.bus() as bus:
        bus.start()
        cycle(bus, [0.1, 0.1, 0.1], 20)
        assert len(outputs(board)) == 3
        if how == "error":
            raise ZeroDivisionError
    board.clock.sleep(0.2)  # the last line is on the wire
    assert outputs(board) == []


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_3_signals_switch_all_off(number: int) -> None:
    with (
        SimulatedBus(SERVOS, family="maestro", options={"limits_us": (500, 2500)}) as board,
        program("maestro", SERVOS, board.path, **PATIENT) as child,
    ):
        assert len(outputs(board)) == 3
        assert child.pid is not None
        os.kill(child.pid, number)
        child.join(20)
        assert outputs(board) == []


@pytest.mark.parametrize("family", ["maestro", "ssc32", "omote", "asked"])
def test_1_a_mute_board_is_told_once_and_costs_one_wait_a_second(family: str, caplog: pytest.LogCaptureFixture) -> None:
    with rig(family, margin_s=0.02) as (bus, board), caplog.at_level(logging.WARNING):
        cycle(bus, [0.1, 0.1, 0.1], 10)
        board.fault("mute:*")
        begin, waits = board.clock(), []
        while board.clock() < begin + 3.0:
            before = board.clock()
            state = cycle(bus, [0.1 + 0.01 * len(waits) % 0.1] * 3, pause_s=0.0)
            waits.append(board.clock() - before)
            board.clock.sleep(0.01)
        assert state.silent.all()
        assert not state.fresh.any()
        assert bus.report().errors["no_reply"] > 0
        assert sum(wait > 0.02 for wait in waits) <= 5
        assert sum("does not answer" in record.message for record in caplog.records) == 1
        board.clear("mute")
        end = board.clock() + 3
        while cycle(bus, [0.1, 0.1, 0.1]).silent.any():
            assert board.clock() < end


def test_1_a_servo_that_a_text_board_says_nothing_about_costs_one_wait_a_second() -> None:
    with rig("asked", margin_s=0.02) as (bus, board):
        board.fault("silent:2")
        cycle(bus, [0.1, 0.1, 0.1], 3)
        waits = []
        while board.clock() < 5.0:
            before = board.clock()
            state = cycle(bus, [0.1, 0.1, 0.1], pause_s=0.0)
            waits.append(board.clock() - before)
            board.clock.sleep(0.01)
            assert state.silent.tolist() == [False, True, False]
        assert 2 <= sum(wait > 0.02 for wait in waits) <= 5
        assert bus.report().silent == (2,)
        board.clear()
        board.clock.sleep(1.0)
        assert not cycle(bus, [0.1, 0.1, 0.1], 3).silent.any()


@pytest.mark.parametrize("family", ["maestro", "ssc32"])
@pytest.mark.parametrize("fault", NOISY)
def test_13_14_nothing_is_believed_that_cannot_be(family: str, fault: str) -> None:
    """Positions stay between what was told, whatever the wire brings; afterwards all is well again."""
    with rig(family, margin_s=0.02) as (bus, board):
        settle(bus, [0.1, 0.1, 0.1], 0.02, measured=False)
        board.fault(fault)
        seen = [cycle(bus, [0.1, 0.1, 0.1], pause_s=0.005).position_rad for _ in range(40)]
        assert np.abs(np.array(seen) - 0.1).max() < 0.03
        board.clear()
        end = board.clock() + 4
        while cycle(bus, [0.2, 0.2, 0.2]).silent.any() or np.abs(bus.read().position_rad - 0.2).max() > 0.02:
            assert board.clock() < end


def test_10_a_port_in_use_is_told() -> None:
    with SimulatedBus(SERVOS, family="maestro") as board:
        first, second = (open_bus("maestro", SERVOS, port=board.path, **PATIENT) for _ in range(2))
        with first, pytest.raises(PortBusy, match="held by another program"):
            second.open()


@pytest.mark.parametrize("family", ["maestro", "ssc32", "asked"])
def test_8_a_brown_out_is_told_and_pulses_come_back_where_they_were(family: str) -> None:
    with rig(family, margin_s=0.02) as (bus, board):
        settle(bus, [0.1, 0.1, 0.1], 0.02, measured=False)
        cycle(bus, [0.1, 0.1, 0.1], 20)  # it has arrived
        before = outputs(board)
        board.fault("volts:*:3.0:for=0.15s")
        assert outputs(board) == []
        end = board.clock() + 4
        while len(outputs(board)) < 3 or bus.read().silent.any():
            cycle(bus, [0.1, 0.1, 0.1])
            assert board.clock() < end
        cycle(bus, [0.1, 0.1, 0.1], 5)
        assert outputs(board) == pytest.approx(before, abs=2)


@pytest.mark.parametrize("family", ["maestro", "ssc32"])
def test_19_an_echo_is_told(family: str) -> None:
    board = far_end(family, margin_s=0.02)
    board.fault("echo")
    with board.bus() as bus, pytest.raises(NoReply):
        bus.start()


@pytest.mark.parametrize("family", ["maestro", "micro", "pololu", "ssc32"])
def test_4_a_channel_that_cannot_be_confirmed_leaves_no_other_on(family: str) -> None:
    sick = FAMILIES[family][1][1].id
    board = far_end(family, margin_s=0.02)
    bus = board.bus()
    with pytest.raises(NoReply, match=rf"not confirmed off.*: {sick} \(brow\)") as caught, bus:
        bus.start()
        cycle(bus, [0.1, 0.1, 0.1], 5)
        board.fault(f"silent:{sick}")
    assert caught.value.servo_ids == (sick,)
    assert outputs(board) == []
    assert not bus.is_open


def test_4_a_mute_text_board_is_told_to_let_go_of_every_servo() -> None:
    board = far_end("asked", margin_s=0.02)
    with board.bus() as bus:
        bus.start()
        board.fault("silent:*")
        cycle(bus, [0.1, 0.1, 0.1], 5)
    board.clock.sleep(0.2)
    assert outputs(board) == []


def test_the_maestro_says_what_is_wrong_with_it(caplog: pytest.LogCaptureFixture) -> None:
    with rig("maestro") as (bus, board), caplog.at_level(logging.WARNING):
        cycle(bus, [0.0, 0.0, 0.0], 5)
        for _ in range(3):
            board.line.feed(bytes((0x84, 99, 0, 0)), board.clock())  # a channel that is not there
            cycle(bus, [0.0, 0.0, 0.0], 2)
        assert bus.report().errors["board_protocol"] >= 1
        assert sum("reports: protocol" in record.message for record in caplog.records) == 1
        assert len(outputs(board)) == 3
        speeds = [board.line.speeds[servo.id] for servo in SERVOS]
        assert speeds == [math.ceil(8.0 * slope / 25) for slope in (2000 / math.pi, 2000 / math.pi, 4000 / math.pi / 3)]


def test_the_maestros_own_limits_are_told(caplog: pytest.LogCaptureFixture) -> None:
    servo = ServoSpec(0, "jaw", "rc-180", -1.2, 1.2, 8.0, 200.0, rest_rad=-1.0)
    with SimulatedBus([servo], family="maestro") as board, caplog.at_level(logging.WARNING):
        with open_bus("maestro", [servo], port=board.path, **PATIENT) as bus:
            bus.start()
            assert bus.read().position_rad[0] == pytest.approx((992 - 1500) * math.pi / 2000, abs=1e-3)
        assert "stays at 992 us" in caplog.text


def test_the_wrong_board_is_told() -> None:
    with SimulatedBus(SERVOS[:2], family="maestro", options={"board": "micro"}) as board:
        with open_bus("maestro", SERVOS[:2], port=board.path, **PATIENT) as bus:
            with pytest.raises(BusError, match="reports protocol") as caught:
                bus.start()
            assert 'board = "micro"' in caught.value.hint
        assert outputs(board) == []


def test_targets_of_channels_in_a_row_go_in_one_command() -> None:
    servos = [ServoSpec(i, f"s{i}", "rc-90", -0.5, 0.5, 8.0, 200.0) for i in (0, 1, 2, 5, 6, 9)]
    with (
        SimulatedBus(servos, family="maestro", options={"limits_us": (500, 2500)}) as board,
        open_bus("maestro", servos, port=board.path, **PATIENT) as bus,
    ):
        bus.start()
        sent = bytearray()
        bus._port.tap = lambda out, data: sent.extend(data) if out else None
        bus.write(np.zeros(6))
        assert bytes(sent) == bytes.fromhex("9F 03 00 70 2E 70 2E 70 2E  9F 02 05 70 2E 70 2E  84 09 70 2E")


def test_text_lines_hold_what_changed_and_one_more_in_turn() -> None:
    options = {"template": "#{ch}P{us}", "begin": "<", "separator": " ", "end": ">\n", "off": "#{ch}O\n"}
    with rig("text", **options) as (bus, board):
        cycle(bus, [0.0, 0.0, 0.0], 20)
        sent = bytearray()
        bus._port.tap = lambda out, data: sent.extend(data) if out else None
        cycle(bus, [0.0, 0.0, 0.0], 3)
        assert sorted(bytes(sent).split()) == [b"<#1P1500>", b"<#2P1500>", b"<#7P1585>"]
        sent.clear()
        cycle(bus, [0.01, 0.01, 0.01])
        assert bytes(sent) == b"<#1P1506 #2P1494 #7P1589>\n"
        assert board.line.refused == 0


def test_a_text_board_without_off_is_warned_about(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING), rig("text", off=""):
        assert "cannot be switched off" in caplog.text
