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
