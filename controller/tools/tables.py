"""Fits rich tables to any width of a terminal without cutting a word."""

from __future__ import annotations

from collections.abc import Iterator

from rich.cells import cell_len
from rich.console import Console, RenderableType
from rich.measure import Measurement
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

_UNLIMITED_WIDTH = 100_000


def fit_table(table: Table, console: Console, limit: int | None) -> list[RenderableType]:
    """Return what to print for a table: at most ``limit`` characters wide, wrapped between words.

    Modifies the widths of ``table``. With ``limit`` None it gets its natural width. If the longest words of all columns
    do not fit side by side, every row becomes a paragraph instead.
    """
    columns = _column_cells(table, console)
    natural = Measurement.get(console, console.options.update(width=_UNLIMITED_WIDTH), table).maximum
    if limit is None or natural <= limit:
        table.width = natural
    elif not _try_narrow(table, columns, natural - limit):
        return list(_paragraphs(table, columns))
    return [table]


def _column_cells(table: Table, console: Console) -> list[list[Text]]:
    """Return the cells of every column, its header first."""
    columns = [[column.header, *column.cells] for column in table.columns]
    return [[cell if isinstance(cell, Text) else console.render_str(str(cell)) for cell in cells] for cells in columns]


def _try_narrow(table: Table, columns: list[list[Text]], excess: int) -> bool:
    """Set column widths that make the table ``excess`` characters narrower; False if a word would have to be cut."""
    natural = [max(cell_len(line) for cell in cells for line in cell.plain.split("\n")) for cells in columns]
    least = [max(cell_len(word) for cell in cells for word in ["", *cell.plain.split()]) for cells in columns]
    free = sum(natural) - excess - sum(least)
    if free < 0:
        return False
    order = sorted(range(len(natural)), key=lambda i: natural[i] - least[i])
    for done, i in enumerate(order):  # columns that need little get all of it, the others equal parts of the rest
        added = min(natural[i] - least[i], free // (len(order) - done))
        table.columns[i].width = least[i] + added
        free -= added
    return True


def _paragraphs(table: Table, columns: list[list[Text]]) -> Iterator[RenderableType]:
    """Yield every row as its first cell and, indented, the other cells with the names of their columns."""
    if table.title:
        yield Text(str(table.title), style="italic")
    names = [cells[0].plain for cells in columns]
    for first, *others in zip(*(cells[1:] for cells in columns), strict=True):
        named = [(name, cell) for name, cell in zip(names[1:], others, strict=True) if cell]
        items = [Text.assemble(f"{name}: " if name else "", cell) for name, cell in named]
        first.stylize("bold")
        yield first
        yield Padding(Text("; ").join(items), (0, 0, 0, 2))
