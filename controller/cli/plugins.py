"""``omote plugins``: every kind of bus, link, take and export there is."""

from __future__ import annotations

import typer

from controller.cli.console import console


def register(app: typer.Typer) -> None:
    """Add this module's command to ``app``."""
    app.command()(plugins)


def plugins() -> None:
    """List every kind of bus, link, take and export: what omote brings, and what other packages add.

    Example: omote plugins
    """
    from rich.markup import escape  # start-up: --help does without it
    from rich.table import Table

    from controller.tools.plugins import listed  # start-up: --help does without it
    from controller.tools.tables import show_table  # start-up: the same

    table, broken = Table(box=None, pad_edge=False), []
    for head in ("sort", "kind", "what it is", "from"):
        table.add_column(head, overflow="fold")
    for each in listed():
        table.add_row(each.sort, each.kind, escape(each.title) if each.works else "[red]cannot be loaded", each.package)
        broken += [] if each.works else [each]
    show_table(table, console)
    for each in broken:
        console.print(f"{escape(each.title)}\n[bold]try:[/] {escape(each.hint)}", soft_wrap=True)
