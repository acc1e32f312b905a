"""drivers.dynamixel.bus over a simulated wire: the contract, and how it takes what goes wrong on real ones."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from drivers import open_bus
from drivers.bus import Bus
from drivers.sim import SimulatedBus
from tests.drivers.contract import SERVOS, BusContract

CALM = {"margin_s": 0.5, "watchdog_ms": 0}


@pytest.fixture
def wire() -> Iterator[SimulatedBus]:
    with SimulatedBus(SERVOS) as simulated:
        yield simulated


class TestDynamixelBus(BusContract):
    @pytest.fixture
    def bus(self, wire: SimulatedBus) -> Bus:
        return open_bus("dynamixel", SERVOS, port=wire.path, **CALM)


class TestDynamixelBusFastReads(BusContract):
    @pytest.fixture
    def bus(self, wire: SimulatedBus) -> Bus:
        return open_bus("dynamixel", SERVOS, port=wire.path, fast=True, **CALM)
