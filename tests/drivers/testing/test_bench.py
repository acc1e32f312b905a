"""drivers.testing.bench: what programs do to simulated servos is recorded, and assertions say who, when and what."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import serial

from drivers.base.errors import DriverError
from drivers.packets.packet import Instruction, encode_instruction
from drivers.testing import Bench, ServoBoard, ServoBus, open_board, open_servos, records

TORQUE, GOAL, SPEED = (64, 1), (116, 4), (112, 4)
"""Addresses and sizes of Torque Enable, Goal Position and Profile Velocity (e-Manual, XL330-M288)."""
HALF_TURN = 2048


def write(bus: ServoBus, servo: int, register: tuple[int, int], value: int) -> None:
    """Write a register as a bare program does, and wait for the answer."""
    address, size = register
    data = address.to_bytes(2, "little") + value.to_bytes(size, "little")
    port = bus.serial(timeout=0.1)
    port.write(encode_instruction(servo, Instruction.WRITE, data))
    port.read(11)
    port.close()


def target(board: ServoBoard, channel: int, us: int) -> None:
    """Set Target in the compact protocol (Maestro User's Guide, 5.e): quarter microseconds, low seven bits first."""
    port = board.serial()
    port.write(bytes((0x84, channel, us * 4 & 0x7F, us * 4 >> 7)))
    board.step(0.01)
    port.close()


def said(check: Callable[[], object]) -> str:
    """What an assertion says."""
    with pytest.raises(AssertionError) as error:
        check()
    return str(error.value)


@pytest.fixture
def bus() -> ServoBus:
    return open_servos("xl330-m288", [1, 2], stepped=True)


@pytest.fixture
def board() -> ServoBoard:
    return open_board("maestro", channels=6, stepped=True)


# ---------------------------------------------------------------- what is recorded
def test_every_write_is_there_with_its_time_and_why_it_was_refused(bus: ServoBus) -> None:
    write(bus, 1, SPEED, 50)
    bus.step(1.0)
    write(bus, 2, GOAL, 5000)
    first, second = bus.writes
    assert first[1:] == (1, "Profile Velocity", 50, "")
    assert second[1:] == (2, "Goal Position", 5000, "data limit")
    assert 0 < first.time_s < 0.01
    assert 1.0 < second.time_s < 1.01
    assert bus.writes_to(2) == [second] == bus.writes_to(2, "Goal Position")
    assert bus.writes_to(2, "Profile Velocity") == []


def test_a_registered_write_counts_when_it_acts(bus: ServoBus) -> None:
    port = bus.serial(timeout=0.1)
    port.write(encode_instruction(1, Instruction.REG_WRITE, b"\x41\0\1"))
    port.read(11)
    assert bus.writes == []
    port.write(encode_instruction(1, Instruction.ACTION))
    port.read(11)
    assert [each[1:] for each in bus.writes] == [(1, "LED", 1, "")]


def test_a_refused_registered_write_and_an_unknown_address_are_there(bus: ServoBus) -> None:
    port = bus.serial(timeout=0.1)
    port.write(encode_instruction(1, Instruction.REG_WRITE, b"\x84\0\1\0\0\0"))
    port.read(11)
    write(bus, 1, (3, 2), 7)
    assert [each[1:] for each in bus.writes] == [
        (1, "Present Position", 1, "access"),
        (1, "address 3", 7, "access"),
    ]


def test_forget_begins_anew(bus: ServoBus) -> None:
    write(bus, 1, TORQUE, 1)
    write(bus, 1, GOAL, 0)
    bus.step(1.0)
    assert bus.time_s > 1.0
    bus.forget()
    assert bus.writes == [] and bus.time_s == 0.0
    bus.no_jump()
    assert "since 0.000 s" in said(bus.torque_off_at_exit)


def test_a_full_record_fails_every_assertion(bus: ServoBus, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(records, "MAX_ENTRIES", 3)
    for _ in range(4):
        write(bus, 1, SPEED, 50)
    for check in (bus.no_jump, bus.torque_off_at_exit, bus.never_beyond_limits, lambda: bus.bus_load_below(1.0)):
        assert "forget()" in said(check)


def test_faults_go_in_and_out_by_name(bus: ServoBus) -> None:
    bus.fault("mute:1", "drop:2:p=0.5")
    assert bus.faults == ["mute:1", "drop:2:p=0.5"]
    write(bus, 1, SPEED, 50)
    assert bus.writes == []
    bus.clear("mute")
    write(bus, 1, SPEED, 50)
    assert bus.faults == ["drop:2:p=0.5"] and len(bus.writes) == 1
    with pytest.raises(DriverError, match="mood"):
        bus.fault("mood:1")
    assert bus.faults == ["drop:2:p=0.5"]


# ---------------------------------------------------------------- no_jump
def test_a_goal_after_torque_is_a_jump(bus: ServoBus) -> None:
    bus.step(0.5)
    write(bus, 2, TORQUE, 1)
    write(bus, 2, GOAL, 3072)
    bus.step(1.0)
    text = said(bus.no_jump)
    found = re.search(
        r"servo 2 \(xl330-m288\) went ([\d.]+) degrees in ([\d.]+) s, at up to (\d+) degrees/s, from (\d+) to (\d+) at "
        r"0.5\d\d s; its last goal was Goal Position = 3072 at 0.50\d s, and its torque had come on at 0.50\d s: move",
        text,
    )
    assert found, text
    way, took_s, top, first, last = map(float, found.groups())
    assert 70 < way < 90 and 0.1 < took_s < 0.2
    assert top == pytest.approx(103.7 * 6, rel=0.05), "no-load speed of the XL330-M288 at 5 V: 103 rev/min"
    assert 2048 <= first < 2100 and 3000 < last <= 3072
    assert "servo 1" not in text


def test_an_old_goal_jumps_when_torque_comes_on(bus: ServoBus) -> None:
    bus.servo(1).place(1024)
    write(bus, 1, TORQUE, 1)
    bus.step(1.0)
    assert "write its Present Position to its Goal Position before torque comes on" in said(bus.no_jump)


def test_slow_ways_and_small_steps_are_no_jump(bus: ServoBus) -> None:
    write(bus, 1, SPEED, 100)  # 22.9 rev/min are 137 degrees/s
    write(bus, 1, TORQUE, 1)
    write(bus, 1, GOAL, 3500)
    write(bus, 2, TORQUE, 1)
    for k in range(100):
        write(bus, 2, GOAL, 2048 + 20 * k)
        bus.step(0.02)
    assert bus.servo(2).position_ticks > 3900
    bus.no_jump()
    assert "servo 1" in said(lambda: bus.no_jump(deg_s=100))
    bus.no_jump(deg=180, deg_s=100)


def test_a_jump_that_is_told_again_and_again_is_one(bus: ServoBus) -> None:
    write(bus, 1, TORQUE, 1)
    for _ in range(60):
        write(bus, 1, GOAL, 0)
        bus.step(0.01)
    text = said(bus.no_jump)
    assert text.count("servo 1") == 1
    assert float(re.search(r"went ([\d.]+)", text)[1]) > 150  # type: ignore[index]


def test_a_hand_and_a_stuck_shaft_are_no_jump(bus: ServoBus) -> None:
    bus.servo(1).place(100)
    bus.servo(1).place(4000)
    bus.fault("stall:2")
    write(bus, 2, TORQUE, 1)
    write(bus, 2, GOAL, 0)
    bus.step(0.3)
    bus.no_jump()


def test_a_watchdog_ends_a_motion_when_it_trips(bus: ServoBus) -> None:
    """The motion stops after 20 ms of silence, however late somebody looks."""
    write(bus, 1, TORQUE, 1)
    write(bus, 1, (98, 1), 1)
    write(bus, 1, GOAL, 4095)
    bus.step(5.0)
    place = bus.servo(1).position_ticks
    text = said(lambda: bus.no_jump(deg=0.1, deg_s=20))
    assert place < 2200
    assert abs(int(re.search(r"to (\d+) at", text)[1]) - place) <= 1  # type: ignore[index]


# ---------------------------------------------------------------- the others
def test_limits_of_the_servo_and_of_the_test(bus: ServoBus) -> None:
    write(bus, 1, (48, 4), 3000)  # Max Position Limit
    write(bus, 1, TORQUE, 1)
    write(bus, 1, GOAL, 2900)
    bus.step(1.0)
    bus.never_beyond_limits()
    bus.never_beyond_limits((1000, 3000))
    bus.never_beyond_limits({2: (0, 1)})
    text = said(lambda: bus.never_beyond_limits({1: (1000, 2500)}))
    assert re.search(r"servo 1 \(xl330-m288\) got Goal Position = 2900 at .* its limits are 1000 to 2500", text)
    assert re.search(r"moved to 2900 at .* beyond 2500", text)
    write(bus, 1, GOAL, 3001)
    assert "which it refused (data limit); its limits are 0 to 3000" in said(bus.never_beyond_limits)


def test_a_refused_value_of_another_register_is_told(bus: ServoBus) -> None:
    write(bus, 1, SPEED, 40_000)
    assert re.search(r"refused Profile Velocity = 40000 at .*: data", said(bus.never_beyond_limits))
    bus.never_beyond_limits((0, 4095))


def test_a_shaft_outside_may_come_back(bus: ServoBus) -> None:
    bus.servo(1).place(4000)
    write(bus, 1, GOAL, 4000)
    bus.forget()
    write(bus, 1, TORQUE, 1)
    write(bus, 1, GOAL, 2900)
    bus.step(1.0)
    bus.never_beyond_limits((0, 3000))


def test_motors_that_are_left_on_are_told(bus: ServoBus) -> None:
    bus.torque_off_at_exit()
    bus.step(0.25)
    write(bus, 2, TORQUE, 1)
    assert re.search(r"servo 2 .* still has its torque on, since 0.25\d s", said(bus.torque_off_at_exit))
    write(bus, 2, TORQUE, 0)
    bus.torque_off_at_exit()


def test_messages_list_the_first_faults(bus: ServoBus) -> None:
    for k in range(8):
        write(bus, 1, GOAL, 5000 + k)
    text = said(bus.never_beyond_limits)
    assert text.count("5004") == 1 and "5005" not in text and "and 3 more" in text


def test_the_load_of_the_bus_is_bytes_by_baud(bus: ServoBus) -> None:
    for _ in range(20):
        write(bus, 1, GOAL, 2048)  # 16 bytes sent, 11 received
    bus.step(1.0)
    share = 20 * 27 * 10 / 1_000_000 / 0.2
    bus.bus_load_below(share + 0.001)
    text = said(lambda: bus.bus_load_below(share))
    assert "320 bytes sent and 220 received at 1000000 baud" in text and f"{share:.1%}" in text
    open_servos(stepped=True).bus_load_below(0.01)


def test_boards(board: ServoBoard) -> None:
    target(board, 2, 1500)
    target(board, 2, 1540)
    board.no_jump()
    target(board, 2, 1700)
    assert [each.value for each in board.writes_to(2)] == [1500, 1540, 1700]
    assert board.channels[2].value == 1700
    assert "channel 2 went from 1540 to 1700 at once at 0.02" in said(board.no_jump)
    board.never_beyond_limits((1000, 1700))
    assert "channel 2 got target_us = 1700 at" in said(lambda: board.never_beyond_limits({2: (1000, 1600)}))
    board.never_beyond_limits({3: (0, 1)})
    assert "channel 2 is still on with target_us = 1700, since 0.02" in said(board.torque_off_at_exit)
    target(board, 2, 0)
    board.torque_off_at_exit()
    board.bus_load_below(0.1)


def test_a_board_with_a_speed_limit_does_not_jump(board: ServoBoard) -> None:
    target(board, 0, 1500)
    port = board.serial()
    port.write(bytes((0x87, 0, 10, 0)))
    target(board, 0, 1900)
    board.step(1.0)
    board.no_jump()
    assert board.channels[0].value == pytest.approx(1750, abs=10), "10 x 25 us a second"


def test_a_head_of_the_line_protocol_is_a_board() -> None:
    board = open_board("omote", names="jawOpen", stepped=True)
    port = board.serial(timeout=1)
    port.write(b"SET jawOpen 0.5\n")
    assert port.read_until() == b"OK SET 1\n"
    assert [each[1:] for each in board.writes] == [(0, "value", 0.5, "")]
    assert "channel 0 is still on with value = 0.5" in said(board.torque_off_at_exit)
    board.step(3600)
    board.torque_off_at_exit()
    assert len(board.writes) == 1, "what it lets go by itself is no write"


# ---------------------------------------------------------------- ports
@pytest.mark.parametrize("kind", ["pty", "tcp", "rfc2217"])
def test_another_program_opens_the_port(kind: str) -> None:
    program = (
        "import serial, sys; port = serial.serial_for_url(sys.argv[1], 1000000, timeout=10);"
        "port.write(bytes.fromhex(sys.argv[2])); assert len(port.read(11)) == 11"
    )
    packet = encode_instruction(7, Instruction.WRITE, b"\x40\0\1")
    with open_servos({7: "xm430-w350"}, port=kind) as bus:
        subprocess.run([sys.executable, "-c", program, bus.port, packet.hex()], check=True)
        assert [each[1:] for each in bus.writes] == [(7, "Torque Enable", 1, "")]
        assert "servo 7 (xm430-w350)" in said(bus.torque_off_at_exit)


def test_what_a_program_wrote_last_is_seen(tmp_path: Path) -> None:
    """The program has written and gone; nobody waited for an answer."""
    with open_servos("xl330-m288", [1], link=tmp_path / "head") as bus, serial.Serial(bus.port, 1_000_000) as port:
        assert bus.port == str(tmp_path / "head")
        for k in range(200):
            port.write(encode_instruction(1, Instruction.WRITE, b"\x40\0" + bytes((k % 2,))))
            if k == 101:
                assert "still has its torque on" in said(bus.torque_off_at_exit)
                assert len(bus.writes) == 102
        port.write(encode_instruction(1, Instruction.WRITE, b"\x40\0\0"))
        bus.torque_off_at_exit()
        assert len(bus.writes) == 201


def test_waiting(bus: ServoBus) -> None:
    bus.fault("hw:1:0x20:at=2s")
    bus.wait_until(lambda: bus.servo(1).register("Hardware Error Status"))
    assert bus.time_s == pytest.approx(2.0, abs=0.01)
    assert said(lambda: bus.wait_until(lambda: False, 1.0)) == "it did not happen within 1 s; nothing was written"
    write(bus, 1, SPEED, 5)
    assert "Profile Velocity = 5 to 1" in said(lambda: bus.wait_until(lambda: False, 1.0))


def test_time_of_a_port_cannot_be_stepped() -> None:
    with open_servos() as bus:
        calls: list[Callable[[], object]] = [lambda: bus.step(1.0), bus.serial, lambda: bus.link]
        for call in calls:
            with pytest.raises(DriverError, match="runs by itself") as error:
                call()
            assert "stepped=True" in error.value.hint


def test_it_can_be_imported_beside_tests() -> None:
    """pytest collects classes whose name begins with Test."""
    assert not Bench.__name__.startswith("Test")


def test_goals_may_lead_back_from_outside_but_not_further_out(bus: ServoBus) -> None:
    bus.servo(1).place(3500)
    write(bus, 1, TORQUE, 1)
    write(bus, 1, GOAL, 3400)
    bus.step(1.0)
    bus.never_beyond_limits((0, 3000))
    write(bus, 1, GOAL, 3450)
    assert "got Goal Position = 3450" in said(lambda: bus.never_beyond_limits((0, 3000)))
