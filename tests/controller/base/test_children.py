"""Child processes that run this omote."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from controller.base import children
from controller.base.children import child_environment, module_command


def test_a_child_finds_this_omote_and_nothing_beside_it(tmp_path: Path) -> None:
    (tmp_path / "controller.py").write_text("raise SystemExit('the wrong one')")
    command = [*module_command("controller.links.line.host"), "--help"]
    done = subprocess.run(command, cwd=tmp_path, env=child_environment(), capture_output=True, text=True, timeout=60)
    assert done.returncode == 0 and "--script" in done.stdout
    assert command[0] == sys.executable


def test_other_places_stay_behind_it_and_none_is_there_twice(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(["/a", str(root), "/b"]))
    assert child_environment()["PYTHONPATH"].split(os.pathsep) == [str(root), "/a", "/b"]


def test_an_installed_omote_is_found_without_help(monkeypatch: pytest.MonkeyPatch) -> None:
    """Folders of installed packages must not come before the standard library, as PYTHONPATH does."""
    monkeypatch.setattr(children, "_HOME", Path(sysconfig.get_path("purelib")))
    monkeypatch.delenv("PYTHONPATH", raising=False)
    assert "PYTHONPATH" not in child_environment()
