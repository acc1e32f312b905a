"""``omote check`` and ``plugins``: check any file that omote reads; list every plug-in."""

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
    """Return the names of stages, robots and heads that begin with ``incomplete``, for the shell's completion."""
    return [name for kind in ("stages", "robots", "heads") for name in names_of(kind)(incomplete)]


def check(
    file: Annotated[
        str,
        typer.Argument(
            help="File of a stage, robot, calibration, head, vocabulary, layers, life (idle motion), script, take, "
            "recording, group or surface: path or name.",
            autocompletion=checkable,
        ),
    ],
    vocabulary: Vocabularies = None,
) -> None:
    """Check any file that omote reads, and all files it refers to, without running it; list every fault with its place.

    Example: omote check configs/robots/head24.toml
    """
    from controller.tools.check import check_anything  # imported lazily: not needed for --help

    for line in check_anything(file, vocabulary_files(vocabulary)):
        console.print(escape(line), soft_wrap=True)


def plugins() -> None:
    """List every kind of bus, linkage, link, format, take and export, of omote and of other packages.

    Example: omote plugins
    """
    from controller.tools.plugins import list_plugins  # imported lazily: not needed for --help

    table, broken = Table(box=None, pad_edge=False), []
    for header in ("registry", "kind", "description", "package"):
        table.add_column(header, overflow="fold")
    for each in list_plugins():
        description = "[red]cannot be loaded" if each.fault else escape(each.title)
        table.add_row(each.registry, each.kind, description, each.package)
        broken += [each] if each.fault else []
    show_table(table)
    for each in broken:
        console.print(f"{escape(each.fault)}\n[bold]try:[/] {escape(each.hint)}", soft_wrap=True)
