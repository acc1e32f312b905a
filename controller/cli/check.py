"""``omote check`` and ``plugins``: check any file omote reads; list every kind of bus, link, take and export."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from controller.cli.completion import names_of
from controller.cli.console import console, show_table
from controller.cli.heads import Vocabularies
from controller.cli.run import vocabulary_files


def checkable(incomplete: str) -> list[str]:
    """Names that can be checked."""
    return [name for kind in ("stages", "robots", "heads") for name in names_of(kind)(incomplete)]


def check(
    file: Annotated[
        str,
        typer.Argument(
            help="A stage, robot, calibration, head, vocabulary, layers, life, script, take, recording, group or "
            "surface: path or name.",
            autocompletion=checkable,
        ),
    ],
    vocabulary: Vocabularies = None,
) -> None:
    """Check any file omote reads, and all it refers to, without running it; lists every fault with its place.

    Example: omote check configs/robots/head24.toml
    """
    from controller.tools.check import check_anything  # imported lazily: not needed for --help

    for line in check_anything(file, vocabulary_files(vocabulary)):
        console.print(escape(line), soft_wrap=True)


def plugins() -> None:
    """List every kind of bus, link, take and export: what omote brings, and what other packages add.

    Example: omote plugins
    """
    from controller.tools.plugins import listed  # imported lazily: not needed for --help

    table, broken = Table(box=None, pad_edge=False), []
    for head in ("sort", "kind", "what it is", "from"):
        table.add_column(head, overflow="fold")
    for each in listed():
        table.add_row(each.sort, each.kind, escape(each.title) if each.works else "[red]cannot be loaded", each.package)
        broken += [] if each.works else [each]
    show_table(table)
    for each in broken:
        console.print(f"{escape(each.title)}\n[bold]try:[/] {escape(each.hint)}", soft_wrap=True)
