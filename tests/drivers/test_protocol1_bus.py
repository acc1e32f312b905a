"""drivers.protocol1.bus over simulated wires: the contract for every family that has its framing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from drivers import open_bus
from drivers.bus import Bus
from drivers.sim import SimulatedBus
from tests.drivers import contract
from tests.drivers.contract import BusContract

CALM = {"margin_s": 0.5, "watchdog_ms": 0}


def servos_of(*models: str) -> tuple[contract.ServoSpec, ...]:
    return tuple(replace(servo, model=model) for servo, model in zip(contract.SERVOS, models, strict=True))


class Family(BusContract):
    """The contract over a simulated wire of ``SERVOS``."""

    KIND: ClassVar[str] = "feetech"

    @pytest.fixture
    def wire(self, tmp_path: Path) -> Iterator[SimulatedBus]:
        with SimulatedBus(self.SERVOS, link=tmp_path / "by-id") as simulated:
            yield simulated

    @pytest.fixture
    def bus(self, wire: SimulatedBus) -> Bus:
        return open_bus(self.KIND, self.SERVOS, port=wire.path, **CALM)


class TestFeetechSts(Family):
    MODELS = ("sts3215",) * 3
    SERVOS = servos_of(*MODELS)
    VOLTS = 7.4


class TestFeetechScs(Family):
    MODELS = ("scs0009",) * 3
    SERVOS = servos_of(*MODELS)
    VOLTS = 6.0
    STEP_RAD = np.deg2rad(300) / 1024


class TestDynamixelAx(Family):
    KIND = "dynamixel"
    MODELS = ("ax-12a",) * 3
    SERVOS = servos_of(*MODELS)
    VOLTS = 12.0
    STEP_RAD = np.deg2rad(300) / 1024


class TestDynamixelMx(Family):
    KIND = "dynamixel"
    MODELS = ("mx1-28",) * 3
    SERVOS = servos_of(*MODELS)
    VOLTS = 12.0


class TestDynamixelOfBothProtocols(Family):
    KIND = "dynamixel"
    MODELS = ("ax-12a", "xm430-w350", "mx1-28")
    SERVOS = servos_of(*MODELS)
    VOLTS = 12.0
    STEP_RAD = np.deg2rad(300) / 1024


class TestSimulated(Family):
    MODELS = ("sts3215",) * 3
    SERVOS = servos_of(*MODELS)
    VOLTS = 7.4

    @pytest.fixture
    def bus(self) -> Bus:
        return open_bus("simulated", self.SERVOS, simulates="feetech", **CALM)
