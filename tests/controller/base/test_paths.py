"""Finding configuration files."""

from __future__ import annotations

from pathlib import Path

import pytest

from controller.base import paths
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


def test_folders_of_installers_are_looked_through_after_the_checkout(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What an installer wrote down is tested with a wheel, in tests/test_wheel.py."""
    code = tmp_path / "lib" / "python3" / "site-packages"
    monkeypatch.setattr(paths, "__file__", str(code / "controller" / "base" / "paths.py"))
    monkeypatch.setattr(paths.sys, "prefix", str(tmp_path / "environment"))
    monkeypatch.setattr(paths.site, "getuserbase", lambda: str(tmp_path / "user"))
    monkeypatch.setattr(paths, "_installed_files", lambda: ())  # an installer may have installed this very checkout
    with pytest.raises(ConfigError, match="configuration folder is missing") as caught:
        config_dir()
    for base in (tmp_path / "user", tmp_path / "environment", code):
        folder = base / "share" / "omote" / "configs"
        assert str(folder) in str(caught.value)
        (folder / "vocabularies").mkdir(parents=True)
        assert config_dir() == folder
