"""drivers.omote.bus with another omote at the far end: its own line session on a real pseudo-terminal."""

from __future__ import annotations

import math
import os
import select
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS
from controller.layers.commands import CommandState
from controller.links.line.session import LineSession
from drivers import open_bus
from drivers.base.bus import Bus, ServoSpec
from drivers.base.errors import DriverError, NoReply, WrongModel
from drivers.omote.bus import ANSWER_TIMEOUT_S
from drivers.sim import SimulatedBus
from drivers.sim.serving.virtual import VirtualBus
from tests.drivers.boards.test_boards import NAMED, QUICK, BoardContract, cycle, far_end, outputs, rig
from tests.drivers.contract import settle

QUARTER = np.pi / 2  # 90 degrees are 1 of a parameter


@contextmanager
def other_omote() -> Iterator[tuple[str, CommandState, LineSession]]:
    """A line session behind a pseudo-terminal."""
    master, slave = os.openpty()
    os.set_blocking(master, False)
    stop_r, stop_w = os.pipe()
    state = CommandState(PARAMETERS)
    session = LineSession(state, time.monotonic_ns())

    def serve() -> None:
        while stop_r not in (ready := select.select([master, stop_r], [], [])[0]):
            if master in ready:
                os.write(master, session.feed(os.read(master, 4096), time.monotonic_ns()))

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield os.ttyname(slave), state, session
    finally:
        os.write(stop_w, b"x")
        thread.join()
        for fd in (master, slave, stop_r, stop_w):
            os.close(fd)


def head(path: str, names: dict[str, tuple[float, float]], **options: object) -> Bus:
    servos = [
        ServoSpec(i, f"channel {i}", "parameter", low * QUARTER, high * QUARTER, 50.0, 900.0, wire_name=name)
        for i, (name, (low, high)) in enumerate(names.items())
    ]
    return open_bus("omote", servos, port=path, margin_s=0.2, **options)


def shown(state: CommandState) -> np.ndarray:
    values = PARAMETERS.neutral()
    for _ in range(300):  # three seconds of its own clock: the face's motion limits have their time
        shown.now += 10_000_000
        state.tick(shown.now, 0.01, values)
    return values


shown.now = time.monotonic_ns()


@pytest.mark.parametrize("checksum", [True, False])
def test_another_omote_makes_the_face_and_lets_go_at_the_end(checksum: bool) -> None:
    wanted = {"jawOpen": 0.8, "headYaw": -0.5, "mouthSmileLeft": 0.25}
    with other_omote() as (path, state, session):
        limits = {name: (PARAMETERS.low[PARAMETERS.index(name)], 1.0) for name in wanted}
        with head(path, limits, checksum=checksum) as bus:
            bus.start()
            target = np.array(list(wanted.values())) * QUARTER
            settle(bus, target, 1e-3, measured=False)
            values = shown(state)
            assert [values[PARAMETERS.index(name)] for name in wanted] == pytest.approx(list(wanted.values()), abs=1e-3)
            assert state.status()["manual"] == 3
        assert state.status()["manual"] == 0
        assert session.refused == {}


def test_all_parameters_go_over_in_lines_that_fit() -> None:
    limits = {name: (low, 1.0) for name, low in zip(PARAMETERS.names, PARAMETERS.low, strict=True)}
    with other_omote() as (path, state, session):
        with head(path, limits) as bus:
            bus.start()
            sent = np.full(len(limits), 0.3) * QUARTER
            settle(bus, sent, 1e-3, measured=False)
            assert state.status()["manual"] == len(PARAMETERS)
        assert session.refused == {}
        assert state.status()["manual"] == 0


def test_it_begins_from_what_the_other_shows() -> None:
    with other_omote() as (path, state, _):
        state.set_parameters([PARAMETERS.index("jawOpen")], [0.6], time.monotonic_ns())
        shown(state)
        with head(path, {"jawOpen": (0.0, 1.0)}) as bus:
            bus.start()
            assert bus.read().position_rad == pytest.approx([0.6 * QUARTER], abs=1e-3)


def test_a_name_the_other_does_not_know_moves_nothing() -> None:
    with other_omote() as (path, state, _):
        bus = head(path, {"jawOpen": (0.0, 1.0), "jawOpn": (0.0, 1.0)})
        with bus, pytest.raises(WrongModel, match="did you mean 'jawOpen'"):
            bus.start()
        assert state.status()["manual"] == 0


def test_a_line_that_is_refused_is_counted_and_the_rest_goes_on() -> None:
    with other_omote() as (path, state, session):
        with head(path, {"jawOpen": (0.0, 2.0)}) as bus:
            bus.start()
            settle(bus, [1.0 * QUARTER], 1e-3, measured=False)
            for _ in range(20):
                bus.write([1.5 * QUARTER])
                bus.read()
                time.sleep(0.005)
            assert bus.report().errors["refused"] > 0
            assert shown(state)[PARAMETERS.index("jawOpen")] == pytest.approx(1.0, abs=1e-3)
        assert set(session.refused) == {24}


