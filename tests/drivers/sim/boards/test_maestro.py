"""drivers.sim.boards.maestro: the Maestro's three protocols, its limits and its errors."""

from __future__ import annotations

import pytest

from drivers.base.errors import DriverError
from drivers.sim.boards.maestro import SIMULATOR, Maestro, MaestroOptions, MaestroReader
from drivers.sim.boards.maestro_guide import MaestroError, crc7
from drivers.sim.wire.simulator import Setting, make_line
from drivers.sim.wire.timing import Reply


def send(board: Maestro, text: str, now_s: float = 0.0) -> str:
    return b"".join(reply.data for reply in board.feed(bytes.fromhex(text), now_s)).hex(" ").upper()


def pulse(board: Maestro, channel: int, now_s: float = 0.0) -> float:
    return board.channels[channel].position(now_s) / 4


def test_crc_of_the_guide():
    assert crc7(bytes.fromhex("8301")) == 0x17


@pytest.mark.parametrize(
    ("text", "us"),
    [
        ("84 02 70 2E", 1500),  # compact
        ("AA 0C 04 02 70 2E", 1500),  # Pololu protocol, device 12
        ("FF 02 7F", 1500),  # Mini SSC: 127 is the middle
        ("FF 02 FE", 1976.25),
        ("FF 02 00", 1023.75),
        ("84 02 00 7F", 2000),  # cut to the channel's limits
        ("84 02 01 00", 992),
        ("84 02 00 00", 0),
    ],
)
def test_targets(text: str, us: float):
    board = Maestro()
    assert send(board, text) == ""
    assert pulse(board, 2) == us
    assert send(board, "A1") == "00 00"


def test_another_device_is_not_meant():
    board = Maestro()
    send(board, "AA 0B 04 02 70 2E")
    assert (pulse(board, 2), send(board, "A1")) == (0, "00 00")


def test_mini_ssc_numbers_of_other_boards_are_passed_over():
    """Several boards on one line share the numbers 0 to 254."""
    board = Maestro(channels=12)
    send(board, "84 02 70 2E")
    assert send(board, "FF 0C 7F") == send(board, "FF FE 7F") == ""
    assert (pulse(board, 2), send(board, "A1")) == (1500, "00 00")


def test_mini_ssc_is_no_command_of_the_pololu_protocol():
    board = Maestro()
    send(board, "AA 0C 7F 02 7F")
    assert pulse(board, 2) == 0
    assert send(board, "A1") == "10 00"  # a protocol error


def test_many_targets_at_once():
    board = Maestro()
    send(board, "9F 02 03 70 2E 00 3F")
    assert (pulse(board, 3), pulse(board, 4)) == (1500, 2000)
    send(board, "AA 0C 1F 01 05 70 2E")
    assert pulse(board, 5) == 1500


def test_position_is_the_pulse_in_two_full_bytes():
    board = Maestro()
    send(board, "84 01 70 2E")
    assert send(board, "90 01") == "70 17"
    assert send(board, "90 02") == "00 00"


def test_speed_and_acceleration_units():
    board = Maestro()
    send(board, "84 00 00 20 87 00 0C 01 84 00 00 30", 1.0)  # 140 x 0.25 us per 10 ms from 1024 to 1536 us
    assert pulse(board, 0, 1.0 + 0.1) == pytest.approx(1024 + 350)
    assert send(board, "93", 1.1) == "01"
    assert send(board, "93", 1.2) == "00"
    other = Maestro()
    send(other, "84 00 00 20 89 00 04 00 84 00 00 30", 0.0)  # 4 x 0.25 us per 10 ms per 80 ms
    assert pulse(other, 0, 0.2) == pytest.approx(1024 + 0.5 * 1250 * 0.04)


@pytest.mark.parametrize(("speed", "acceleration"), [(20, 4), (10, 0), (200, 4)])
def test_a_step_takes_the_time_of_the_guide(speed: int, acceleration: int):
    """From 1000 to 1500 us; speed in 0.25 us per 10 ms, acceleration in 0.25 us per 10 ms per 80 ms."""
    us_s, us_s2 = speed * 0.25 / 0.010, acceleration * 0.25 / 0.010 / 0.080
    seconds = 500 / us_s + (us_s / us_s2 if acceleration else 0.0)
    if acceleration and us_s**2 / us_s2 > 500:  # it is never as fast
        seconds = 2 * (500 / us_s2) ** 0.5
    board = Maestro()
    limits = f"87 00 {speed & 127:02X} {speed >> 7:02X} 89 00 {acceleration:02X} 00"
    send(board, f"84 00 20 1F {limits} 84 00 70 2E")
    assert pulse(board, 0) == 1000
    assert pulse(board, 0, seconds / 2) == pytest.approx(1250)
    assert (send(board, "93", 0.99 * seconds), send(board, "93", 1.01 * seconds)) == ("01", "00")


def test_go_home_stops_the_pulses():
    board = Maestro()
    send(board, "84 00 70 2E A2")
    assert pulse(board, 0) == 0


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("01", MaestroError.PROTOCOL),  # data without a command
        ("84 00 70 90 00", MaestroError.PROTOCOL),  # a command in the middle of another
        ("84 A1", MaestroError(0)),  # the reading that breaks in clears its own error
        ("FE", MaestroError.PROTOCOL),
        ("84 40 70 2E", MaestroError.PROTOCOL),
        ("87 40 01 00", MaestroError.PROTOCOL),
        ("90 40", MaestroError.PROTOCOL),
    ],
)
def test_errors_are_kept_until_they_are_read(text: str, error: MaestroError):
    board = Maestro()
    send(board, text)
    assert board.errors == error
    assert send(board, "A1") == f"{int(error):02X} 00"
    assert send(board, "A1") == "00 00"


