"""kind = "simulated": the contract over servos of its own, and what only this driver does, in a child process."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from drivers import open_bus
from drivers.base.bus import Bus
from drivers.base.errors import DriverError
from tests.drivers.contract import SERVOS, BusContract, settle

CALM = {"margin_s": 0.5, "watchdog_ms": 0}


class TestSimulatedBus(BusContract):
    @pytest.fixture
    def bus(self) -> Bus:
        return open_bus("simulated", SERVOS, process=False, **CALM)


def test_the_port_can_be_given_a_name(tmp_path: Path) -> None:
    link = tmp_path / "head"
    with open_bus("simulated", SERVOS, port=str(link), **CALM) as bus:
        assert link.is_symlink()
        bus.start()
    assert not link.is_symlink()


def test_servos_keep_their_state_over_a_replug() -> None:
    with open_bus("simulated", SERVOS, **CALM) as bus:
        bus.start()
        settle(bus, [0.2, 0.2, 0.2])
        bus.reconnect()
        assert bus.running
        np.testing.assert_allclose(bus.read().position_rad, 0.2, atol=0.01)


def test_faults_reach_the_servos() -> None:
    with (
        open_bus("simulated", SERVOS, faults=["mute:2"], margin_s=0.5) as bus,
        pytest.raises(DriverError, match="id 2"),
    ):
        bus.start()


def test_a_fault_nobody_can_read_is_told_when_it_opens() -> None:
    bus = open_bus("simulated", SERVOS, faults=["sneeze:1"], **CALM)
    with pytest.raises(DriverError, match="sneeze"):
        bus.open()
    assert not bus.is_open
    bus.close()
