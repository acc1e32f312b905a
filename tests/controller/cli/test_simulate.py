"""``omote simulate``: which commands there are, their options, and what they are served with."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from controller.base.errors import ConfigError
from controller.cli import simulate
from controller.cli.app import make_app
from controller.tools import simulate as tools
from controller.tools.simulate import Serving
from drivers.base.options import entries
from drivers.core.registry import FAMILIES
from drivers.sim.wire.simulator import simulator_of


def omote(*words: str) -> Any:
    return CliRunner().invoke(make_app(), ["simulate", *words])


def help_of(*words: str) -> str:
    return " ".join(omote(*words, "--help").output.split())


def test_every_family_with_a_simulator_has_a_command_beside_robot_and_host() -> None:
    text = help_of()
    for family in FAMILIES.all():
        assert (f" {family.kind} " in text) == bool(family.simulator)
    assert " robot " in text and " host " in text
    assert omote("nothing").exit_code == 2


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What would be served, in place of serving it until somebody interrupts."""
    found: dict[str, Any] = {}
    monkeypatch.setattr(
        tools, "serve_alone", lambda kind, options, how, _: found.update(kind=kind, options=options, how=how)
    )
    monkeypatch.setattr(tools, "serve_robot", lambda name, bus, how, _: found.update(name=name, bus=bus, how=how))
    monkeypatch.setattr(tools, "serve_host", lambda script, link, _: found.update(script=script, link=link))
    return found


def test_options_of_a_family_and_of_serving_reach_the_server(served: dict[str, Any], tmp_path: Path) -> None:
    link, control = tmp_path / "port", tmp_path / "control"
    words = ["--link", str(link), "--wire", "--latency", "16", "--fault", "mute:7", "--fault", "late:3:45ms", "--watch"]
    result = omote("maestro", "--channels", "12", "--crc", "--baud", "9600", *words, "--control", str(control))
    assert result.exit_code == 0, result.output
    assert served["kind"] == "maestro"
    assert served["how"] == Serving(link, True, 0.016, ("mute:7", "late:3:45ms"), control, True)
    options = served["options"]
    assert (options.channels, options.crc, options.baud) == (12, True, 9600)


def test_without_options_a_family_has_its_usual_ones(served: dict[str, Any]) -> None:
    assert omote("dynamixel").exit_code == 0
    assert served["how"] == Serving() and served["options"].baud == FAMILIES.get("dynamixel").baud
    assert omote("ssc32", "--tcp", "127.0.0.1:0").exit_code == 0
    assert served["how"] == Serving("socket://127.0.0.1:0")
    assert omote("ssc32", "--rfc2217", ":0", "--script", "s.toml", "--record", "r.log").exit_code == 0
    assert served["how"] == Serving("rfc2217://:0", script=Path("s.toml"), record=Path("r.log"))
    assert served["options"].baud == FAMILIES.get("ssc32").baud != FAMILIES.get("dynamixel").baud


def test_a_robot_and_a_host_are_served_by_name(served: dict[str, Any], tmp_path: Path) -> None:
    assert omote("robot", "head24", "--bus", "head", "--tcp", ":7").exit_code == 0
    assert (served["name"], served["bus"], served["how"].link) == ("head24", "head", "socket://:7")
    assert omote("host", "--link", str(tmp_path / "x")).exit_code == 0
    assert (served["script"], served["link"]) == ("tour", tmp_path / "x")


@pytest.mark.parametrize(
    ("words", "message", "hint"),
    [
        (["--link", "x", "--tcp", ":1"], "--link and --tcp exclude each other", "run it twice"),
        (["--rfc2217", ":2", "--tcp", ":1"], "--tcp and --rfc2217 exclude each other", "run it twice"),
        (["--latency", "16"], "--latency is part of the time on the wire", "add --wire"),
    ],
)
def test_options_that_do_not_go_together(served: dict[str, Any], words: list[str], message: str, hint: str) -> None:
    error = omote("maestro", *words).exception
    assert isinstance(error, ConfigError) and message in str(error) and hint in error.hint
    assert served == {}


def test_limits_of_options_are_those_of_the_simulator() -> None:
    assert omote("maestro", "--latency", "1001", "--wire").exit_code == 2
    assert "--crc" in help_of("maestro") and "--channels" in help_of("maestro")
    assert "--model" in help_of("dynamixel") and "--crc" not in help_of("dynamixel")


def test_a_shell_completes_names_of_models_for_that_option_alone() -> None:
    made = [simulate._parameter(entry, None) for entry in entries(simulator_of("dynamixel").options)]
    completed = {each.name: each.annotation.__metadata__[0].autocompletion for each in made}
    assert completed.pop("model") is simulate.models
    assert completed and set(completed.values()) == {None}
