"""``omote bench``: measures heads, the surface engine and the servo bus, and prints tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import nullcontext
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from controller.base.errors import ControllerError
from controller.base.files import replacing
from controller.cli.completion import names_of
from controller.cli.console import console, show_table
from surface.base.extras import require

if TYPE_CHECKING:
    from surface.bench.bench import Measure

PICTURES = (".png", ".svg", ".jpg", ".webp")
MOST_HEADS = 10_000
_KEPT = {None: "", True: "kept", False: "missed"}


class Subject(StrEnum):
    """Things that can be measured."""

    head = "head"
    surface = "surface"
    quadtree = "quadtree"
    drift = "drift"
    crowd = "crowd"
    bus = "bus"


_NEEDS = {Subject.surface: ("scipy",)}
"""What else is compared there."""


def bench(
    what: Annotated[
        Subject,
        typer.Argument(help="A head, the engine at its limit, quad trees, drift, a crowd, or a servo bus."),
    ] = Subject.head,
    head: Annotated[
        str, typer.Option(help="Head: a name from configs/heads or a folder.", autocompletion=names_of("heads"))
    ] = "ict",
    seconds: Annotated[float, typer.Option(help="Time for each measurement.", min=0.01)] = 0.3,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Picture of the meshes (quadtree only).")] = None,
    large: Annotated[
        bool, typer.Option("--large", help="Also a million vertices; for quadtree, ten surfaces.")
    ] = False,
    growth: Annotated[
        Path | None, typer.Option(help="Also growth with size, drawn as this SVG (surface only).")
    ] = None,
    vertices: Annotated[
        int,
        typer.Option(help="Number of vertices, about; --large takes ten times that (surface only).", min=1_000),
    ] = 100_000,
    level: Annotated[int, typer.Option(help="Levels of the uniform mesh (quadtree only).", min=0, max=9)] = 7,
    updates: Annotated[int, typer.Option(help="Number of updates (drift only).", min=1)] = 1_000_000,
    heads: Annotated[int, typer.Option(help="Number of heads (crowd only).", min=1, max=MOST_HEADS)] = 64,
    face: Annotated[bool, typer.Option("--face", help="Also while the face is drawn (bus only).")] = False,
    real: Annotated[
        str, typer.Option("--real", help="Port of a real bus, which is only read (bus only).", metavar="PORT")
    ] = "",
    baud: Annotated[int, typer.Option(help="Baud rate, with --real and --buses.", min=300)] = 1_000_000,
    buses: Annotated[int, typer.Option(help="Several simulated buses at once (bus only).", min=0, max=16)] = 0,
    servos: Annotated[int, typer.Option(help="Servos on each of --buses.", min=1, max=64)] = 12,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON (bus only).")] = False,
) -> None:
    """Measure the engine (full evaluation, incremental updates), other libraries, or a servo bus, in one run.

    Example: omote bench surface --large --growth growth.svg
    """
    _refuse_what_belongs_elsewhere(
        what,
        {
            "--out": (out is not None, Subject.quadtree), "--growth": (growth is not None, Subject.surface),
            "--face": (face, Subject.bus), "--real": (bool(real), Subject.bus), "--json": (as_json, Subject.bus),
            "--buses": (buses > 0, Subject.bus),
        },
    )  # fmt: skip
    if real and buses:
        raise ControllerError("--real measures one bus, --buses simulates several", hint="leave out one of them")
    require(f"omote bench {what}", *_NEEDS.get(what, ()), *(["moderngl"] if face else []), *(["PIL"] if out else []))
    if what is Subject.bus:
        _bench_bus(seconds, face, as_json, real, baud, buses, servos)
        return
    from controller.tools import bench_surface as benches  # imported lazily: not needed for --help

    columns = SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()
    picture = out if what is Subject.quadtree else growth if what is Subject.surface else None
    if picture is not None and picture.suffix.lower() not in PICTURES:
        raise ControllerError(f"{picture}: no picture is named so", hint=f"let it end in {' or '.join(PICTURES)}")
    drawing = nullcontext() if picture is None else replacing(picture)  # refused here if it cannot be written
    with drawing as file, Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("measuring", total=None)

        def log(text: str) -> None:
            progress.reset(task, total=None, description=f"measuring {text}")

        def advance(stage: str, part: float) -> None:
            progress.update(task, description=f"building: {stage}", total=1.0, completed=part)

        simple = {
            Subject.head: lambda: benches.bench_head(head, seconds, log),
            Subject.crowd: lambda: benches.bench_crowd(head, heads, seconds, log),
            Subject.drift: lambda: benches.bench_drift(head, updates, log),
        }
        if what in simple:
            tables = simple[what]()
        elif what is Subject.quadtree:
            tables = benches.bench_savings(head, log, level) if large else []
            tables += benches.bench_quadtree(head, log, level, file)
        else:
            tables = _bench_surface(head, seconds, vertices, large, file, log, advance)
    for title, measures in tables:
        table = Table("measure", "ms", "ratio", "to", "reach", "", title=title, title_justify="left")
        for row in measures:
            took = f"{row.milliseconds:.3f}" if row.milliseconds else ""
            table.add_row(row.name, took, _ratio(row), row.against, row.reach, _KEPT[row.kept])
        show_table(table)


def _refuse_what_belongs_elsewhere(what: Subject, given: Mapping[str, tuple[bool, Subject]]) -> None:
    """Raise ControllerError for an option that was given and belongs to another subject."""
    for option, (is_given, subject) in given.items():
        if is_given and what is not subject:
            raise ControllerError(f"{option} is for {subject}, not for {what}", hint=f"omote bench {subject} {option}")


def _bench_surface(
    head: str, seconds: float, vertices: int, large: bool, growth: Path | None, log: Callable[[str], None],
    advance: Callable[[str, float], None],
) -> list[tuple[str, list[Measure]]]:  # fmt: skip
    """The engine at its limit; also far more vertices if ``large``, and growth with size if that file is given."""
    from controller.tools import bench_surface as benches  # imported lazily: not needed for --help

    tables = benches.bench_surface(seconds, log, vertices, head)
    tables += benches.bench_large(seconds, log, advance, vertices) if large else []
    return tables + (benches.bench_growth(seconds, log, growth, vertices) if growth is not None else [])


def _ratio(row: Measure) -> str:
    """A ratio as text, with its interval where there is one."""
    interval = "" if row.interval is None else f" ({row.interval[0]:.2f} to {row.interval[1]:.2f})"
    return "" if row.ratio is None else f"{row.ratio:.2f}{interval}"


def _bench_bus(seconds: float, face: bool, as_json: bool, real: str, baud: int, buses: int, servos: int) -> None:
    # imported lazily: not needed for --help
    from controller.hardware.bench_many import bench_many
    from controller.hardware.bench_real_bus import bench_real_bus
    from controller.tools.bench_bus import bench_bus, to_json

    errors = Console(stderr=True)  # lines and no moving bar: drawing one would disturb the measurements

    def log(text: str) -> None:
        errors.print(f"measuring {text}", soft_wrap=True)

    seconds = max(seconds, 1.0)
    if real:
        tables = bench_real_bus(real, baud, seconds, log)
    elif buses:
        tables = bench_many(buses, servos, baud, seconds, log)
    else:
        tables = bench_bus(seconds, log, face=face)
    if as_json:
        console.out(to_json(tables), highlight=False)
        return
    for title, figures in tables:
        table = Table("measure", "", "", "reach", "", title=title, title_justify="left")
        for row in figures:
            table.add_row(row.name, f"{row.value:.2f}", row.unit, row.reach, _KEPT[row.kept])
        show_table(table)
