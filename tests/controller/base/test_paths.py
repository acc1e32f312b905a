"""Finding configuration files."""

from __future__ import annotations

from pathlib import Path

import pytest

from controller.base.errors import ConfigError
from controller.base.paths import VARIABLE, config_dir, find_config


def test_a_checkout_uses_its_own_configs(root: Path) -> None:
    assert config_dir() == root / "configs"


def test_names_paths_and_neighbours(root: Path, tmp_path: Path) -> None:
    shipped = root / "configs" / "scripts" / "tour.toml"
    assert find_config("scripts", "tour") == find_config("scripts", "tour.toml") == shipped
    assert find_config("scripts", str(shipped)) == shipped
    (tmp_path / "own.toml").touch()
    assert find_config("scripts", "own.toml", beside=tmp_path / "stage.toml") == tmp_path / "own.toml"


def test_heads_are_folders(tmp_path: Path) -> None:
    with pytest.raises(ConfigError):
        find_config("heads", str(tmp_path))
    (tmp_path / "head.toml").touch()
    assert find_config("heads", str(tmp_path)) == tmp_path


def test_an_unknown_name_suggests_and_lists() -> None:
    with pytest.raises(ConfigError, match="no script 'tuor', did you mean 'tour'") as caught:
        find_config("scripts", "tuor")
    assert "everything, tour" in caught.value.hint


def test_another_folder_by_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    with pytest.raises(ConfigError, match="configuration folder is missing"):
        config_dir()
    (tmp_path / "vocabularies").mkdir()
    assert config_dir() == tmp_path
