"""The console that commands print to, and tables at any width of a terminal without cutting a word."""

from __future__ import annotations

import os
import sys

from rich.cells import cell_len
from rich.console import Console
from rich.measure import Measurement
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

_ANY_WIDTH = 100_000


class Screen(Console):
    """Standard output. rich takes ``FORCE_COLOR`` for a terminal and would draw its progress bars into files and pipes;
    here it means colours only.
    """

    def __init__(self) -> None:
        forced = bool(os.environ.get("FORCE_COLOR")) and not sys.stdout.isatty()
        super().__init__(highlight=False, color_system="standard" if forced else "auto")

    @property
    def is_terminal(self) -> bool:
        """Whether standard output is a terminal."""
        try:
            return self.file.isatty()
        except ValueError:  # it is closed
            return False


console = Screen()


def show_table(table: Table, console: Console = console) -> None:
    """Print a table: in its natural width into a file or a pipe, with cells broken between words on a terminal.

    Where even the longest words of a row do not fit side by side, every row is a paragraph instead.
    """
    rows = _texts(table, console)
    natural = Measurement.get(console, console.options.update(width=_ANY_WIDTH), table).maximum
    # a terminal has a width, and COLUMNS asks for one
    most = console.width if console.is_terminal or os.environ.get("COLUMNS") else natural
    if natural <= most:
        table.width = natural
    elif not _narrowed(table, rows, most - natural):
        _print_paragraphs(table, rows, console)
        return
    console.print(table, crop=False)


def _texts(table: Table, console: Console) -> list[list[Text]]:
    """The cells of every column, its header first."""
    cells = [[column.header, *column.cells] for column in table.columns]
    return [[cell if isinstance(cell, Text) else console.render_str(str(cell)) for cell in own] for own in cells]


def _narrowed(table: Table, columns: list[list[Text]], spare: int) -> bool:
    """Give columns the widths that make the table ``-spare`` cells narrower; False where words would be cut."""
    wide = [max(cell_len(line) for cell in own for line in cell.plain.split("\n")) for own in columns]
    least = [max(cell_len(word) for cell in own for word in ["", *cell.plain.split()]) for own in columns]
    left = sum(wide) + spare - sum(least)
    if left < 0:
        return False
    order = sorted(range(len(wide)), key=lambda i: wide[i] - least[i])
    for done, i in enumerate(order):  # those that need little get all of it, the others share equally
        more = min(wide[i] - least[i], left // (len(order) - done))
        table.columns[i].width = least[i] + more
        left -= more
    return True


def _print_paragraphs(table: Table, columns: list[list[Text]], console: Console) -> None:
    """Every row as its first cell and, indented, the others with the names of their columns."""
    if table.title:
        console.print(table.title, style="italic", soft_wrap=True)
    names = [own[0].plain for own in columns]
    for first, *others in zip(*(own[1:] for own in columns), strict=True):
        named = [(name, cell) for name, cell in zip(names[1:], others, strict=True) if cell]
        items = [Text.assemble(f"{name}: " if name else "", cell) for name, cell in named]
        console.print(first, style="bold", soft_wrap=True)
        console.print(Padding(Text("; ").join(items), (0, 0, 0, 2)))
