"""controller.stage.roles and controller.stage.zenoh: which part of a stage each role runs."""

from __future__ import annotations

from pathlib import Path

import pytest

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS as P
from controller.stage.roles import for_role
from controller.stage.stage import Stage, heads_of, load_stage

TEXT = """
name = "split"
show = "tour"
robots = ["head24"]
[zenoh]
listen = ["tcp/127.0.0.1:7447"]
[[links]]
port = "simulated"
script = "tour"
[[heads]]
name = "maple"
[[heads]]
name = "oak"
robots = ["head24"]
take = "a.csv"
"""


def stage_of(tmp_path: Path, text: str = TEXT) -> Stage:
    (tmp_path / "a.csv").write_text("time,jawOpen\n0,0\n1,1\n")
    (tmp_path / "stage.toml").write_text(text)
    return load_stage(str(tmp_path / "stage.toml"), P)


@pytest.mark.parametrize(
    ("role", "robots", "links", "plays"),
    [("conductor", 0, 1, True), ("head", 1, 0, False), ("face", 0, 0, False), ("recorder", 0, 0, False)],
)
def test_each_role_has_its_part_of_the_stage(tmp_path: Path, role: str, robots: int, links: int, plays: bool) -> None:
    first, second = heads_of(for_role(stage_of(tmp_path), role))
    assert [len(first.robots), len(second.robots)] == [robots, robots]
    assert len(first.settings.links) == links
    assert (first.settings.show is not None, second.settings.take is not None) == (plays, plays)


def test_a_process_has_the_heads_that_it_names(tmp_path: Path) -> None:
    stage = for_role(stage_of(tmp_path), "head", ["OAK"])
    assert [head.name for head in stage.heads] == ["oak"]
    assert stage.settings.zenoh is not None and stage.settings.zenoh.role == "head"


def test_a_stage_without_the_table_is_as_it_was_and_has_no_roles(tmp_path: Path) -> None:
    stage = stage_of(tmp_path, 'name = "plain"\nrobots = ["head24"]\n')
    assert for_role(stage) is stage
    with pytest.raises(ConfigError, match=r"no \[zenoh\]"):
        for_role(stage, "head")


@pytest.mark.parametrize(
    ("role", "heads", "said"),
    [("haed", (), "no such role, did you mean 'head'"), ("head", ("aok",), "no head called 'aok', did you mean 'oak'")],
)
def test_wrong_options_are_named(tmp_path: Path, role: str, heads: tuple[str, ...], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        for_role(stage_of(tmp_path), role, heads)


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("", "give listen or connect"),
        ('listen = ["tcp/0.0.0.0:7447"]', "other machines can reach tcp/0.0.0.0:7447"),
        ('listen = ["7447"]', "zenoh.listen[0]"),
        ('connect = ["tcp/a:1"]\nrole = "boss"', "zenoh.role"),
        ('connect = ["tcp/a:1"]\nlease_ms = 5', "zenoh.lease_ms"),
        ('connect = ["tcp/a:1"]\ntls = { ca = "a", key = "b" }', "certificate and key go together"),
        ('connect = ["tcp/a:1"]\nscout = true', "zenoh.scout: unknown key"),
    ],
)
def test_faults_of_the_table_are_named(tmp_path: Path, table: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        stage_of(tmp_path, f'name = "x"\n[zenoh]\n{table}\n')
    assert said in str(caught.value)
