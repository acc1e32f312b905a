"""``omote check`` and ``omote plugins`` as a user types them."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from controller.base.errors import ConfigError
from controller.cli.app import make_app
from controller.cli.console import console
from controller.tools import plugins as module
from controller.tools.plugins import ListedPlugin


@pytest.fixture(autouse=True)
def wide_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(console, "width", 200)


def test_check_prints_a_line_for_each_thing_and_raises_every_fault(tmp_path: Path) -> None:
    good = CliRunner().invoke(make_app(), ["check", "serial"])
    assert good.exit_code == 0 and good.output.startswith("stage serial: head ict, links: ")
    assert good.output.endswith("robots: none: good\n")
    (tmp_path / "robot.toml").write_text('name = "r"\nbuses = []\nchannels = []\nspeed = 1')
    bad = CliRunner().invoke(make_app(), ["check", str(tmp_path / "robot.toml")])
    assert isinstance(bad.exception, ConfigError) and "3 faults" in str(bad.exception)


def test_plugins_are_listed_and_broken_ones_explained(monkeypatch: pytest.MonkeyPatch) -> None:
    text = " ".join(CliRunner().invoke(make_app(), ["plugins"]).output.split())
    for words in ("registry kind description package", "bus dynamixel", "link line", "take livelink", "export glb"):
        assert words in text
    assert "cannot be loaded" not in text and "try:" not in text
    broken = ListedPlugin("take", "odd", "", "odd-package 1", "take kind 'odd' [x] is wrong", "pip uninstall odd")
    monkeypatch.setattr(module, "list_plugins", lambda: iter([broken]))
    text = " ".join(CliRunner().invoke(make_app(), ["plugins"]).output.split())
    assert "take odd cannot be loaded odd-package 1" in text
    assert text.endswith("take kind 'odd' [x] is wrong try: pip uninstall odd")
