"""Ports, rates and speeds that no hardware has are warned of, each at its place."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from controller.base.parameters import PARAMETERS
from controller.base.paths import config_dir
from controller.cli.app import make_app
from controller.robot.robot import load_robot
from controller.robot.settings import RobotSettings
from controller.tools.robot_warnings import robot_warnings

BUS = '[[buses]]\nname = "{name}"\nkind = "{kind}"\nport = "{port}"\nbaud = {baud}\n'
CHANNEL = """[[channels]]
name = "{name}"
bus = "{name}"
id = 1
model = "{model}"
mix = {{ jawOpen = 1 }}
map = {{ at = [0, 1], deg = [0, 20] }}
limit_deg = [-5, 25]
max_speed_deg_s = {speed}
max_accel_deg_s2 = 3000
"""
USUAL = {"kind": "dynamixel", "port": "/dev/ttyUSB0", "baud": 1_000_000, "model": "xl330-m288", "speed": 300}


def robot(folder: Path, *buses: dict[str, object], name: str = "r") -> RobotSettings:
    tables = [USUAL | {"name": f"b{i}"} | bus for i, bus in enumerate(buses)]
    text = "".join(BUS.format(**each) for each in tables) + "".join(CHANNEL.format(**each) for each in tables)
    path = folder / f"{name}.toml"
    path.write_text(f'name = "{name}"\n{text}')
    return load_robot(path, PARAMETERS)


def test_shipped_robots_have_no_warnings() -> None:
    for path in (config_dir() / "robots").glob("*.toml"):
        assert robot_warnings([load_robot(path, PARAMETERS)]) == [], path


def test_two_buses_on_one_port(tmp_path: Path) -> None:
    (tmp_path / "port").touch()
    (tmp_path / "link").symlink_to(tmp_path / "port")
    one = robot(tmp_path, {"port": tmp_path / "port"}, {"port": tmp_path / "link"})
    (told,) = robot_warnings([one])
    assert told.startswith("r: buses[1].port: ") and "also the port of r: buses[0]" in told
    other = robot(tmp_path, {"port": tmp_path / "port"}, name="other")
    assert robot_warnings([other, one])[0].startswith("r: buses[0].port: ")
    assert robot_warnings([robot(tmp_path, {}, {"port": "/dev/ttyUSB1"})]) == []


@pytest.mark.parametrize(("baud", "adapters"), [(3_000_000, True), (7_000_000, False), (10_000_000, False)])
def test_rates_of_adapters(tmp_path: Path, baud: int, adapters: bool) -> None:
    told = robot_warnings([robot(tmp_path, {"baud": baud})])
    assert (f"r: buses[0].baud: no USB adapter has {baud} bits per second" in told) is not adapters


def test_rates_of_servos(tmp_path: Path) -> None:
    (told,) = robot_warnings([robot(tmp_path, {"baud": 500_000})])
    assert told.startswith("r: buses[0].baud: xl330-m288 cannot be set to 500000 bits per second")
    assert (
        robot_warnings([robot(tmp_path, {"kind": "feetech", "model": "sts3215", "baud": 500_000, "speed": 200})]) == []
    )


@pytest.mark.parametrize(("speed", "told"), [(618, 0), (700, 1)])
def test_speeds_beyond_the_models(tmp_path: Path, speed: float, told: int) -> None:
    found = robot_warnings([robot(tmp_path, {"speed": speed})])
    assert found == ["r: channels[0].max_speed_deg_s: 700 is above the 618 of xl330-m288 without load"][:told]


def test_check_prints_them_and_finds_no_fault(tmp_path: Path) -> None:
    robot(tmp_path, {"speed": 700})
    result = CliRunner().invoke(make_app(), ["check", str(tmp_path / "r.toml")])
    assert result.exit_code == 0 and "  warning: r: channels[0].max_speed_deg_s: 700 is above" in result.output
    (tmp_path / "s.toml").write_text('name = "s"\nrobots = ["r.toml"]\n')
    result = CliRunner().invoke(make_app(), ["check", str(tmp_path / "s.toml")])
    assert result.exit_code == 0 and "  warning: r: channels[0].max_speed_deg_s: 700 is above" in result.output
