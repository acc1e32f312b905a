"""``omote bench``."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from surface.bench import Measure

console = Console(highlight=False)


class Subject(StrEnum):
    """What can be measured."""

    head = "head"
    surface = "surface"
    quadtree = "quadtree"


def register(app: typer.Typer) -> None:
    """Add this module's command to ``app``."""
    app.command()(bench)


def bench(
    what: Annotated[Subject, typer.Argument(help="A head, the engine at its limit, or quad trees.")] = Subject.head,
    head: Annotated[str, typer.Option(help="Head: a name from configs/heads or a folder.")] = "ict",
    seconds: Annotated[float, typer.Option(help="Time for each measurement.", min=0.01)] = 0.3,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Picture of the meshes (quadtree only).")] = None,
) -> None:
    """Measure full evaluation and incremental updates on this machine, and peers in the same run.

    Example: omote bench surface
    """
    from controller.benching import bench_head, bench_quadtree, bench_surface

    with console.status("measuring") as status:

        def tell(text: str) -> None:
            status.update(f"measuring {text}")

        if what is Subject.head:
            tables = bench_head(head, seconds, tell)
        elif what is Subject.surface:
            tables = bench_surface(seconds, tell)
        else:
            tables, variants = bench_quadtree(head, tell)
            if out is not None:
                from surface.comparison import draw

                draw(variants, out)
    for title, rows in tables:
        console.print(measure_table(title, rows))


def measure_table(title: str, rows: list[Measure]) -> Table:
    """A table of measures with their ratios and bounds."""
    table = Table("measure", "ms", "ratio", "to", "reach", "", title=title, title_justify="left")
    for row in rows:
        mark = {None: "", True: "kept", False: "missed"}[row.kept]
        took = f"{row.milliseconds:.3f}" if row.milliseconds else ""
        ratio = "" if row.ratio is None else f"{row.ratio:.2f}"
        table.add_row(row.name, took, ratio, row.against, row.reach, mark)
    return table
