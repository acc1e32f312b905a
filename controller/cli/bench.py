"""``omote bench``: measures heads, the surface engine or a servo bus, and prints tables."""

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

PICTURE_SUFFIXES = (".png", ".svg", ".jpg", ".webp")
MAX_HEADS = 10_000
_VERDICTS = {None: "", True: "met", False: "missed"}


class Subject(StrEnum):
    """What ``omote bench`` can measure."""

    head = "head"
    surface = "surface"
    quadtree = "quadtree"
    drift = "drift"
    crowd = "crowd"
    bus = "bus"


_PACKAGES = {Subject.surface: ("scipy",)}
"""Optional packages that a subject needs, because it compares omote with them."""


def bench(
    subject: Annotated[
        Subject,
        typer.Argument(
            help="One head; the surface engine on many vertices; the savings of quad trees; the rounding error that "
            "updates accumulate (drift); a crowd of heads; or a servo bus."
        ),
    ] = Subject.head,
    head: Annotated[
        str,
        typer.Option(
            help="Head: a name from configs/heads or a folder (all but bus).", autocompletion=names_of("heads")
        ),
    ] = "ict",
    seconds: Annotated[
        float, typer.Option(help="Time for each measurement (not for quadtree and drift).", min=0.01)
    ] = 0.3,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Picture of the meshes (quadtree only).")] = None,
    large: Annotated[
        bool,
        typer.Option("--large", help="surface: also ten times --vertices; quadtree: also ten surfaces; else ignored."),
    ] = False,
    growth: Annotated[
        Path | None,
        typer.Option(help="Also measure how time and memory grow with size; picture to write (surface only)."),
    ] = None,
    vertices: Annotated[
        int,
        typer.Option(help="Approximate number of vertices (surface; ignored elsewhere).", min=1_000),
    ] = 100_000,
    level: Annotated[
        int, typer.Option(help="Subdivision levels of the uniform mesh (quadtree; ignored elsewhere).", min=0, max=9)
    ] = 7,
    updates: Annotated[int, typer.Option(help="Number of updates (drift; ignored elsewhere).", min=1)] = 1_000_000,
    heads: Annotated[int, typer.Option(help="Number of heads (crowd; ignored elsewhere).", min=1, max=MAX_HEADS)] = 64,
    face: Annotated[bool, typer.Option("--face", help="Also measure while the face is drawn (bus only).")] = False,
    real: Annotated[
        str, typer.Option("--real", help="Port of a real bus, which is only read (bus only).", metavar="PORT")
    ] = "",
    baud: Annotated[
        int, typer.Option(help="Baud rate of --real or --buses; ignored without them.", min=300)
    ] = 1_000_000,
    buses: Annotated[
        int, typer.Option(help="Measure this many simulated buses at the same time (bus only).", min=0, max=16)
    ] = 0,
    servos: Annotated[int, typer.Option(help="Servos on each of --buses; ignored without it.", min=1, max=64)] = 12,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON (bus only).")] = False,
) -> None:
    """Measure the surface engine (full evaluation, incremental updates), other libraries, or a servo bus.

    An option that is marked "only" is refused for another subject.

    Example: omote bench surface --large --growth growth.svg
    """
    _reject_inapplicable_options(
        subject,
        {
            "--out": (out is not None, Subject.quadtree), "--growth": (growth is not None, Subject.surface),
            "--face": (face, Subject.bus), "--real": (bool(real), Subject.bus), "--json": (as_json, Subject.bus),
            "--buses": (buses > 0, Subject.bus),
        },
    )  # fmt: skip
    if real and buses:
        raise ControllerError("--real measures one bus, --buses simulates several", hint="leave out one of them")
    packages = [*_PACKAGES.get(subject, ()), *(["moderngl"] if face else []), *(["PIL"] if out else [])]
    require(f"omote bench {subject}", *packages)
    if subject is Subject.bus:
        _bench_bus(seconds, face, as_json, real, baud, buses, servos)
        return
    from controller.tools import bench_surface as benches  # imported lazily: not needed for --help

    columns = SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()
    picture = out if subject is Subject.quadtree else growth if subject is Subject.surface else None
    if picture is not None and picture.suffix.lower() not in PICTURE_SUFFIXES:
        known = " or ".join(PICTURE_SUFFIXES)
        raise ControllerError(f"{picture}: unknown suffix of a picture", hint=f"let it end in {known}")
    drawing = nullcontext() if picture is None else replacing(picture)  # a path that cannot be written fails here
    with drawing as file, Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("measuring", total=None)

        def log(text: str) -> None:
            progress.reset(task, total=None, description=f"measuring {text}")

        def advance(step: str, fraction: float) -> None:
            progress.update(task, description=f"building: {step}", total=1.0, completed=fraction)

        simple = {
            Subject.head: lambda: benches.bench_head(head, seconds, log),
            Subject.crowd: lambda: benches.bench_crowd(head, heads, seconds, log),
            Subject.drift: lambda: benches.bench_drift(head, updates, log),
        }
        if subject in simple:
            tables = simple[subject]()
        elif subject is Subject.quadtree:
            tables = benches.bench_savings(head, log, level) if large else []
            tables += benches.bench_quadtree(head, log, level, file)
        else:
            tables = _bench_surface(head, seconds, vertices, large, file, log, advance)
    for title, measures in tables:
        table = Table("measure", "ms", "ratio", "ratio to", "bound", "", title=title, title_justify="left")
        for row in measures:
            took = f"{row.milliseconds:.3f}" if row.milliseconds else ""
            table.add_row(row.name, took, _format_ratio(row), row.against, row.reach, _VERDICTS[row.kept])
        show_table(table)


def _reject_inapplicable_options(subject: Subject, given: Mapping[str, tuple[bool, Subject]]) -> None:
    """Raise ControllerError for an option that was given and applies only to another subject."""
    for option, (is_given, owner) in given.items():
        if is_given and subject is not owner:
            raise ControllerError(f"{option} is for {owner}, not for {subject}", hint=f"omote bench {owner} {option}")


def _bench_surface(
    head: str, seconds: float, vertices: int, large: bool, growth: Path | None, log: Callable[[str], None],
    advance: Callable[[str, float], None],
) -> list[tuple[str, list[Measure]]]:  # fmt: skip
    """Return the tables of the engine; if ``large``, also for ten times the vertices; if ``growth``, also by size."""
    from controller.tools import bench_surface as benches  # imported lazily: not needed for --help

    tables = benches.bench_surface(seconds, log, vertices, head)
    tables += benches.bench_large(seconds, log, advance, vertices) if large else []
    return tables + (benches.bench_growth(seconds, log, growth, vertices) if growth is not None else [])


def _format_ratio(row: Measure) -> str:
    """Return a ratio as text, with its confidence interval if it has one."""
    interval = "" if row.interval is None else f" ({row.interval[0]:.2f} to {row.interval[1]:.2f})"
    return "" if row.ratio is None else f"{row.ratio:.2f}{interval}"


def _bench_bus(seconds: float, face: bool, as_json: bool, real: str, baud: int, buses: int, servos: int) -> None:
    # imported lazily: not needed for --help
    from controller.hardware.bench_many import bench_many
    from controller.hardware.bench_real_bus import bench_real_bus
    from controller.tools.bench_bus import bench_bus, to_json

    errors = Console(stderr=True)  # prints lines, because drawing a progress bar would disturb the measurements

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
        table = Table("measure", "", "", "bound", "", title=title, title_justify="left")
        for row in figures:
            table.add_row(row.name, f"{row.value:.2f}", row.unit, row.reach, _VERDICTS[row.kept])
        show_table(table)