def test_silence_at_the_far_end_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drivers.omote.bus.HELLO_TIMEOUT_S", 0.3)
    monkeypatch.setattr("drivers.omote.bus.HELLO_INTERVAL_S", 0.1)
    master, slave = os.openpty()
    bus = head(os.ttyname(slave), {"jawOpen": (0.0, 1.0)})
    with bus, pytest.raises(NoReply, match="no head answers") as caught:
        bus.start()
    assert "baud" in caught.value.hint
    os.close(master)
    os.close(slave)


def test_values_have_the_decimals_of_their_model() -> None:
    models = ("parameter", "degrees", "rc-180")
    servos = [ServoSpec(i, f"s{i}", model, -1.0, 1.0, 50.0, 900.0) for i, model in enumerate(models)]
    board = VirtualBus(servos, "omote", baud=115_200)
    with board.bus() as bus:
        bus.start()
        for _ in range(200):
            bus.write([0.123456789] * 3)
            bus.read()
            board.clock.sleep(0.01)
        parameter, degrees, pulse = (row["value"] for row in board.line.describe(board.clock()))
        assert parameter == pytest.approx(round(0.123456789 / QUARTER, 4), abs=1e-9)
        assert degrees == pytest.approx(round(np.degrees(0.123456789), 2), abs=1e-9)
        assert pulse == pytest.approx(round(pulse, 1), abs=1e-9)
        assert pulse != round(pulse), "tenths of a microsecond are sent"


# ---------------------------------------------------------------- over a simulated head
class TestLineOutBus(BoardContract):
    FAMILY = "omote"
    SERVOS = NAMED
    MODELS = ("parameter",) * 3
    TORQUE = False


def test_4_a_name_that_a_head_keeps_leaves_no_other_on() -> None:
    board = far_end("omote", margin_s=0.02)
    bus = board.bus()
    with pytest.raises(NoReply, match=r"not confirmed off.*: 2 \(brow\)") as caught, bus:
        bus.start()
        cycle(bus, [0.1, 0.1, 0.1], 5)
        del board.line.values["brow"]
    assert caught.value.servo_ids == (2,)
    assert outputs(board) == []


def test_a_line_head_that_does_not_know_a_name_is_told() -> None:
    driver = open_bus("omote", NAMED, port="", **QUICK)
    names = [*driver.far_end()["names"][:2], "other"]
    with SimulatedBus(NAMED, family="omote", options={"names": names}) as board:
        bus = open_bus("omote", NAMED, port=board.path, **QUICK)
        with bus, pytest.raises(WrongModel, match="does not take 'neck'") as caught:
            bus.start()
        assert caught.value.servo_ids == (7,)
        assert "wire_name" in caught.value.hint


def test_a_simple_line_head_starts_at_rest_and_takes_lines_it_has_room_for() -> None:
    servos = [ServoSpec(i, f"channelNumber{i}", "degrees", -0.5, 0.5, 8.0, 200.0, rest_rad=0.2) for i in range(30)]
    names = [servo.name for servo in servos]
    with SimulatedBus(servos, family="omote", options={"names": names, "simple": True}) as board:
        with open_bus("omote", servos, port=board.path, **QUICK) as bus:
            bus.start()
            settle(bus, np.full(30, 0.3), 3e-4, measured=False)
            assert board.line.refused == 1  # GET, which it does not know
            assert [row["value"] for row in board.line.describe(0.0)] == pytest.approx(
                [math.degrees(0.3)] * 30, abs=0.01
            )
        assert outputs(board) == []


def test_a_name_that_cannot_stand_in_a_line_is_told() -> None:
    with pytest.raises(DriverError, match="'jaw open' cannot be a name"):
        open_bus("omote", [replace(NAMED[0], wire_name="jaw open")], port="")


def test_two_servos_of_one_name_are_told() -> None:
    with pytest.raises(DriverError, match="two servos are called jaw"):
        open_bus("omote", [NAMED[0], replace(NAMED[1], wire_name="jaw")], port="")


def test_a_head_gets_all_values_again_after_the_heartbeat() -> None:
    with rig("omote", heartbeat_s=0.5) as (bus, board):
        sent = bytearray()
        cycle(bus, [0.1, 0.1, 0.1], 10)
        board.clock.sleep(0.6)
        cycle(bus, [0.1, 0.1, 0.1], 3)  # the refresh
        board.link.tap = lambda out, data: sent.extend(data) if out else None
        cycle(bus, [0.1, 0.1, 0.1], 20)  # 0.2 s: nothing is new
        assert bytes(sent) == b""
        cycle(bus, [0.1, 0.1, 0.1], 40)
        assert bytes(sent).count(b" SET jaw 0.0637 brow ") == 1
        sent.clear()
        cycle(bus, [0.1, 0.2, 0.1], 1)
        assert b"jaw" not in sent and b" SET brow -0.1" in sent


