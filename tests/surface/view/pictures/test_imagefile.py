"""surface.view.pictures.imagefile"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest

from surface.base.errors import MissingPackage, ViewError
from surface.view.pictures.imagefile import as_image, replacing


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "face.png"
    path.write_text("old")
    with pytest.raises(RuntimeError, match="half way"), replacing(path) as temporary:
        temporary.write_text("new")
        raise RuntimeError("half way")
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_success_replaces_and_is_readable_by_others(tmp_path: Path) -> None:
    path = tmp_path / "face.png"
    path.write_text("old")
    with replacing(path) as temporary:
        assert temporary.suffix == ".png"
        temporary.write_text("new")
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]
    if os.name == "posix":
        assert path.stat().st_mode & 0o777 == 0o644


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(ViewError, match="no folder") as caught, replacing(tmp_path / "a" / "b.png"):
        pass
    assert "mkdir -p" in caught.value.hint


def test_a_target_that_cannot_be_replaced(tmp_path: Path) -> None:
    (tmp_path / "face.png").mkdir()
    with pytest.raises(ViewError, match=r"face\.png"), replacing(tmp_path / "face.png") as temporary:
        temporary.write_text("x")
    assert [entry.name for entry in tmp_path.iterdir()] == ["face.png"]


def test_without_pillow_the_message_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "PIL", None)
    with pytest.raises(MissingPackage, match="Pillow") as caught:
        as_image(np.zeros((2, 2, 3), np.uint8))
    assert caught.value.hint == "pip install 'omote[view]'"
