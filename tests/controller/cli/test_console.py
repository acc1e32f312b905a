"""controller.cli.console and what users set: colours, widths, signals that are ignored when omote is started."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from rich.console import Console
from rich.table import Table

from controller.cli.console import show_table

OMOTE = [sys.executable, "-c", "from controller.cli.app import main; main()"]


def said(*words: str, **settings: str) -> subprocess.CompletedProcess[str]:
    given = {**os.environ, **settings}
    return subprocess.run([*OMOTE, *words], env=given, capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_narrow_terminal_loses_nothing() -> None:
    result = said("run", "demo", "--dry-run", COLUMNS="30")
    assert result.returncode == 0, result.stderr
    assert result.stdout.split().count("xl330-m288;") == 24


@pytest.mark.slow
def test_a_narrow_terminal_wraps_no_line_of_a_file() -> None:
    result = said("check", "head24", COLUMNS="30")
    assert result.stdout.count("\n") == 1 and len(result.stdout) > 30


@pytest.mark.slow
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


ROWS = [
    ("neckPitch", "head id 2, xl330-m288", "1 headPitch -0.4 mouthClose", "12.5"),
    ("jaw[left]", "a board id 17", "", "-3.0"),
]


def shown(width: int, *, terminal: bool = True) -> str:
    table = Table("channel", "servo", "mix", "neutral (deg)", title="what is sent")
    for name, *others in ROWS:
        table.add_row(name.replace("[", r"\["), *others)
    out = io.StringIO()
    show_table(table, Console(file=out, width=width, force_terminal=terminal, color_system=None))
    return out.getvalue()


@pytest.mark.parametrize("width", [20, 30, 40, 56, 64, 72, 80, 100, 200])
def test_no_word_is_cut_and_no_line_is_too_long(width: int) -> None:
    text = shown(width)
    words = text.replace(";", " ").split()
    for row in ROWS:
        for cell in row:
            for word in cell.split():
                assert word in words, (width, word)
    assert max(map(len, text.splitlines())) <= width


def test_a_narrow_terminal_gets_paragraphs_that_name_what_they_tell() -> None:
    text = " ".join(shown(40).split())
    assert "neckPitch servo: head id 2, xl330-m288; mix: 1 headPitch" in text
    assert "jaw[left] servo: a board id 17; neutral (deg): -3.0" in text
    assert "│" not in text


def test_columns_that_need_little_get_all_of_it() -> None:
    table = Table("a", "b", "c", box=None, padding=0)
    table.add_row("aaaaaaaaaa a", "b b b b b b b b b b b b b b b b b b b bb", "c" * 30 + " c")  # 12, 40 and 32 cells
    show_table(table, Console(file=io.StringIO(), width=10 + 2 + 30 + 10, force_terminal=True))
    assert [column.width for column in table.columns] == [12, 8, 32]


def test_a_file_gets_every_row_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = shown(30, terminal=False).splitlines()
    assert sum("neckPitch" in line and "12.5" in line for line in lines) == 1
    monkeypatch.setenv("COLUMNS", "30")
    assert max(map(len, shown(30, terminal=False).splitlines())) <= 30
