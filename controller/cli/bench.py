"""``omote bench``."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from controller.base.errors import ControllerError
from controller.base.files import replacing
from controller.cli.console import console
from controller.tools.tables import show_table

if TYPE_CHECKING:
    from controller.tools.bench_surface import Tables  # start-up: --help does without it
    from surface.bench.bench import Measure  # start-up: --help does without it
PICTURES = (".png", ".svg", ".jpg", ".webp")


class Subject(StrEnum):
    """What can be measured."""

    head = "head"
    surface = "surface"
    quadtree = "quadtree"
    drift = "drift"
    bus = "bus"


class Bar:
    """A line that says what is measured, and how far a long step is."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._task = progress.add_task("measuring", total=None)

    def tell(self, text: str) -> None:
        """A step of unknown length."""
        self._progress.reset(self._task, total=None, description=f"measuring {text}")

    def advance(self, stage: str, part: float) -> None:
        """A step of which a part is done."""
        self._progress.update(self._task, description=f"building: {stage}", total=1.0, completed=part)


def register(app: typer.Typer) -> None:
    """Add this module's command to ``app``."""
    app.command()(bench)


def bench(
    what: Annotated[
        Subject, typer.Argument(help="A head, the engine at its limit, quad trees, drift, or a servo bus.")
    ] = Subject.head,
    head: Annotated[str, typer.Option(help="Head: a name from configs/heads or a folder.")] = "ict",
    seconds: Annotated[float, typer.Option(help="Time for each measurement.", min=0.01)] = 0.3,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Picture of the meshes (quadtree only).")] = None,
    large: Annotated[bool, typer.Option("--large", help="Also a million vertices (surface only).")] = False,
    growth: Annotated[
        Path | None, typer.Option(help="Also growth with size, drawn as this SVG (surface only).")
    ] = None,
    vertices: Annotated[
        int, typer.Option(help="About how many; --large takes ten times that (surface only).", min=1_000)
    ] = 100_000,
    level: Annotated[int, typer.Option(help="Quarterings of the uniform mesh (quadtree only).", min=0, max=9)] = 7,
    updates: Annotated[int, typer.Option(help="How many (drift only).", min=1)] = 1_000_000,
    face: Annotated[bool, typer.Option("--face", help="Also beside the face (bus only).")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON (bus only).")] = False,
) -> None:
    """Measure full evaluation and incremental updates on this machine, and peers in the same run.

    Example: omote bench surface --large --growth growth.svg
    """
    if what is Subject.bus:
        _bus(seconds, face, as_json)
        return
    columns = SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()
    picture = out if what is Subject.quadtree else growth if what is Subject.surface else None
    with _opened(picture) as file, Progress(*columns, console=console, transient=True) as progress:
        bar = Bar(progress)
        if what is Subject.surface:
            tables = _surface(seconds, bar, large, file, vertices)
        else:
            tables = _head(what, head, seconds, bar, file, updates, level)
    for title, rows in tables:
        show_table(measure_table(title, rows), console)


@contextmanager
def _opened(picture: Path | None) -> Iterator[Path | None]:
    """Where to draw; a place that cannot be written is refused before anything is measured."""
    if picture is None:
        yield None
        return
    if picture.suffix.lower() not in PICTURES:
        raise ControllerError(f"{picture}: no picture is named so", hint=f"let it end in {' or '.join(PICTURES)}")
    with replacing(picture) as file:
        yield file


def _bus(seconds: float, face: bool, as_json: bool) -> None:
    from controller.tools.bench_bus import bench_bus, to_json  # start-up: --help does without it

    says = Console(stderr=True)  # lines and no moving bar: drawing one would disturb what is measured
    tables = bench_bus(max(seconds, 1.0), lambda text: says.print(f"measuring {text}", soft_wrap=True), face=face)
    if as_json:
        console.out(to_json(tables), highlight=False)
        return
    for title, lines in tables:
        table = Table("measure", "", "", "reach", "", title=title, title_justify="left")
        for line in lines:
            mark = {None: "", True: "kept", False: "missed"}[line.kept]
            table.add_row(line.name, f"{line.value:.2f}", line.unit, line.reach, mark)
        show_table(table, console)


def _surface(seconds: float, bar: Bar, large: bool, growth: Path | None, vertices: int) -> Tables:
    from controller.tools.bench_surface import (  # start-up: --help does without it
        bench_growth,
        bench_large,
        bench_surface,
    )

    tables = bench_surface(seconds, bar.tell, vertices)
    if large:
        tables += bench_large(seconds, bar.tell, bar.advance, vertices)
    if growth is not None:
        tables += bench_growth(seconds, bar.tell, growth, vertices)
    return tables


def _head(what: Subject, head: str, seconds: float, bar: Bar, out: Path | None, updates: int, level: int) -> Tables:
    from controller.tools.bench_surface import (  # start-up: --help does without it
        bench_drift,
        bench_head,
        bench_quadtree,
    )

    if what is Subject.head:
        return bench_head(head, seconds, bar.tell)
    if what is Subject.drift:
        return bench_drift(head, updates, bar.tell)
    tables, variants = bench_quadtree(head, bar.tell, level)
    if out is not None:
        from surface.bench.comparison import draw  # start-up: --help does without it

        draw(variants, out)
    return tables


def measure_table(title: str, rows: list[Measure]) -> Table:
    """A table of measures with their ratios and bounds."""
    table = Table("measure", "ms", "ratio", "to", "reach", "", title=title, title_justify="left")
    for row in rows:
        mark = {None: "", True: "kept", False: "missed"}[row.kept]
        took = f"{row.milliseconds:.3f}" if row.milliseconds else ""
        ratio = "" if row.ratio is None else f"{row.ratio:.2f}"
        table.add_row(row.name, took, ratio, row.against, row.reach, mark)
    return table
