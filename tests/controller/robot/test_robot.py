"""Robot files: the shipped one is whole, a wrong one is told all its faults."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS
from controller.robot.channels import build_table
from controller.robot.robot import load_robot

GOOD = """
name = "two"
[[buses]]
name = "b"
kind = "simulated"
[[channels]]
name = "jaw"
bus = "b"
id = 1
model = "xl330-m288"
mix = { jawOpen = 1.0 }
map = { at = [0, 1], deg = [0, 30] }
limit_deg = [0, 30]
max_speed_deg_s = 300
max_accel_deg_s2 = 3000
"""


def robot_file(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "robot.toml"
    path.write_text(text)
    return path


def test_the_shipped_head_moves_with_every_parameter_it_should(root: Path) -> None:
    robot = load_robot(root / "configs/robots/head24.toml", PARAMETERS)
    assert len(robot.channels) == 24
    used = {name for channel in robot.channels for name in channel.mix}
    cannot = {"jawForward", "tongueOut"}  # this head has no servo for them
    assert set(PARAMETERS.names) - used == cannot


def test_the_shipped_head_is_the_same_on_both_sides(root: Path) -> None:
    robot = load_robot(root / "configs/robots/head24.toml", PARAMETERS)
    by_name = {channel.name: channel for channel in robot.channels}
    for name, channel in by_name.items():
        if not name.endswith("Left") or name.startswith("eye"):
            continue
        other = by_name[name.removesuffix("Left") + "Right"]
        assert (channel.map, channel.limit_deg) == (other.map, other.limit_deg)
        mirrored = {_other_side(key): value for key, value in channel.mix.items()}
        assert mirrored == other.mix


def _other_side(name: str) -> str:
    for a, b in (("Left", "Right"), ("Right", "Left"), ("left", "right"), ("right", "left")):
        if name.endswith(a) or name.startswith(a.lower()):
            return name.replace(a, b) if name.endswith(a) else b.lower() + name[len(a) :]
    return name


def test_neutral_is_inside_the_travel(root: Path) -> None:
    robot = load_robot(root / "configs/robots/head24.toml", PARAMETERS)
    table = build_table(robot.channels, PARAMETERS)
    angles, held = table.angles(PARAMETERS.neutral())
    assert held == 0
    assert np.allclose(angles, 0.0)


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ("jawOpen", "jawOpn", "channels[0].mix.jawOpn: unknown parameter 'jawOpn', did you mean 'jawOpen'"),
        ('bus = "b"', 'bus = "c"', "channels[0].bus: no bus called 'c' (buses: b)"),
        ("id = 1", "id = 253", "channels[0].id: input should be less than or equal to 252 (is 253)"),
        ("limit_deg = [0, 30]", "limit_deg = [30, 0]", "channels[0].limit_deg: the lower limit must be below"),
        ("limit_deg = [0, 30]", "limit_deg = [0, 20]", "channels[0].map.deg: 30 lies outside limit_deg [0, 20]"),
        ("at = [0, 1]", "at = [0, 0]", "channels[0].map: at must rise from point to point"),
        ("at = [0, 1]", "at = [0]", "channels[0].map: at and deg need the same number of points"),
        ("max_speed_deg_s = 300", "max_speed_deg_s = nan", "channels[0].max_speed_deg_s"),
        ("max_speed_deg_s", "max_sped_deg_s", "unknown key, did you mean 'max_speed_deg_s'?"),
        ('kind = "simulated"', 'kind = "dynamixel"', "buses[0]: port is needed for a real bus"),
        ('kind = "simulated"', 'kind = "simulated"\nport = "/dev/x"', "buses[0]: port is for a real bus"),
        ('kind = "simulated"', 'kind = "simulated"\nrate_hz = 5', "buses[0]: watchdog_ms must be 0 or span"),
        ("xl330-m288", "xl999", "channels[0].model: "),
        ("[[channels]]", '[[buses]]\nname = "c"\nkind = "simulated"\n[[channels]]', "buses[1]: no channel is on 'c'"),
    ],
)
def test_a_fault_is_named_with_its_key(tmp_path: Path, old: str, new: str, fault: str) -> None:
    assert old in GOOD
    with pytest.raises(ConfigError) as caught:
        load_robot(robot_file(tmp_path, GOOD.replace(old, new)), PARAMETERS)
    assert fault in str(caught.value)


def test_doubled_names_and_ids_are_all_listed(tmp_path: Path) -> None:
    channel = GOOD[GOOD.index("[[channels]]") :]
    with pytest.raises(ConfigError, match="2 faults") as caught:
        load_robot(robot_file(tmp_path, GOOD + channel), PARAMETERS)
    assert "channels[1].name: 'jaw' is taken by channels[0]" in str(caught.value)
    assert "channels[1].id: 1 is taken by channels[0]" in str(caught.value)


def test_the_good_file_is_good(tmp_path: Path) -> None:
    assert tomllib.loads(GOOD)["name"] == load_robot(robot_file(tmp_path, GOOD), PARAMETERS).name


RULES = """
[profiles.lid]
max_speed_deg_s = 600
[[rules.timing]]
channels = ["jaw"]
toward = "high"
extreme = 0.6
hold_s = 1
fall_s = 1
rest_s = 5
recover_s = 1
[[rules.prevent]]
channel = "jaw"
toward = "high"
extreme = 0.5
other = "lid"
other_toward = "high"
other_extreme = 0.5
"""
LID = GOOD[GOOD.index("[[channels]]") :].replace('"jaw"', '"lid"').replace("id = 1", "id = 2")
LID = LID.replace("max_speed_deg_s = 300", 'profile = "lid"')


def test_a_profile_gives_what_the_channel_does_not_say(tmp_path: Path) -> None:
    robot = load_robot(robot_file(tmp_path, GOOD + LID + RULES), PARAMETERS)
    assert [channel.max_speed_deg_s for channel in robot.channels] == [300, 600]
    assert robot.rules.timing[0].rest_s == 5


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ('profile = "lid"', 'profile = "lit"', "channels[1].profile: no profile called 'lit', did you mean 'lid'"),
        ('channels = ["jaw"]', 'channels = ["jwa"]', "rules.timing[0].channels[0]: no channel called 'jwa'"),
        ('channels = ["jaw"]', "channels = []", "rules.timing[0].channels: "),
        ('other = "lid"', 'other = "lidd"', "rules.prevent[0].other: no channel called 'lidd', did you mean 'lid'"),
        ('other = "lid"', 'other = "jaw"', "rules.prevent[0].other: is the channel itself"),
        ("extreme = 0.6", "extreme = 1.6", "rules.timing[0].extreme: "),
        ("hold_s", "hold", "rules.timing[0].hold: unknown key, did you mean 'hold_s'?"),
        ('toward = "high"\nextreme = 0.6', 'toward = "up"\nextreme = 0.6', "rules.timing[0].toward: "),
        ("[[rules.timing]]", "[[rules.timig]]", "rules.timig: unknown key, did you mean 'timing'?"),
    ],
)
def test_a_faulty_rule_is_named_with_its_key(tmp_path: Path, old: str, new: str, fault: str) -> None:
    text = GOOD + LID + RULES
    assert old in text
    with pytest.raises(ConfigError) as caught:
        load_robot(robot_file(tmp_path, text.replace(old, new)), PARAMETERS)
    assert fault in str(caught.value)


def test_antagonists_share_a_bus(tmp_path: Path) -> None:
    bus = GOOD[GOOD.index("[[buses]]") : GOOD.index("[[channels]]")].replace('"b"', '"c"')
    text = GOOD.replace("[[channels]]", bus + "[[channels]]") + LID.replace('bus = "b"', 'bus = "c"') + RULES
    with pytest.raises(ConfigError, match="'lid' is on another bus than 'jaw'"):
        load_robot(robot_file(tmp_path, text), PARAMETERS)
