"""controller.tools.tables: every word of every cell is there whole, at any width."""

from __future__ import annotations

import io

import pytest
from rich.console import Console
from rich.table import Table

from controller.tools.tables import show_table

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


def test_a_file_gets_every_row_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = shown(30, terminal=False).splitlines()
    assert sum("neckPitch" in line and "12.5" in line for line in lines) == 1
    monkeypatch.setenv("COLUMNS", "30")
    assert max(map(len, shown(30, terminal=False).splitlines())) <= 30
