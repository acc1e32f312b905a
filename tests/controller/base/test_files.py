"""A file is replaced whole or stays as it was."""

from __future__ import annotations

from pathlib import Path

import pytest

from controller.base.errors import ControllerError
from controller.base.files import replacing


def test_replaces_and_leaves_nothing_else(tmp_path: Path) -> None:
    target = tmp_path / "new" / "report.json"
    with replacing(target) as path:
        path.write_text("1")
    with replacing(target) as path:
        path.write_text("2")
    assert target.read_text() == "2"
    assert list(target.parent.iterdir()) == [target]


def test_a_failure_leaves_the_old_file(tmp_path: Path) -> None:
    target = tmp_path / "report.json"
    target.write_text("old")
    with pytest.raises(RuntimeError), replacing(target) as path:
        path.write_text("half")
        raise RuntimeError
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_folder_that_is_a_file_is_one_message(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    with pytest.raises(ControllerError, match="cannot be written") as caught, replacing(tmp_path / "taken" / "x"):
        pass
    assert caught.value.hint
