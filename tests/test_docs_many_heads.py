"""docs/many-heads.md: its stage runs, its tables name every key, and its rules are what Zenoh reads."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from controller.base.parameters import PARAMETERS as P
from controller.stage.heads import HeadSettings
from controller.stage.stage import load_stage
from controller.stage.zenoh import ZenohSettings

PAGE = Path(__file__).resolve().parent.parent / "docs" / "many-heads.md"
TEXT = PAGE.read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)


def keys_behind(words: str) -> set[str]:
    """Keys in the first column of the table that follows some words."""
    table = TEXT[TEXT.index(words) :].split("\n\n")[0]
    first = [row.split("|")[1] for row in table.splitlines() if row.startswith("| `")]
    return set(re.findall(r"`(\w+)`", " ".join(first)))


def test_the_stages_of_the_page_are_right(tmp_path: Path) -> None:
    duet, zenoh = (text for language, text in BLOCKS if language == "toml")
    path = tmp_path / "stage.toml"
    path.write_text(duet)
    stage = load_stage(str(path), P)
    assert [head.name for head in stage.heads] == ["maple", "oak"] and stage.settings.zenoh is None
    assert stage.heads[0].stage.robots and not stage.heads[1].stage.robots
    path.write_text(duet + zenoh)
    table = load_stage(str(path), P).settings.zenoh
    assert table is not None and (table.role, table.way) == ("conductor", "client")


def test_every_key_is_in_its_table_with_its_default() -> None:
    assert keys_behind("| key | default | meaning |\n|---|---|---|\n| `name`") == set(HeadSettings.model_fields)
    assert keys_behind("| key of `[zenoh]`") == set(ZenohSettings.model_fields)
    for name, field in ZenohSettings.model_fields.items():
        shown = re.search(rf"^\| [^|]*`{name}`[^|]*\| (.*?) \|", TEXT[TEXT.index("| key of `[zenoh]`") :], re.MULTILINE)
        assert shown is not None
        if field.default not in ([], None):
            written = shown[1].strip("`")
            assert field.default == (written if written == "all" else json.loads(written)), name


def test_the_choir_is_a_stage_of_three_and_its_host_names_only_heads_that_are_there() -> None:
    stage = load_stage("choir", P)
    names = {head.name for head in stage.heads} | set(stage.settings.head_groups) | {"all"}
    script = (PAGE.parent.parent / "configs" / "scripts" / "choir.toml").read_text()
    assert len(stage.heads) == 3 and set(re.findall(r"@(\w+)", script)) <= names
    assert set(re.findall(r"TURN (\w+)", script)) <= names | {"OFF"}


def test_zenoh_reads_the_rules() -> None:
    zenoh = pytest.importorskip("zenoh", reason="pip install 'omote[zenoh]'")
    from tests.controller.fleet.test_session import RULES

    (rules,) = (text for language, text in BLOCKS if language == "json5")
    config = zenoh.Config.from_json5(rules)
    read = json.loads(config.get_json("access_control"))
    made = zenoh.Config()
    made.insert_json5("access_control", json.dumps(RULES))
    assert read == json.loads(made.get_json("access_control"))
