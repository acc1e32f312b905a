"""Faults of single values and faults between tables are told together, each at its own place."""

from __future__ import annotations

from pathlib import Path

import pytest

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS as P
from controller.robot.robot import load_robot
from controller.stage.stage import load_stage

CHANNEL = """
[[channels]]
name = "{name}"
bus = "{bus}"
id = {id}
model = "xl330-m288"
mix = {{ {mix} = 1 }}
map = {{ at = [0, 1], deg = [0, 20] }}
limit_deg = {limits}
{rest}
"""
USUAL = {"bus": "b", "mix": "jawOpen", "limits": [-5, 25], "rest": "max_speed_deg_s = 300\nmax_accel_deg_s2 = 3000"}
TOP = """
name = "r"
profiles.slow = { max_speed_deg_s = 9, max_accel_deg_s2 = 9 }
[[buses]]
name = "b"
kind = "simulated"
"""


def faults_of(path: Path, *channels: dict[str, object], top: str = TOP) -> list[str]:
    path.write_text(top + "".join(CHANNEL.format(**USUAL | {"name": f"c{i}", "id": i} | each)
                                  for i, each in enumerate(channels)))  # fmt: skip
    with pytest.raises(ConfigError) as caught:
        load_robot(path, P)
    first, *faults = str(caught.value).splitlines()
    assert f"{path}: {len(faults)} fault" in first
    return [fault.strip() for fault in faults]


def test_ranges_inside_out_hide_neither_doubled_ids_nor_unknown_names(tmp_path: Path) -> None:
    found = faults_of(tmp_path / "r.toml", {"limits": [25, -5]}, {}, {"id": 1}, {"mix": "jawOpn"}, {"id": "'x'"},
                      {"rest": 'profile = "slwo"'}, {"bus": "c"})  # fmt: skip
    assert found[0].startswith("channels[0].limit_deg: ")
    assert found[1].startswith("channels[4].id: ")
    told = [fault.split(": ")[0] for fault in found[2:]]
    assert sorted(told) == ["channels[2].id", "channels[3].mix.jawOpn", "channels[5].profile", "channels[6].bus"]
    assert "channels[2].id: 1 is taken by channels[1]" in found
    assert next(f for f in found if "profile" in f).endswith("did you mean 'slow'?")


def test_what_is_gone_with_a_fault_is_not_missed(tmp_path: Path) -> None:
    rule = '[[rules.prevent]]\nchannel = "c0"\ntoward = "low"\nextreme = 0.5\nother = "c1"\nother_toward = "high"\n'
    found = faults_of(tmp_path / "r.toml", {"limits": [25, -5]}, {}, top=TOP + rule + "other_extreme = 0.5\n")
    assert [fault.split(": ")[0] for fault in found] == ["channels[0].limit_deg"]


def test_too_little_left_still_tells_the_faults_there_are(tmp_path: Path) -> None:
    assert faults_of(tmp_path / "r.toml", {}, top="") == ["name: missing", "buses: missing"]


def test_a_stage_tells_its_own_faults_and_those_of_what_it_names(tmp_path: Path) -> None:
    stage = tmp_path / "s.toml"
    stage.write_text('name = "s"\nseed = -1\nrobots = ["head25"]\nhead = "icy"\ntake = "none.csv"\n[face]\nfps = 0\n')
    with pytest.raises(ConfigError) as caught:
        load_stage(str(stage), P)
    told = str(caught.value)
    for key in ("seed: ", "face.fps: ", "robots[0]: no robot 'head25'", "head: no head 'icy'", "take: none.csv"):
        assert f"\n  {key}" in told
