"""controller.robot.buses: what each family of bus can be told in a robot file, and what it cannot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS
from controller.robot.buses import BusSettings, families_by_option, read_bus
from controller.robot.robot import load_robot
from drivers import kinds, open_bus
from drivers.base.bus import ServoSpec
from drivers.core.families import RESERVED

FAMILIES = kinds()
OPTIONS = families_by_option()
MODEL = {"dynamixel": "xl330-m288", "feetech": "sts3215", "omote": "parameter"}
VALUES: dict[str, Any] = {
    "watchdog_ms": 100, "takeover": "release", "reboot_faulted": True, "min_voltage_v": 4.5, "voltage_wait_s": 1.0,
    "feedback": "position", "slow_group": 2, "margin_s": 0.1, "fast": False, "torque_limit": 0.5, "board": "micro",
    "device": 12, "crc": True, "template": "#{ch}P{us}", "begin": "<", "separator": " ", "end": ">\r",
    "off": "#{ch}P0\r", "query": "?{ch}\r", "answer": "{ch}={us}\r", "stagger_s": 0.1, "checksum": False,
    "heartbeat_s": 0.5,
}  # fmt: skip


def fault(**table: Any) -> str:
    with pytest.raises(ValidationError) as caught:
        read_bus({"name": "head", **table})
    return caught.value.errors()[0]["msg"].removeprefix("Value error, ")


def test_every_option_has_a_value_here_and_every_family_its_options() -> None:
    assert set(VALUES) == set(OPTIONS)
    assert {family for families in OPTIONS.values() for family in families} == set(FAMILIES)


def test_no_family_may_take_a_key_that_every_bus_has() -> None:
    assert set(RESERVED) == set(BusSettings.model_fields)


@pytest.mark.parametrize("family", FAMILIES)
def test_all_options_of_a_family_reach_its_driver(family: str) -> None:
    given = {key: VALUES[key] for key, families in OPTIONS.items() if family in families}
    bus = read_bus({"name": "head", "kind": family, "port": "/dev/null", **given})
    assert bus.options() == {
        "baud": 1_000_000 if family in ("dynamixel", "feetech") else 115_200,
        "port": "/dev/null",
        **given,
    }
    spec = ServoSpec(1, "jaw", MODEL.get(family, "rc-180"), -0.5, 0.5, 5.0, 50.0)
    driver = open_bus(bus.kind, [spec], **bus.options())
    for key in ("takeover", "reboot_faulted", "min_voltage_v"):
        if key in given:
            assert getattr(driver.policy, key) == given[key]


@pytest.mark.parametrize("family", FAMILIES)
def test_a_simulated_bus_takes_the_options_of_its_family(family: str) -> None:
    given = {"template": "{us}\n"} if family == "text" else {}
    table = {"name": "head", "kind": "simulated", "simulates": family, "transport": "tcp", "seed": 3, **given}
    bus = read_bus(table)
    assert bus.family == family
    assert bus.options()["simulates"] == family
    spec = ServoSpec(1, "jaw", MODEL.get(family, "rc-180"), -0.5, 0.5, 5.0, 50.0)
    with open_bus(bus.kind, [spec], **bus.options()) as driver:
        assert driver.path.startswith("socket://127.0.0.1:")


def test_a_bus_that_says_nothing_has_the_usual_settings() -> None:
    bus = read_bus({"name": "b", "kind": "simulated"})
    assert (bus.port, bus.baud, bus.rate_hz, bus.simulates, bus.transport) == ("", 1_000_000, 50.0, "dynamixel", None)
    assert (bus.faults, bus.wire, bus.latency_s, bus.seed) == ([], False, 0.0, 0)


def test_what_is_not_given_is_left_to_the_driver() -> None:
    bus = read_bus({"name": "head", "kind": "maestro", "port": "x"})
    assert bus.options() == {"baud": 115_200, "port": "x"}


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"kind": "maestro"}, "port is needed"),
        ({"kind": "simulated", "simulates": "simulated"}, "unknown bus kind 'simulated'"),
        ({"kind": "dynamixal", "port": "x", "fast": 1}, "unknown bus kind 'dynamixal', did you mean 'dynamixel'?"),
        ({"kind": "simulated", "port": "x"}, "port is for a real bus"),
        (
            {"kind": "maestro", "port": "x", "takeover": "adopt"},
            "takeover is not for maestro, but for dynamixel",
        ),
        ({"kind": "simulated", "simulates": "ssc32", "crc": True}, "crc is not for ssc32, but for maestro"),
        ({"kind": "dynamixel", "port": "x", "faults": ["mute:1"]}, "faults is for a simulated bus"),
        ({"kind": "text", "port": "x"}, "template is missing"),
        (
            {"kind": "text", "port": "x", "template": "#{ch}P{uss}"},
            "template: unknown placeholder {uss}, did you",
        ),
        ({"kind": "dynamixel", "port": "x", "watchdog_ms": 20}, "watchdog_ms must be 0 or span two cycles, 40"),
        ({"kind": "dynamixel", "port": "x", "rate_hz": 5}, "watchdog_ms must be 0 or span two cycles, 400"),
        ({"kind": "dynamixel", "port": "x", "takeover": "grab"}, "Input should be 'adopt', 'release' or 'refuse'"),
    ],
)
def test_what_does_not_fit_is_told(table: dict[str, Any], message: str) -> None:
    assert fault(**table).startswith(message)


ROBOT = """
name = "mine"
[[buses]]
name = "head"
kind = "simulated"
simulates = "{family}"
[[channels]]
name = "jaw"
bus = "head"
id = 1
model = "{model}"
mix = {{ jawOpen = 1 }}
map = {{ at = [0, 1], deg = [0, 20] }}
limit_deg = [0, 20]
max_speed_deg_s = 100
max_accel_deg_s2 = 1000
{more}
"""


@pytest.mark.parametrize(
    ("family", "model", "more", "message"),
    [
        ("maestro", "rc-18", "", "no hobby servo model 'rc-18' (use one of rc-180"),
        ("maestro", "xl330-m288", "", "no hobby servo model 'xl330-m288'"),
        ("dynamixel", "sts3215", "", "sts3215"),
        ("feetech", "sts9", "", "sts3215"),
        ("omote", "rc-1", "", "use one of parameter, degrees, rc-"),
        ("dynamixel", "xl330-m288", "pulse = { deg = [0, 9], us = [1000, 2000] }", "pulse: is for hobby servos"),
        ("maestro", "rc-180", "pulse = { deg = [0, 9, 12], us = [1000, 2000, 1500] }", "us must rise, or fall"),
        ("maestro", "rc-180", "pulse = { deg = [0], us = [1000] }", "pulse"),
    ],
)
def test_models_and_pulses_are_checked_by_family(
    tmp_path: Path, family: str, model: str, more: str, message: str
) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(ROBOT.format(family=family, model=model, more=more))
    with pytest.raises(ConfigError) as caught:
        load_robot(path, PARAMETERS)
    assert message in str(caught.value)
    assert "channels[0]" in str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["eyes-maestro", "head-feetech", "head-dynamixel1", "head-ssc32", "head-text", "head-arduino"]
)
def test_shipped_robots_run(root: Path, name: str) -> None:
    """Each file is right, and its simulated bus follows the face and lets go at the end."""
    from controller.robot.busloop import BusLoop

    robot = load_robot(root / "configs/robots" / f"{name}.toml", PARAMETERS)
    bus = robot.buses[0]
    values = PARAMETERS.neutral()
    loop = BusLoop(bus, robot.on_bus(bus.name), PARAMETERS, lambda: (values, 0))
    loop.start()
    try:
        loop.begin()
        values[[PARAMETERS.index(p) for p in ("jawOpen", "headYaw", "leftEyeYaw", "eyeBlinkLeft")]] = 0.5
        wanted, _ = loop.table.angles(values)
        for _ in range(400):
            state = loop.measured()
            if state is not None and abs(state.position_rad - wanted).max() < 0.03:
                break
            loop._stopping.wait(0.01)
        else:
            raise AssertionError((state, wanted))
        assert loop.error is None
        assert loop.report()["face_difference"] == {} or loop.bus.measures
    finally:
        loop.stop()
