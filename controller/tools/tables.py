"""Tables at any width of a terminal, without cutting a word."""

from __future__ import annotations

from collections.abc import Iterator

from rich.cells import cell_len
from rich.console import Console, RenderableType
from rich.measure import Measurement
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

_ANY_WIDTH = 100_000


def fitted(table: Table, console: Console, limit: int | None) -> list[RenderableType]:
    """The table no wider than ``limit`` cells, with cells broken between words; None for its natural width.

    Where even the longest words of a row do not fit side by side, every row is a paragraph instead.
    """
    columns = _texts(table, console)
    natural = Measurement.get(console, console.options.update(width=_ANY_WIDTH), table).maximum
    if limit is None or natural <= limit:
        table.width = natural
    elif not _narrowed(table, columns, limit - natural):
        return list(_paragraphs(table, columns))
    return [table]


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


def _paragraphs(table: Table, columns: list[list[Text]]) -> Iterator[RenderableType]:
    """Every row as its first cell and, indented, the others with the names of their columns."""
    if table.title:
        yield Text(str(table.title), style="italic")
    names = [own[0].plain for own in columns]
    for first, *others in zip(*(own[1:] for own in columns), strict=True):
        named = [(name, cell) for name, cell in zip(names[1:], others, strict=True) if cell]
        items = [Text.assemble(f"{name}: " if name else "", cell) for name, cell in named]
        first.stylize("bold")
        yield first
        yield Padding(Text("; ").join(items), (0, 0, 0, 2))
