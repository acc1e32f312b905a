"""A file is told by its keys, also where some of them are wrong."""

from __future__ import annotations

import tomllib

import pytest

from controller.base.paths import config_dir
from controller.tools import file_kinds
from controller.tools.file_kinds import KINDS, FileKind, kind_of

SHIPPED = {
    "stages/*": file_kinds.STAGE, "robots/*": file_kinds.ROBOT, "scripts/*": file_kinds.SCRIPT,
    "life/*": file_kinds.LIFE, "vocabularies/arkit*": file_kinds.PARAMETERS, "vocabularies/facs*": file_kinds.UNITS,
    "vocabularies/visemes*": file_kinds.VISEMES, "vocabularies/affect*": file_kinds.MOODS,
    "vocabularies/vrm*": file_kinds.PRESETS,
    "vocabularies/layers*": file_kinds.LAYERS, "vocabularies/expressions*": file_kinds.EXPRESSIONS,
}  # fmt: skip


@pytest.mark.parametrize(("pattern", "kind"), SHIPPED.items())
def test_shipped_files_are_told_even_without_one_of_their_keys(pattern: str, kind: FileKind) -> None:
    files = list(config_dir().glob(f"{pattern}.toml"))
    assert files
    for path in files:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
        assert kind_of(table) is kind
        for key in table if len(table) > 2 else ():
            assert kind_of({k: v for k, v in table.items() if k != key}) is kind, key


def test_channels_of_a_calibration_are_a_table() -> None:
    assert kind_of({"name": "n", "channels": {"jaw": {}}}) is file_kinds.CALIBRATION
    assert kind_of({"name": "n", "channels": [{}]}) is file_kinds.ROBOT


def test_strange_tables_are_of_no_kind() -> None:
    assert kind_of({}) is None and kind_of({"colour": 3}) is None and kind_of({"a": {"b": 1}}) is None


def test_kinds_have_names_of_their_own() -> None:
    assert len({kind.name for kind in KINDS}) == len(KINDS)
