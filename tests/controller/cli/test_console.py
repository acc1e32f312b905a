"""controller.cli.console and what users set: colours, widths, signals that are ignored when omote is started."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

OMOTE = [sys.executable, "-c", "from controller.cli.app import main; main()"]


def said(*words: str, **settings: str) -> subprocess.CompletedProcess[str]:
    given = {**os.environ, **settings}
    return subprocess.run([*OMOTE, *words], env=given, capture_output=True, text=True, timeout=120, check=False)


def test_forced_colours_bring_no_codes_that_move_a_cursor(tmp_path: Path) -> None:
    (tmp_path / "head").mkdir()
    result = said("render", "--head", str(tmp_path / "head"), "-o", str(tmp_path / "x.png"), FORCE_COLOR="1")
    assert result.returncode == 1
    assert result.stdout == ""
    assert "\x1b[1;31merror:\x1b[0m" in result.stderr
    plugins = said("plugins", FORCE_COLOR="1").stdout
    assert "\x1b[1m" in plugins
    assert "\x1b[?25l" not in plugins
    assert "\x1b" not in said("plugins", NO_COLOR="1").stdout


@pytest.mark.parametrize("columns", ["60", "30"])
def test_a_narrow_terminal_loses_nothing(columns: str) -> None:
    result = said("run", "demo", "--dry-run", COLUMNS=columns)
    assert result.returncode == 0, result.stderr
    assert result.stdout.split().count("xl330-m288;") == 24
    assert said("check", "ict", COLUMNS=columns).stdout.count("\n") == 1


def test_an_interrupt_ends_what_was_started_in_the_background(tmp_path: Path) -> None:
    link = tmp_path / "head"
    words = ["simulate", "dynamixel", "--ids", "1", "--link", str(link)]
    ignoring = ["sh", "-c", 'trap "" INT; exec "$@"', "sh", *OMOTE, *words]
    with subprocess.Popen(ignoring, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            assert process.stdout.readline() == f"ready {link}\n"
            process.send_signal(signal.SIGINT)
            process.wait(60)
        finally:
            process.kill()
    assert not link.is_symlink()
