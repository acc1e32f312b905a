"""``omote preflight``, ``service`` and ``calibrate --find-stops``: what they ask, print and end with."""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
import tomli_w
from typer.testing import CliRunner, Result

from controller.cli.app import make_app
from controller.cli.console import console
from drivers.base.bus import ServoSpec
from drivers.sim import SimulatedBus
from drivers.tools.find_stops import Found

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals")

SERVOS = [ServoSpec(1, "jaw", "xm430-w350", -1, 1, 1, 1), ServoSpec(2, "brow", "xl430-w250", -1, 1, 1, 1)]


@pytest.fixture(autouse=True)
def wide_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(console, "width", 250)
    monkeypatch.setattr("controller.hardware.moving.STALE_S", 5.0)
    monkeypatch.setattr("controller.hardware.preflight.SPEED_DEG_S", 40.0)
    monkeypatch.setattr("drivers.port.latency.LATE_S", 0.5)  # the servos are simulated beside busy programs


@pytest.fixture
def head(tmp_path: Path) -> Iterator[tuple[SimulatedBus, Path]]:
    with SimulatedBus(SERVOS) as bus:
        rows = [
            {"name": spec.name, "bus": "main", "id": spec.id, "model": spec.model, "mix": {"jawOpen": 1.0},
             "map": {"at": [0, 1], "deg": [0, 15]}, "limit_deg": [-10, 20], "max_speed_deg_s": 200,
             "max_accel_deg_s2": 2000}
            for spec in SERVOS
        ]  # fmt: skip
        buses = [{"name": "main", "kind": "dynamixel", "port": bus.path, "margin_s": 0.5}]
        path = tmp_path / "head.toml"
        path.write_text(tomli_w.dumps({"name": "head", "buses": buses, "channels": rows}), encoding="utf-8")
        yield bus, path
        assert not any(bus.servo(spec.id).torque for spec in SERVOS)


def omote(*words: str, input: str | None = None) -> Result:
    return CliRunner().invoke(make_app(), list(words), input=input)


@pytest.mark.parametrize("words", [("preflight",), ("calibrate", "--find-stops")])
def test_nothing_moves_without_somebody_to_ask(head: tuple[SimulatedBus, Path], words: tuple[str, ...]) -> None:
    bus, path = head
    result = omote(words[0], str(path), *words[1:])
    assert result.exit_code != 0
    assert "no terminal to ask" in str(result.exception)
    assert bus.servo(1).register("Goal Position") == 2048
    assert bus.servo(1).eeprom_writes == {}


def test_a_preflight_on_a_terminal_asks_first_and_for_every_direction(
    head: tuple[SimulatedBus, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, path = head
    monkeypatch.setattr("controller.cli.hardware._is_interactive", lambda: True)
    refused = omote("preflight", str(path), input="n\n")
    assert "nothing was moved" in str(refused.exception)
    report = tmp_path / "report.toml"
    result = omote("preflight", str(path), "-o", str(report), input="y\ny\ns\nsomebody\n")
    assert result.exit_code == 0, result.output
    assert "did that part, and no other, move first as if jawOpen grew?" in result.output
    assert "is as its file says" in result.output
    table = tomllib.loads(report.read_text(encoding="utf-8"))
    assert (table["passed"], table["signed_by"]) == (True, "somebody")
    assert [row["seen"] for row in table["channels"]] == ["right", "not asked"]


EARS = """
[profile.ear]
region = "head"
range = [0, 1]
max_speed = 6.0
max_acceleration = 80.0
response_s = 0.02
[parameters.ear]
profile = "ear"
"""


@pytest.mark.slow
def test_a_preflight_and_a_description_take_the_parameters_of_the_robots_own(
    head: tuple[SimulatedBus, Path], tmp_path: Path
) -> None:
    _, path = head
    (tmp_path / "ears.toml").write_text(EARS)
    path.write_text('vocabularies = ["ears.toml"]\n' + path.read_text().replace("jawOpen", "ear", 1))
    result = omote("preflight", str(path), "--yes", "-c", "jaw")
    assert result.exit_code == 0, result.output + str(result.exception)
    result = omote("export", str(tmp_path / "head.urdf"), "--robot", str(path))
    assert result.exit_code == 0, result.output + str(result.exception)


def test_a_preflight_with_a_fault_ends_with_one(head: tuple[SimulatedBus, Path], tmp_path: Path) -> None:
    bus, path = head
    bus.fault("stall:1")
    report = tmp_path / "report.json"
    result = omote("preflight", str(path), "--yes", "-c", "jaw", "-o", str(report))
    assert result.exit_code != 0
    assert "head: 1 fault" in str(result.exception)
    assert "nobody has signed" in result.output
    bus.clear()
    assert report.exists()


@pytest.mark.slow
def test_stops_are_shown_beside_the_file_with_limits_that_fit(head: tuple[SimulatedBus, Path]) -> None:
    bus, path = head
    bus.fault(f"stops:1:{2048 - 170}..{2048 + 200}")
    result = omote("calibrate", str(path), "--find-stops", "--yes", "-c", "jaw")
    assert result.exit_code != 0
    said = re.search(r"limit_deg ends at 20, beyond the stop at ([\d.]+)", " ".join(result.output.split()))
    assert said and abs(float(said[1]) - 17.6) < 1.0, result.output
    assert "[-13.9, 16.6]" in result.output
    refused = omote("calibrate", str(path), "--find-stops", "--yes", "-c", "brow")
    assert "xl430-w250 measures no current" in refused.output
    bus.clear()


def test_a_service_is_written_with_its_commands(head: tuple[SimulatedBus, Path], tmp_path: Path) -> None:
    _, path = head
    result = omote("service", str(path), "-o", str(tmp_path / "out"))
    assert result.exit_code == 0, result.output
    assert "sudo systemctl enable --now omote-head.service" in result.output
    assert (tmp_path / "out/omote-head.service").exists()


def test_an_unknown_channel_is_named(head: tuple[SimulatedBus, Path]) -> None:
    _, path = head
    assert "no channel called 'jow'" in str(omote("preflight", str(path), "--yes", "-c", "jow").exception)


def test_stops_are_looked_for_with_the_patience_of_the_robots_file(
    head: tuple[SimulatedBus, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    margins: list[float | None] = []

    def look(*_: object, margin_s: float | None = None, **__: object) -> Found:
        margins.append(margin_s)
        return Found(-0.2, 0.4, 0.0, 0.1, 0)

    monkeypatch.setattr("controller.hardware.stops.find_stops", look)
    omote("calibrate", str(head[1]), "--find-stops", "--yes", "-c", "jaw")
    assert margins == [0.5]
