"""drivers.maestro.bus over a simulated Maestro: the contract, and what a board that tells nothing of shafts must do."""

from __future__ import annotations

from dataclasses import replace

import pytest

from drivers import open_bus
from drivers.bus import Bus, ServoSpec
from tests.drivers.contract import BusContract

SERVOS = (
    ServoSpec(1, "jaw", "rc-180", -0.6, 0.4, 8.0, 200.0),
    ServoSpec(2, "brow", "rc-90", -0.5, 0.5, 8.0, 200.0, reverse=True),
    ServoSpec(7, "neck", "rc-270", -0.3, 0.9, 8.0, 200.0, zero_rad=0.2),
)
QUICK = {"stagger_s": 0.0, "margin_s": 0.02}


class BoardContract(BusContract):
    SERVOS = SERVOS
    MODELS = ("rc-180", "rc-90", "rc-270")
    ABSENT_ID = None
    STEP_RAD = 0.002
    VOLTS = None
    TEMPERATURE = False
    MEASURES = False
    KIND = "maestro"

    @pytest.fixture
    def bus(self) -> Bus:
        return open_bus("simulated", self.SERVOS, simulates=self.KIND, process=False, **QUICK)


class TestMaestroBus(BoardContract):
    pass


class TestSsc32Bus(BoardContract):
    KIND = "ssc32"
    STEP_RAD = 0.02


class TestTextBus(BoardContract):
    KIND = "text"
    TORQUE = False
    STEP_RAD = 0.003

    @pytest.fixture
    def bus(self) -> Bus:
        texts = {"template": "S{ch},{us}\n", "off": "D{ch}\n"}
        return open_bus("simulated", self.SERVOS, simulates="text", process=False, **texts, **QUICK)


class TestLineOutBus(BoardContract):
    KIND = "omote"
    TORQUE = False
    SERVOS = tuple(replace(servo, model="parameter") for servo in SERVOS)
    MODELS = ("parameter",) * 3
