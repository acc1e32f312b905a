"""drivers.ssc32.bus: the lines that go to an SSC-32, and the bytes that come back; SSC-32U guide, pages 24-33."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drivers import open_bus
from drivers.base.bus import ServoSpec
from drivers.base.errors import NoReply
from drivers.sim.serving.virtual import VirtualBus

SERVOS = tuple(ServoSpec(i, f"s{i}", "rc-180", -0.7, 0.7, 50.0, 500.0) for i in (3, 14))
STEP_RAD = math.pi / 2000


@pytest.fixture
def board() -> VirtualBus:
    return VirtualBus(SERVOS, "ssc32", driver={"stagger_s": 0.0, "margin_s": 0.02}, baud=115_200)


def sent_by(board: VirtualBus) -> bytearray:
    data = bytearray()
    board.link.tap = lambda out, piece: data.extend(piece) if out else None
    return data


def test_one_line_moves_all_channels_in_the_time_since_the_last_one(board: VirtualBus) -> None:
    with board.bus() as bus:
        bus.start()
        board.clock.sleep(0.5)
        bus.write([0.0, 0.0])
        board.clock.sleep(0.04)
        data = sent_by(board)
        sent = bus.write([100 * STEP_RAD, -200 * STEP_RAD])
        assert bytes(data) == b"#3P1600#14P1300T40\r"
        np.testing.assert_allclose(sent, [100 * STEP_RAD, -200 * STEP_RAD])
        assert board.line.refused == 0


def test_each_cycle_asks_for_pulses_and_ends_with_the_version(board: VirtualBus) -> None:
    with board.bus() as bus:
        bus.start()
        bus.write([0.0, 0.0])
        data = sent_by(board)
        state = bus.read()
        assert bytes(data) == b"QP3\rQP14\rVER\r"
        np.testing.assert_allclose(state.position_rad, 0.0, atol=1e-9)
        assert bus.report().as_dict()["stray"] == 0


def test_a_byte_is_tens_of_microseconds(board: VirtualBus) -> None:
    for channel, pulse in ((3, 1700.0), (14, 1400.0)):
        board.line.channels[channel].go(pulse, board.clock())
    with board.bus() as bus:
        bus.start()
        np.testing.assert_allclose(bus.read().position_rad, [200 * STEP_RAD, -100 * STEP_RAD], atol=1e-9)


def test_stopping_ends_moves_and_pulses_and_asks_whether_they_ended(board: VirtualBus) -> None:
    with board.bus() as bus:
        bus.start()
        data = sent_by(board)
        bus.stop()
        assert bytes(data).startswith(b"STOP3\r#3P0\rSTOP14\r#14P0\r")
        assert b"QP3\r" in data
    assert [board.line.channels[servo.id].target for servo in SERVOS] == [0.0, 0.0]


def test_a_silent_board_is_named_with_its_rate(board: VirtualBus) -> None:
    board.fault("mute:*")
    with board.bus() as bus, pytest.raises(NoReply, match="no SSC-32 answers on virtual at 115200 baud") as caught:
        bus.start()
    assert caught.value.servo_ids == (3, 14)
    assert "baud rate" in caught.value.hint


@pytest.mark.parametrize(
    ("data", "known"),
    [
        (b"SSC32-V2.50USB\r", True),
        (b"SSC32\r", True),
        (b"SSC33-V1\r", False),
        (b"SSC32-V2", False),
        (b"\x96SSC32-V2\r", False),
        (b"SSC32\r\r", False),
        (b"", False),
    ],
)
def test_only_one_whole_version_is_an_answer(data: bytes, known: bool) -> None:
    assert open_bus("ssc32", SERVOS, port="")._answers_probe(data) is known


def test_it_can_be_asked_for_pulses_and_its_far_end_needs_nothing() -> None:
    bus = open_bus("ssc32", SERVOS, port="")
    assert bus.tells_torque
    assert bus.far_end() == {}
    assert not bus.measures
