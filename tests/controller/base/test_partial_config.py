"""Faults of single values and faults between tables are told together, each at its own place."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel, Field, ValidationError

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS as P
from controller.base.partial_config import PartialConfig
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


class Item(BaseModel, extra="forbid"):
    name: str
    size: int = Field(1, gt=0)


class Box(BaseModel, extra="forbid"):
    items: list[Item] = []
    lids: dict[str, Item] = {}
    label: str = ""
    seal: Item = Item(name="none")


def rest_of(table: dict[str, Any]) -> PartialConfig[Box]:
    with pytest.raises(ValidationError) as caught:
        Box.model_validate(table)
    return PartialConfig(table, Box, caught.value)


def test_a_value_that_does_not_fit_is_removed_and_the_table_stays_where_it_can() -> None:
    table = {"items": [{"name": "a", "size": 0}, {"name": "b", "sise": 2}], "label": "x"}
    rest = rest_of(table)
    assert rest.read == Box(items=[Item(name="a"), Item(name="b")], label="x")
    assert table["items"][0]["size"] == 0  # type: ignore[index]  the table itself is not changed


def test_entries_that_cannot_be_read_are_removed_and_places_are_those_of_the_file() -> None:
    rest = rest_of({"items": [{"size": 1}, {"name": "b"}, {"name": 3}, {"name": "d"}, 5]})
    assert rest.read is not None and [item.name for item in rest.read.items] == ["b", "d"]
    assert rest.relocate(["items[0].x: and items[1]", "lids[0]"]) == ["items[1].x: and items[3]", "lids[0]"]


def test_tables_by_name_are_removed_and_faults_that_name_them_with_them() -> None:
    rest = rest_of({"lids": {"p": {"name": "q"}, "r": {"size": 2}, "s": {"name": "t", "size": "many"}}, "label": 3})
    assert rest.read == Box(lids={"p": Item(name="q"), "s": Item(name="t")})
    told = ["no 'r'", "no 'many'", "no 'p'", "no 'q'"]
    assert rest.relocate(told) == ["no 'p'", "no 'q'"]


def test_of_a_table_that_is_removed_as_a_whole_no_key_counts_as_a_name_that_is_gone() -> None:
    rest = rest_of({"seal": {"size": {"inner": 1}}, "label": "x"})  # its size is wrong, and its name missing
    assert rest.read == Box(label="x")
    assert rest.relocate(["no 'size'", "no 'seal'"]) == ["no 'size'"]


def test_nothing_is_left_of_a_table_that_lacks_a_key_at_its_top() -> None:
    with pytest.raises(ValidationError) as caught:
        Item.model_validate({"size": 2})
    assert PartialConfig({"size": 2}, Item, caught.value).read is None


def test_places_in_lists_of_lists_are_those_of_the_file_however_often_something_is_removed() -> None:
    class Point(BaseModel, extra="forbid"):
        at: list[int] = []

    class Line(BaseModel, extra="forbid"):
        name: str
        points: list[Point] = []

    class Drawing(BaseModel, extra="forbid"):
        lines: list[Line]

    good = {"name": "a", "points": [{"at": [1]}, {"at": [1, "x", 2]}, {"at": "y"}, {"at": [3]}]}
    table = {"lines": [{"points": [{"at": ["x"]}, {"at": [1]}]}, good, {"name": 3}, good]}
    with pytest.raises(ValidationError) as caught:
        Drawing.model_validate(table)
    rest = PartialConfig(table, Drawing, caught.value)
    assert rest.read is not None and [line.points[1].at for line in rest.read.lines] == [[1, 2], [1, 2]]
    told = ["lines[1].points[1].at[1]: wrong", "lines[0].points[3]: wrong", "lines[9].points[0]: wrong"]
    assert rest.relocate(told) == [
        "lines[3].points[1].at[2]: wrong", "lines[1].points[3]: wrong", "lines[9].points[0]: wrong"
    ]  # fmt: skip
