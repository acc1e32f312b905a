"""``omote ports``, ``scan``, ``set-id``, ``monitor`` and ``calibrate`` over simulated servos."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from controller.base.errors import ConfigError, ControllerError
from controller.cli.app import make_app
from controller.cli.console import console
from drivers.port import ports as ports_module
from drivers.sim import SimulatedBus


@pytest.fixture(autouse=True)
def wide_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(console, "width", 200)


@pytest.fixture
def servos() -> Iterator[SimulatedBus]:
    with SimulatedBus([3, 17], baud=57_600) as bus:
        yield bus


def omote(*words: str) -> Result:
    return CliRunner().invoke(make_app(), list(words))


def said(*words: str) -> str:
    result = omote(*words)
    assert result.exit_code == 0, result.output
    return " ".join(result.output.split())


def test_scan_lists_every_servo_or_says_what_to_look_at(servos: SimulatedBus) -> None:
    text = said("scan", servos.path, "--baud", "57600", "--protocol", "2")
    assert "baud prot. id model fw supply temp. error torque" in " ".join(text.replace("┃", " ").split())
    assert text.count("xl330-m288") == 2 and " 17 " in text
    empty = said("scan", servos.path, "--baud", "1000000", "--protocol", "2")
    assert empty.startswith(f"No servo answered on {servos.path}. Check its power")


def test_set_id_says_what_it_wrote(servos: SimulatedBus) -> None:
    text = said("set-id", servos.path, "3", "5", "--baud", "57600")
    assert text == f"xl330-m288: permanent id 3 -> 5, written and read back on {servos.path}"
    assert servos.chain.servo(5) is not None
    assert omote("set-id", servos.path, "253", "5").exit_code == 2


def test_monitor_asks_or_only_listens_and_ends_in_time(servos: SimulatedBus) -> None:
    asked = said("monitor", servos.path, "--baud", "57600", "--seconds", "0.3", "--rate", "50")
    assert "Present Position" in asked and "write" not in asked
    assert said("monitor", servos.path, "--baud", "57600", "--listen", "--seconds", "0.1") == ""
    wrong = omote("monitor", servos.path, "--listen", "--model", "nothing", "--seconds", "0.1")
    assert "nothing" in str(wrong.exception)


def test_ports_are_a_table_with_hints_below(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ports_module, "list_ports", list)
    assert said("ports").startswith("No serial port found. Plug the adapter in, or try: omote simulate")
    device, by_id, hint = "/dev/ttyX", "/dev/by-id/x", "sudo usermod"
    record = ports_module.PortRecord(device, by_id, "0403:6014", "FT1", "adapter", False, 0.016, hint)
    monkeypatch.setattr(ports_module, "list_ports", lambda: [record])
    text = said("ports")
    for word in ("/dev/by-id/x", "0403:6014", "FT1", "adapter", "no", "16 ms", "/dev/ttyX: sudo usermod"):
        assert word in text


def test_calibrate_needs_channels_that_are_there_and_a_terminal(tmp_path: Path) -> None:
    wrong = omote("calibrate", "head24", "--channel", "jawOpn")
    assert isinstance(wrong.exception, ConfigError)
    assert "robot head24 has no channel called 'jawOpn', did you mean 'jawOpen'" in str(wrong.exception)
    with SimulatedBus([1]):
        refused = omote("calibrate", "head24", "--out", str(tmp_path / "c.toml"))
    assert isinstance(refused.exception, (ControllerError, OSError)) and not (tmp_path / "c.toml").exists()
