"""drivers.maestro.protocol: the bytes of the User's Guide."""

from __future__ import annotations

import pytest

from drivers.maestro import protocol as m


def test_crc_of_the_guide() -> None:
    assert m.crc7(bytes.fromhex("8301")) == 0x17


@pytest.mark.parametrize(
    ("device", "crc", "sent"),
    [
        (None, False, "84 02 70 2E"),
        (12, False, "AA 0C 04 02 70 2E"),
        (None, True, "84 02 70 2E"),
        (12, True, "AA 0C 04 02 70 2E"),
    ],
)
def test_a_target_in_every_dress(device: int | None, crc: bool, sent: str) -> None:
    data = m.Encoder(device, crc).word(m.SET_TARGET, 2, 6000)
    wanted = bytes.fromhex(sent)
    assert data == wanted + bytes((m.crc7(wanted),) if crc else ())


def test_many_targets_in_one_command() -> None:
    assert m.Encoder().targets(3, [6000, 0]) == bytes.fromhex("9F 02 03 70 2E 00 00")


def test_errors_by_name() -> None:
    assert m.error_names(0) == []
    assert m.error_names(0x114) == ["buffer full", "protocol", "program counter"]


def test_commands_are_numbered_as_in_the_guide() -> None:
    targets = (m.SET_TARGET, m.SET_SPEED, m.SET_ACCELERATION, m.SET_PWM, m.SET_MULTIPLE)
    assert targets == (0x84, 0x87, 0x89, 0x8A, 0x9F)
    assert (m.GET_POSITION, m.GET_MOVING, m.GET_ERRORS, m.GO_HOME) == (0x90, 0x93, 0xA1, 0xA2)
    scripts = (m.STOP_SCRIPT, m.RESTART_SCRIPT, m.RESTART_WITH_PARAMETER, m.SCRIPT_STATUS)
    assert scripts == (0xA4, 0xA7, 0xA8, 0xAE)
    assert (m.POLOLU, m.MINI_SSC) == (0xAA, 0xFF)


def test_units_are_those_of_the_guide() -> None:
    assert pytest.approx(0.25 / 0.010) == m.SPEED_US_S  # 0.25 us per 10 ms
    assert pytest.approx(0.25 / 0.010 / 0.080) == m.ACCELERATION_US_S2  # 0.25 us per 10 ms per 80 ms
    assert (m.MAX_SPEED, m.MAX_ACCELERATION, m.QUARTER) == (16383, 255, 4)


def test_every_error_has_its_bit() -> None:
    assert m.error_names(0x1FF) == [
        "signal", "overrun", "buffer full", "crc", "protocol", "timeout", "script stack", "call stack",
        "program counter",
    ]  # fmt: skip
