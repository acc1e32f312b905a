"""Finding configuration files."""

from __future__ import annotations

from importlib import metadata
from pathlib import Path, PurePosixPath

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


class Installed(PurePosixPath):
    """A file in an installer's list, which knows where it lies."""

    base = Path("/")

    def locate(self) -> Path:
        return self.base / self


def test_the_list_of_an_installer_says_where_the_share_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code = tmp_path / "lib" / "site-packages"
    monkeypatch.setattr(Installed, "base", code)
    monkeypatch.setattr(paths, "__file__", str(code / "controller" / "base" / "paths.py"))
    monkeypatch.setattr(paths.sys, "prefix", str(tmp_path / "environment"))
    monkeypatch.setattr(paths.site, "getuserbase", lambda: str(tmp_path / "user"))
    names = [
        "controller/base/paths.py",
        "vocabularies/a.toml",
        "other/omote/configs/vocabularies/a.toml",
        "share/omote/configs/vocabularies/deeper/a.toml",
        "../../share/omote/configs/vocabularies/arkit.toml",
        "share/omote/configs/vocabularies/late.toml",
    ]
    listed: list[Installed] | None = [Installed(name) for name in names]
    monkeypatch.setattr(metadata, "files", lambda package: listed if package == "omote" else [])
    folder = tmp_path / "share" / "omote" / "configs"
    (folder / "vocabularies").mkdir(parents=True)
    paths._installed_files.cache_clear()
    try:
        assert config_dir() == folder
        paths._installed_files.cache_clear()
        listed = None  # a package without a list
        with pytest.raises(ConfigError, match="is missing"):
            config_dir()

        def unknown(package: str) -> None:
            raise metadata.PackageNotFoundError(package)

        paths._installed_files.cache_clear()
        monkeypatch.setattr(metadata, "files", unknown)
        with pytest.raises(ConfigError, match="is missing"):
            config_dir()
    finally:
        paths._installed_files.cache_clear()
