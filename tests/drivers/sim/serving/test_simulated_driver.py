"""kind = "simulated": the contract over servos of its own, and what only this driver does, in a child process."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest

from drivers import open_bus
from drivers.base.bus import Bus, ServoSpec
from drivers.base.errors import DriverError, PortError
from drivers.sim import Maestro
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


@pytest.mark.slow
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


def test_a_port_that_cannot_be_opened_leaves_no_simulation_and_no_folder(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    bus = open_bus("simulated", SERVOS, process=False, faults=["unplug"], **CALM)
    with pytest.raises(PortError):
        bus.open()
    assert bus.simulation is None
    assert list(tmp_path.iterdir()) == []


def test_the_private_folder_goes_with_the_driver(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    bus = open_bus("simulated", SERVOS, process=False, **CALM)
    bus.open()
    (folder,) = tmp_path.iterdir()
    assert (folder / "servos").is_symlink()
    simulation = bus.simulation
    bus.open()
    assert bus.simulation is simulation
    bus.close()
    assert (bus.simulation, list(tmp_path.iterdir())) == (None, [])


@pytest.mark.parametrize(("transport", "scheme"), [("tcp", "socket://127.0.0.1:"), ("memory", "memory://omote-")])
def test_other_transports_need_no_folder(transport: str, scheme: str) -> None:
    bus = open_bus("simulated", SERVOS, process=False, transport=transport, seed=3, wire=True, latency_s=0.001, **CALM)
    bus.open()
    try:
        assert bus.simulation.path.startswith(scheme)
        assert bus.simulation._server._queue._timing.latency_s == 0.001
    finally:
        bus.close()


def test_the_far_end_is_set_as_the_driver_is() -> None:
    spec = ServoSpec(0, "jaw", "rc-180", -0.6, 0.4, 8.0, 200.0)
    bus = open_bus("simulated", [spec], simulates="maestro", transport="memory", crc=True)
    bus.open()
    try:
        assert isinstance(bus.simulation.line, Maestro)
        assert bus.simulation.line.make_reader()._crc
    finally:
        bus.close()
