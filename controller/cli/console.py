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
    columns = _texts(table, console)
    natural = Measurement.get(console, console.options.update(width=_ANY_WIDTH), table).maximum
    # only a terminal, or the variable COLUMNS, limits the width
    limit = console.width if console.is_terminal or os.environ.get("COLUMNS") else natural
    if natural <= limit:
        table.width = natural
    elif not _narrowed(table, columns, limit - natural):
        _print_paragraphs(table, columns, console)
        return
    console.print(table, crop=False)


def _texts(table: Table, console: Console) -> list[list[Text]]:
    """The cells of every column, its header first."""
    cells = [[column.header, *column.cells] for column in table.columns]
    return [[cell if isinstance(cell, Text) else console.render_str(str(cell)) for cell in own] for own in cells]


def _narrowed(table: Table, columns: list[list[Text]], spare: int) -> bool:
    """Make the table ``-spare`` cells narrower by its columns' widths; False where a word would have to be cut."""
    natural = [max(cell_len(line) for cell in cells for line in cell.plain.split("\n")) for cells in columns]
    least = [max(cell_len(word) for cell in cells for word in ["", *cell.plain.split()]) for cells in columns]
    free = sum(natural) + spare - sum(least)
    if free < 0:
        return False
    order = sorted(range(len(natural)), key=lambda i: natural[i] - least[i])
    for done, i in enumerate(order):  # columns that need little get all of it, the others get equal widths
        added = min(natural[i] - least[i], free // (len(order) - done))
        table.columns[i].width = least[i] + added
        free -= added
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