def test_a_slow_head_gets_two_lines_at_most_and_what_is_held_back_is_counted() -> None:
    with rig("omote", margin_s=0.02) as (bus, board):
        cycle(bus, [0.1, 0.1, 0.1], 10)
        board.fault("mute:*")
        sent = bytearray()
        board.link.tap = lambda out, data: sent.extend(data) if out else None
        for k in range(5):
            cycle(bus, [0.11 + 0.01 * k] * 3)
        assert sent.count(b"\n") == 2
        assert bus.report().errors == {"held_back": 3}
        board.clock.sleep(0.6)
        state = bus.read()
        assert bus.report().errors == {"held_back": 3, "no_reply": 2}
        np.testing.assert_allclose(state.position_rad, 0.1, atol=0.02)
        board.clear()
        sent.clear()
        cycle(bus, [0.1, 0.1, 0.1], 2)
        assert b"jaw" in sent and b"brow" in sent and b"neck" in sent  # what was lost is said again


@pytest.mark.parametrize("model", ["nothing", "xl330-m288"])
def test_models_of_the_line_protocol(model: str) -> None:
    with pytest.raises(DriverError, match=f"there is no model '{model}' for the line protocol") as caught:
        open_bus("omote", [replace(NAMED[0], model=model)], port="")
    assert "parameter, degrees, rc-120, rc-180" in caught.value.hint
    assert open_bus("omote", [replace(NAMED[0], model="rc-90")], port="")._heartbeat_s == 0.25


def test_a_line_that_is_lost_is_told_once_and_only_after_its_time() -> None:
    with rig("omote", margin_s=0.02, heartbeat_s=100.0) as (bus, board):
        cycle(bus, [0.1, 0.1, 0.1], 10)
        board.fault("mute:*")
        bus.write([0.2, 0.1, 0.1])
        board.clock.sleep(0.9 * ANSWER_TIMEOUT_S)
        bus.read()
        assert bus.report().errors == {}
        board.clock.sleep(0.2 * ANSWER_TIMEOUT_S)
        for _ in range(3):
            bus.read()
        assert bus.report().errors == {"no_reply": 1}
        board.clear()


def test_an_error_without_a_tag_is_counted_and_everything_is_sent_again() -> None:
    with rig("omote", heartbeat_s=100.0) as (bus, board):
        cycle(bus, [0.1, 0.1, 0.1], 10)
        sent = bytearray()
        board.link.tap = lambda out, data: sent.extend(data) if out else None
        answer, extra = board.line.answer, [b"OK\n"]
        board.line.answer = lambda packet, now_s: [(0, extra.pop() if extra else b""), *answer(packet, now_s)]
        cycle(bus, [0.1, 0.2, 0.1], 3)
        assert bus.report().errors == {} and bus.report().stray == 0
        assert b"jaw" not in sent
        extra.append(b"ERR 13 wrong checksum\n")
        cycle(bus, [0.1, 0.1, 0.1], 3)
        assert bus.report().errors == {"refused": 1}
        assert [sent.count(name) for name in (b"jaw", b"brow", b"neck")] == [1, 3, 1]


def test_an_error_with_a_tag_sends_the_values_of_its_line_again_and_no_others() -> None:
    with rig("omote", heartbeat_s=100.0) as (bus, board):
        cycle(bus, [0.1, 0.1, 0.1], 10)
        sent = bytearray()
        board.link.tap = lambda out, data: sent.extend(data) if out else None
        answer, errors = board.line.answer, [b" ERR 24 no\n"]
        board.line.answer = lambda packet, now_s: (
            [(0, packet.split()[0] + errors.pop())] if errors else answer(packet, now_s)
        )
        state = cycle(bus, [0.1, 0.2, 0.1], 4)
        assert bus.report().errors == {"refused": 1}
        assert [sent.count(name) for name in (b"jaw", b"brow", b"neck")] == [0, 2, 0]
        assert state.position_rad == pytest.approx([0.1, 0.2, 0.1], abs=1e-3)


def test_an_answer_to_a_line_that_nobody_waits_for_is_stray() -> None:
    with rig("omote", heartbeat_s=100.0) as (bus, board):
        cycle(bus, [0.1, 0.1, 0.1], 10)
        answer, extra = board.line.answer, [b"#77777 OK SET 1\n", b"P 1 2\n", b"F x\n", b"rubbish\n", b" \n"]
        board.line.answer = lambda packet, now_s: [(0, b"".join(extra)), *answer(packet, now_s)]
        cycle(bus, [0.1, 0.2, 0.1], 1)
        board.clock.sleep(0.01)
        bus.read()
        report = bus.report()
        assert (report.stray, report.errors) == (1, {"corrupt": 1})
