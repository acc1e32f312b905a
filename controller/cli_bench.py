"""``omote bench``."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

console = Console(highlight=False)


def register(app: typer.Typer) -> None:
    """Add this module's command to ``app``."""
    app.command()(bench)


def bench(
    head: Annotated[str, typer.Option(help="Head: a name from configs/heads or a folder.")] = "ict",
    seconds: Annotated[float, typer.Option(help="Time for each measurement.", min=0.05)] = 0.5,
) -> None:
    """Measure the surface engine on a head: full evaluation, incremental updates, and peers in the same run.

    Example: omote bench
    """
    from controller.benching import bench_head

    table = Table("measurement", "median (ms)", "ratio", "what it says", title="surface", title_justify="left")
    with console.status("measuring") as status:
        for row in bench_head(head, seconds, lambda text: status.update(f"measuring {text}")):
            table.add_row(*row)
    console.print(table)
