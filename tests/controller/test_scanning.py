"""Scanning finds the servos of a port and says what they are."""

from __future__ import annotations

import pytest

from controller.scanning import scan_port
from drivers.errors import PortMissing
from drivers.sim import SimulatedBus


def test_finds_every_servo_at_its_rate() -> None:
    told: list[str] = []
    with SimulatedBus([3, 17], baud=57_600) as servos:
        rows = list(scan_port(servos.path, [1_000_000, 57_600], told.append))
    assert [row[:3] for row in rows] == [("57600", "3", "xl330-m288"), ("57600", "17", "xl330-m288")]
    assert rows[0][4].endswith(" V")
    assert rows[0][6] == ""
    assert len(told) == 2


def test_a_missing_port_is_one_error() -> None:
    with pytest.raises(PortMissing) as caught:
        list(scan_port("/dev/not-there", [1_000_000], lambda _: None))
    assert caught.value.hint