def test_broken_bytes_send_every_channel_home():
    board = Maestro()
    send(board, "84 00 70 2E")
    send(board, "84 01")
    assert send(board, "A1") == "10 00"
    assert pulse(board, 0) == 0


def test_crc_is_checked_where_it_is_asked_for():
    board = Maestro(crc=True)
    message = bytes.fromhex("84 02 70 2E")
    board.feed(message + bytes((crc7(message),)), 0.0)
    assert pulse(board, 2) == 1500
    board.feed(message + bytes((crc7(message) ^ 1,)), 0.0)
    assert board.errors == MaestroError.CRC
    send(board, "FF 02 7F")
    assert pulse(board, 2) == 1500


def test_a_question_without_data_waits_for_its_crc():
    board = Maestro(crc=True)
    question = bytes.fromhex("A1")
    assert board.feed(question, 0.0) == [] and board.errors == 0
    answers = board.feed(bytes((crc7(question),)), 0.1)
    assert b"".join(answer.data for answer in answers) == bytes(2)


def test_scripts_are_accepted_and_never_run():
    board = Maestro()
    assert send(board, "A4 A7 00 A8 00 00 00 8A 00 00 00 00 AE") == "01"
    assert board.errors == MaestroError(0)


def test_baud_detection_byte_alone_is_no_error():
    board = Maestro()
    send(board, "AA 84 02 70 2E")
    assert (pulse(board, 2), board.errors) == (1500, MaestroError(0))


def test_pieces_and_sizes():
    reader = MaestroReader()
    assert reader.feed(b"\x84\x02") == []
    assert (reader.pending, reader.flush()) == (2, [])
    (command,) = reader.feed(b"\x70\x2e")
    assert Maestro().size(command) == 4
    assert reader.feed(b"\xaa\x0c") == []
    assert reader.take_pending() == b"\xaa\x0c"
    assert reader.pending == 0


def test_states_for_tools_and_faults():
    board = Maestro(channels=6)
    send(board, "84 01 70 2E")
    assert board.describe(0.0)[1] == {"id": 1, "pulse_us": 1500.0, "target_us": 1500.0}
    assert len(board.describe(0.0)) == 6
    with pytest.raises(ValueError, match="by hand"):
        board.place(1, 5, 0.0)
    with pytest.raises(DriverError, match="only drop, echo"):
        Maestro(faults=("crc:1",))


@pytest.mark.parametrize(
    ("highest", "board", "channels"),
    [(3, "micro", 6), (3, "mini", 12), (12, "mini", 18), (23, "mini", 24), (30, "mini", 24)],
)
def test_a_board_is_as_large_as_its_channels_need(highest: int, board: str, channels: int) -> None:
    line = make_line("maestro", [(0, "rc-90"), (highest, "rc-90")], 0.0, options={"board": board})
    assert isinstance(line, Maestro)
    assert len(line.channels) == channels


def test_the_channel_at_the_end_exists_and_the_one_behind_it_does_not():
    for command in ("84 {:02X} 70 2E", "87 {:02X} 01 00", "89 {:02X} 01 00", "90 {:02X}"):
        board = Maestro(channels=12)
        send(board, command.format(11))
        assert board.errors == MaestroError(0)
        send(board, command.format(12))
        assert board.errors == MaestroError.PROTOCOL


def test_a_micro_maestro_lacks_the_commands_of_the_larger_ones():
    for command in ("9F 01 00 70 2E", "93", "8A 00 00 00 00"):
        board = Maestro(channels=6)
        assert send(board, command) == ""
        assert board.errors == MaestroError.PROTOCOL
        assert Maestro(channels=12).feed(bytes.fromhex(command), 0.0) in ([], [Reply(b"\0", None)])


def test_an_error_about_a_missing_channel_sends_the_others_home():
    board = Maestro()
    for command in ("90 40", "87 40 01 00"):
        send(board, "84 00 70 2E")
        assert pulse(board, 0) == 1500
        send(board, command)
        assert pulse(board, 0) == 0


def test_a_reset_forgets_speeds_and_errors():
    board = Maestro()
    send(board, "87 00 05 00 89 01 06 00 01")
    assert (board.speeds[0], board.accelerations[1], board.errors) == (5, 6, MaestroError.PROTOCOL)
    board.faults.add(["volts:*:3:for=1s"], 0.0)
    assert (board.speeds[0], board.accelerations[1], board.errors) == (0, 0, MaestroError(0))
    send(board, "87 00 7F 01", 2.0)
    assert board.speeds[0] == 255


def test_limits_and_the_fault_of_a_position_are_those_of_its_channel():
    board = Maestro(limits_us=(800.0, 1600.0))
    send(board, "84 01 00 7F 84 02 01 00")
    assert (pulse(board, 1), pulse(board, 2)) == (1600, 800)
    board.faults.add(["silent:1"], 0.0)
    assert send(board, "90 01") == ""
    assert send(board, "90 02") == "80 0C"


def test_options_of_the_command_line():
    setting = Setting(now_s=0.0, baud=115_200)
    board = SIMULATOR.alone(MaestroOptions(channels=18, device=3, crc=True), setting)
    assert len(board.channels) == 18
    message = bytes.fromhex("AA 03 04 02 70 2E")
    board.feed(message + bytes((crc7(message),)), 0.0)
    assert pulse(board, 2) == 1500
    with pytest.raises(DriverError, match="no Maestro has so many"):
        SIMULATOR.alone(MaestroOptions(channels=7), setting)
    far_end = make_line("maestro", [(0, "rc-90")], 0.0, options={"crc": True, "limits_us": (500.0, 2500.0)})
    far_end.feed(message + bytes((crc7(message),)), 0.0)
    assert pulse(far_end, 2) == 0, "another device"
