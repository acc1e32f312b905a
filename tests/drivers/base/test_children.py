"""drivers.base.children: a child process finds the modules that its parent found, and no others."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from drivers.base.children import command, environment, module_path

MODULE = "neighbour.inner"


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package that says where it is, and what of the current folder it got to see."""
    inner = tmp_path / "packages" / "neighbour" / "inner.py"
    inner.parent.mkdir(parents=True)
    inner.parent.joinpath("__init__.py").touch()
    inner.write_text("import sys, stray\nprint(__file__, stray.__file__, *sys.argv[1:], sep='\\n')\n")
    monkeypatch.delitem(sys.modules, "neighbour", raising=False)
    monkeypatch.setattr(sys, "path", [str(inner.parents[1]), str(tmp_path / "strays"), *sys.path])
    for folder in ("strays", "current"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "stray.py").touch()
    return inner


@pytest.mark.parametrize("bare", [True, False])
def test_a_child_finds_what_its_parent_finds_and_nothing_of_the_current_folder(package: Path, bare: bool) -> None:
    current = package.parents[2] / "current"
    done = subprocess.run(
        command(MODULE, "a", "b", bare=bare),
        env=environment(MODULE, bare=bare),
        cwd=current,
        capture_output=True,
        text=True,
    )
    assert done.stderr == ""
    assert done.stdout.splitlines() == [str(package), str(package.parents[2] / "strays" / "stray.py"), "a", "b"]


def test_the_current_folder_is_named_where_the_parent_looks_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", ["", "somewhere"])
    assert module_path("drivers")[:2] == [os.getcwd(), os.path.abspath("somewhere")]


def test_a_package_that_was_found_in_another_way_comes_last(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", ["/somewhere"])
    assert module_path("drivers.core.dead_man_switch") == ["/somewhere", str(root)]


def test_a_bare_child_hears_nothing_of_how_python_shall_run(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("PYTHONWARNINGS", "PYTHONHOME", "OMOTE_TEST"):
        monkeypatch.setenv(name, "error")
    assert "PYTHONWARNINGS" in environment("drivers")
    bare = environment("drivers", bare=True)
    assert "PYTHONWARNINGS" not in bare
    assert (bare["PYTHONHOME"], bare["OMOTE_TEST"]) == ("error", "error")
    assert str(Path(os.__file__).parent) in bare["PYTHONPATH"].split(os.pathsep)
