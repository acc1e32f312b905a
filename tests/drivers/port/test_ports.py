"""drivers.port.ports: the problem of each port, and the command that fixes it."""

from __future__ import annotations

import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from drivers.port.ports import list_ports


def record(device: Path, **changes: object) -> SimpleNamespace:
    base = {"vid": 0x0403, "pid": 0x6014, "serial_number": "FT1", "description": "USB <-> Serial Converter"}
    return SimpleNamespace(device=str(device), **{**base, **changes})


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    (tmp_path / "dev/serial/by-id").mkdir(parents=True)
    (tmp_path / "dev/ttyUSB0").touch()
    (tmp_path / "dev/serial/by-id/usb-FTDI_FT1-if00").symlink_to(tmp_path / "dev/ttyUSB0")
    timer = tmp_path / "sys/bus/usb-serial/devices/ttyUSB0/latency_timer"
    timer.parent.mkdir(parents=True)
    timer.write_text("16\n")
    return tmp_path


def ports(machine: Path, *records: SimpleNamespace) -> list:
    return list_ports(dev_root=machine / "dev", sys_root=machine / "sys", comports=lambda: records)


def test_a_usb_adapter_is_described_in_full(machine: Path) -> None:
    (port,) = ports(machine, record(machine / "dev/ttyUSB0"))
    assert port.device == str(machine / "dev/ttyUSB0")
    assert port.by_id == port.path == str(machine / "dev/serial/by-id/usb-FTDI_FT1-if00")
    assert (port.vid_pid, port.serial_number) == ("0403:6014", "FT1")
    assert port.usable
    assert port.latency_s == 0.016


def test_a_slow_latency_timer_comes_with_the_line_that_mends_it(machine: Path) -> None:
    (port,) = ports(machine, record(machine / "dev/ttyUSB0"))
    assert port.hint == "echo 1 | sudo tee /sys/bus/usb-serial/devices/ttyUSB0/latency_timer"
    (machine / "sys/bus/usb-serial/devices/ttyUSB0/latency_timer").write_text("1\n")
    (port,) = ports(machine, record(machine / "dev/ttyUSB0"))
    assert port.hint == ""


def test_missing_permission_comes_first(machine: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "access", lambda *_: False)
    (port,) = ports(machine, record(machine / "dev/ttyUSB0"))
    assert not port.usable
    assert port.hint.startswith("sudo usermod -a -G ")


def test_a_port_that_is_no_usb_device_has_empty_fields(machine: Path) -> None:
    (machine / "dev/ttyS0").touch()
    plain = record(machine / "dev/ttyS0", vid=None, pid=None, serial_number=None, description="n/a")
    (port,) = ports(machine, plain)
    assert (port.vid_pid, port.serial_number, port.description, port.by_id) == ("", "", "", None)
    assert port.path == port.device
    assert port.latency_s is None


def test_ports_are_sorted_and_the_real_machine_can_be_listed(machine: Path) -> None:
    (machine / "dev/ttyACM0").touch()
    names = [
        Path(p.device).name for p in ports(machine, record(machine / "dev/ttyUSB0"), record(machine / "dev/ttyACM0"))
    ]
    assert names == ["ttyACM0", "ttyUSB0"]
    assert isinstance(list_ports(), list)
