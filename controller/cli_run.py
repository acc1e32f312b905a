"""``omote demo``, ``run`` and ``play``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

if TYPE_CHECKING:
    from controller.session import Session

console = Console(highlight=False)

Seconds = Annotated[float | None, typer.Option("--seconds", "-s", min=0.1, help="Stop after this long.")]
ReportFile = Annotated[Path | None, typer.Option("--report", help="Write what was measured to this JSON file.")]
Headless = Annotated[bool, typer.Option("--headless", help="Open no window even where there is a display.")]
Pictures = Annotated[
    Path | None, typer.Option("--pictures", help="Folder for a contact sheet and a clip (headless only).")
]
StageName = Annotated[str, typer.Option("--stage", help="Stage: a name from configs/stages or a file.")]


def register(app: typer.Typer) -> None:
    """Add this module's commands to ``app``."""
    app.command()(demo)
    app.command()(run)
    app.command()(play)


def demo(
    seconds: Seconds = None,
    headless: Headless = False,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for pictures and report.")] = Path("out"),
) -> None:
    """A simulated robot host tells a story; the CG face and a simulated 24-servo head act it.

    With a display a window opens. Without one it runs for 15 seconds and writes a contact sheet, a clip and a
    report.

    Example: omote demo --seconds 5 --headless
    """
    from controller.session import Session, has_display, write_report

    windowed = has_display() and not headless
    session = Session.load("demo")
    if windowed:
        session.run_window(seconds)
        return
    report = session.run_headless(seconds or 15.0, pictures=out)
    report["written"].append(str(out / "report.json"))
    write_report(report, out / "report.json")
    show_report(report)


def run(
    stage: Annotated[str, typer.Argument(help="Stage: a name from configs/stages or a file.")],
    seconds: Seconds = None,
    headless: Headless = False,
    report: ReportFile = None,
    pictures: Pictures = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Open no port and move nothing; show what would be sent.")
    ] = False,
) -> None:
    """Run a stage until it is stopped (Ctrl-C) or its time is up.

    Example: omote run everything --headless --seconds 20 --report r.json
    """
    from controller.session import Session

    session = Session.load(stage)
    if dry_run:
        show_plan(session.plan())
        return
    _run_and_report(session, seconds, headless, pictures, report)


def play(
    take: Annotated[Path, typer.Argument(help="Live Link Face take (CSV).")],
    stage: StageName = "play",
    seconds: Seconds = None,
    headless: Headless = False,
    report: ReportFile = None,
    pictures: Pictures = None,
) -> None:
    """Play a recorded take on the face and the servo head, at the take's own rate.

    Example: omote play alex_rom_3.csv --headless --report r.json
    """
    from controller.session import Session

    session = Session.load(stage, take=take)
    _run_and_report(session, seconds, headless, pictures, report)


def _run_and_report(
    session: Session, seconds: float | None, headless: bool, pictures: Path | None, report: Path | None
) -> None:
    from controller.session import has_display, write_report

    if headless or not has_display():
        measured = session.run_headless(seconds, pictures=pictures)
    else:
        measured = session.run_window(seconds)
    if report is not None:
        write_report(measured, report)
        measured["written"].append(str(report))
    show_report(measured)


def show_report(report: dict[str, Any]) -> None:
    """Print the table of what was measured."""
    from rich.table import Table

    from controller.report import rows

    table = Table("measured", "value", title=f"omote {report['stage']}", title_justify="left")
    for name, value in rows(report):
        table.add_row(name, value)
    console.print(table)
    for path in report.get("written", []):
        console.print(f"wrote {path}", soft_wrap=True)


def show_plan(plan: list[dict[str, str]]) -> None:
    """Print what a stage would send, a channel a row."""
    from rich.table import Table

    if not plan:
        console.print("This stage has no robot; nothing would be sent.")
        return
    table = Table(*plan[0], title="dry run: no port was opened", title_justify="left")
    for row in plan:
        table.add_row(*row.values())
    console.print(table)
