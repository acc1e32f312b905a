"""``omote ports``, ``scan``, ``set-id``, ``monitor`` and ``calibrate`` over simulated servos."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from rich.progress import Progress, TaskID
from typer.testing import CliRunner, Result

from controller.base.errors import ConfigError, ControllerError
from controller.cli import bus as bus_module
from controller.cli.app import make_app
from controller.cli.console import console
from controller.tools import calibrate as calibrate_module
from controller.tools import monitor as monitor_module
from controller.tools import scan as scan_module
from drivers.port import ports as ports_module
from drivers.sim import SimulatedBus
from drivers.tools import set_id as set_id_module


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


@pytest.mark.slow
def test_scan_lists_every_servo_or_says_what_to_look_at(servos: SimulatedBus) -> None:
    text = said("scan", servos.path, "--baud", "57600", "--protocol", "2")
    assert "baud prot. id model fw supply temp. error torque" in " ".join(text.replace("┃", " ").split())
    assert text.count("xl330-m288") == 2 and " 17 " in text
    empty = said("scan", servos.path, "--baud", "1000000", "--protocol", "2")
    assert empty.startswith(f"No servo answered on {servos.path}. Check its power")


def test_a_scan_says_how_much_there_is_to_do(monkeypatch: pytest.MonkeyPatch, servos: SimulatedBus) -> None:
    totals: list[float] = []

    class Told(Progress):
        def add_task(self, description: str, *words: Any, total: float | None = None, **more: Any) -> TaskID:
            totals.append(total or 0.0)
            return super().add_task(description, *words, total=total, **more)

    monkeypatch.setattr(bus_module, "Progress", Told)
    monkeypatch.setattr(scan_module, "scan_port", lambda port, plan, report: iter(()))
    said("scan", servos.path, "--baud", "57600")
    assert totals == [2 * scan_module.STEPS]  # both protocols


def test_a_narrow_terminal_breaks_no_message(monkeypatch: pytest.MonkeyPatch, servos: SimulatedBus) -> None:
    monkeypatch.setattr(console, "width", 30)
    empty = omote("scan", servos.path, "--baud", "1000000", "--protocol", "2").output
    assert f"No servo answered on {servos.path}. Check its power, the wiring and the adapter's direction" in empty
    assert "written and read back on" in omote("set-id", servos.path, "3", "5", "--baud", "57600").output


def test_set_id_says_what_it_wrote(servos: SimulatedBus) -> None:
    text = said("set-id", servos.path, "3", "5", "--baud", "57600")
    assert text == f"xl330-m288: permanent id 3 -> 5, written and read back on {servos.path}"
    assert servos.chain.servo(5) is not None
    assert omote("set-id", servos.path, "253", "5").exit_code == 2


@pytest.mark.slow
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


def test_ports_without_a_timer_or_a_fault_have_empty_cells(monkeypatch: pytest.MonkeyPatch) -> None:
    record = ports_module.PortRecord("/dev/ttyY", None, "", "", "plain", True, None, "")
    monkeypatch.setattr(ports_module, "list_ports", lambda: [record])
    text = said("ports").replace("│", " ").replace("┃", " ")
    words = " ".join(text.split())
    assert "port usb serial number description usable latency timer" in words
    assert "/dev/ttyY plain yes" in words and " ms" not in words and "no" not in words.split()
    assert "/dev/ttyY:" not in words


def test_a_scan_tries_all_rates_and_both_protocols_unless_it_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    plans: list[Any] = []

    def scan_port(port: str, plan: Any, progress: Any) -> Iterator[scan_module.Found]:
        plans.append((port, plan))
        progress("trying", 1)
        yield scan_module.Found(57_600, 1, None)

    monkeypatch.setattr(scan_module, "scan_port", scan_port)
    assert "57600" in said("scan", "p")
    said("scan", "p", "--baud", "9600", "--baud", "57600", "--protocol", "1")
    both = [(2, baud) for baud in scan_module.BAUDS[2]] + [(1, baud) for baud in scan_module.BAUDS[1]]
    assert plans == [("p", both), ("p", [(1, 9600), (1, 57_600)])]
    for wrong in ("0", "3"):
        assert omote("scan", "p", "--protocol", wrong).exit_code == 2


class Terminal(io.StringIO):
    """A file that says it is a terminal."""

    def isatty(self) -> bool:
        return True


def test_a_terminal_keeps_no_bar_of_a_scan(servos: SimulatedBus, monkeypatch: pytest.MonkeyPatch) -> None:
    out = Terminal()
    monkeypatch.setattr(console, "_file", out)  # its property would bind the standard output of this moment
    monkeypatch.setattr(console, "is_interactive", True)
    assert omote("scan", servos.path, "--baud", "57600", "--protocol", "2").exit_code == 0
    assert "57600 baud" in out.getvalue()
    assert "baud, Protocol" not in out.getvalue().rpartition("\x1b[2K")[2]  # what stays when the last line is erased
    assert "xl330-m288" in out.getvalue().rpartition("\x1b[2K")[2]


def test_set_id_is_given_the_usual_rate_and_protocol(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[Any] = []

    def change(*words: Any, **named: Any) -> Any:
        calls.append((*words, named))
        return type("Info", (), {"model": "m", "id": words[-1]})

    monkeypatch.setattr(set_id_module, "set_id", change)
    assert said("set-id", "p", "0", "252") == "m: permanent id 0 -> 252, written and read back on p"
    said("set-id", "p", "252", "0", "--protocol", "1", "--baud", "9600", "--release")
    assert calls == [("p", 1_000_000, None, 0, 252, {"release": False}), ("p", 9600, 1, 252, 0, {"release": True})]
    for words in (("253", "1"), ("1", "253"), ("1", "2", "--protocol", "3"), ("1", "2", "--protocol", "0")):
        assert omote("set-id", "p", *words).exit_code == 2


def test_a_monitor_asks_ten_times_a_second_unless_it_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[Any] = []

    def polled(port: str, baud: int, protocol: int, _: Any, going: Any, rate: float, record: Any) -> None:
        calls.append((port, baud, protocol, rate, going()))

    def heard(port: str, baud: int, protocol: int, _: Any, going: Any, model: str, record: Any) -> None:
        calls.append((port, baud, protocol, model, going()))

    monkeypatch.setattr(monitor_module, "poll_servos", polled)
    monkeypatch.setattr(monitor_module, "listen_to_bus", heard)
    said("monitor", "p")
    said("monitor", "p", "--rate", "0.1", "--baud", "9600", "--protocol", "1")
    said("monitor", "p", "--rate", "200", "--seconds", "0.1")
    said("monitor", "p", "--listen")
    said("monitor", "p", "--listen", "--model", "ax-12a")
    assert calls == [
        ("p", 1_000_000, None, 10.0, True), ("p", 9600, 1, 0.1, True), ("p", 1_000_000, None, 200.0, True),
        ("p", 1_000_000, None, "", True), ("p", 1_000_000, None, "ax-12a", True),
    ]  # fmt: skip
    for words in (("--rate", "0.09"), ("--rate", "200.1"), ("--seconds", "0.09"), ("--protocol", "3")):
        assert omote("monitor", "p", *words).exit_code == 2


def test_a_monitor_takes_a_port_or_a_record(tmp_path: Path) -> None:
    record = tmp_path / "bus.log"
    record.write_text("# omote traffic = 1\n# servos = 1:xl330-m288\n0.5 > ff ff fd 00 01 03 00 01 19 4e\n")
    assert said("monitor", "--replay", str(record)) == "0.500 -> 1 ping"
    for words in ((), ("p", "--replay", str(record))):
        error = omote("monitor", *words).exception
        assert isinstance(error, ConfigError) and "either a port or --replay" in str(error)


def test_a_calibration_is_given_its_channels_and_place(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, root: Path
) -> None:
    calls: list[Any] = []
    written = [True]

    def run(robot: Any, channels: Any, name: str, target: Path, margin: float, _: Any) -> bool:
        calls.append((robot.name, [channel.name for channel in channels], name, target, margin))
        return written[0]

    monkeypatch.setattr(calibrate_module, "run_calibration", run)
    text = said("calibrate", "head24")
    robot, names, name, target, margin = calls[0]
    assert (robot, len(names), name, margin) == ("head24", 24, "default", 1.0)
    assert target == root / "configs/robots/head24.default.calibration.toml"
    assert text == f'wrote {target} To use it, write in the robot file: calibration = "default"'
    out = str(tmp_path / "c.toml")
    text = said("calibrate", "head24", "-c", "jawOpen", "--out", out, "--margin", "0", "--name", "desk")
    assert calls[1] == ("head24", ["jawOpen"], "desk", Path(out), 0.0)
    assert text == f'wrote {out} To use it, write in the robot file: calibration = "{out}"'
    written[0] = False
    assert said("calibrate", "head24", "--margin", "20") == "" and calls[2][-1] == 20.0
    for wrong in ("-0.1", "20.1"):
        assert omote("calibrate", "head24", "--margin", wrong).exit_code == 2
