"""``omote demo``, ``run`` and ``play``."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from controller.cli.console import console
from controller.stage.identity import parse_identity
from controller.tools.report import rows
from controller.tools.tables import show_table

if TYPE_CHECKING:
    from controller.body.sources import Voice  # start-up: --help does without it

Seconds = Annotated[float | None, typer.Option("--seconds", "-s", min=0.1, help="Stop after this long.")]
ReportFile = Annotated[Path | None, typer.Option("--report", help="Write what was measured to this JSON file.")]
Headless = Annotated[bool, typer.Option("--headless", help="Open no window even where there is a display.")]
Pictures = Annotated[
    Path | None, typer.Option("--pictures", help="Folder for a contact sheet and a clip (headless only).")
]
NoFace = Annotated[bool, typer.Option("--no-face", help="Draw nothing: links and servos only, needs no OpenGL.")]
DryRun = Annotated[
    bool,
    typer.Option("--dry-run", help="Open no port, move nothing; show what would be sent."),
]
Mirror = Annotated[bool, typer.Option("--mirror", help="Motors off: the face follows a head that is moved by hand.")]
VoiceSource = Annotated[
    str | None, typer.Option("--voice", help="WAV that moves the mouth: a file or pipe, - for standard input.")
]
VoiceHz = Annotated[
    int | None,
    typer.Option("--voice-rate", min=1000, help="The voice is signed 16 bit mono PCM without a header, at this rate."),
]
Record = Annotated[
    Path | None,
    typer.Option("--record", help="Write every command and tick to this file (.rec)."),
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
    from controller.tools.stage_run import has_display  # start-up: --help does without it

    windowed = has_display() and not headless
    pictures, report = (None, None) if windowed else (out, out / "report.json")
    _run("demo", None, seconds if windowed else seconds or 15.0, headless, False, pictures, report)


def run(
    stage: Annotated[str, typer.Argument(help="Stage: a name from configs/stages or a file.")],
    seconds: Seconds = None,
    headless: Headless = False,
    report: ReportFile = None,
    pictures: Pictures = None,
    no_face: NoFace = False,
    dry_run: DryRun = False,
    mirror: Mirror = False,
    voice: VoiceSource = None,
    voice_hz: VoiceHz = None,
    record: Record = None,
    identity: Annotated[
        str | None, typer.Option(metavar="NAME=AMOUNT,…", help="Variations of the head to mix in, each 0 to 1.")
    ] = None,
    kiosk: Annotated[
        bool, typer.Option("--kiosk", help="Full screen, no panel, no cursor; Esc or Ctrl-C ends.")
    ] = False,
    monitor: Annotated[int | None, typer.Option(help="Monitor of the full screen, from 0.")] = None,
    quality: Annotated[str | None, typer.Option(help="full or fast.")] = None,
    theme: Annotated[str | None, typer.Option(help="skin or mask.")] = None,
    camera: Annotated[str | None, typer.Option(help="front, three-quarter, profile and so on.")] = None,
    evaluator: Annotated[str | None, typer.Option(help="Who works out the vertices: auto, cpu or gpu.")] = None,
) -> None:
    """Run a stage until it is stopped (Ctrl-C) or its time is up.

    Example: omote run everything --headless --seconds 20 --report r.json
    """
    if dry_run:
        _dry_run(stage, None, seconds, report)
        return
    from controller.body.sources import Voice  # start-up: --help does without it

    heard = Voice(voice, voice_hz) if voice is not None else None
    _run(
        stage, None, seconds, headless, no_face, pictures, report,
        mirror=mirror, voice=heard, record=record, identity=parse_identity(identity), picture={
            "kiosk": kiosk or None, "monitor": monitor, "quality": quality, "theme": theme, "camera": camera,
            "evaluator": evaluator,
        },
    )  # fmt: skip


def play(
    take: Annotated[
        Path,
        typer.Argument(help="Take (.csv), speech (.wav, .tsv, Rhubarb .json), recording (.rec), or - for a voice."),
    ],
    stage: StageName = "play",
    seconds: Seconds = None,
    headless: Headless = False,
    report: ReportFile = None,
    pictures: Pictures = None,
    no_face: NoFace = False,
    dry_run: DryRun = False,
    voice_hz: VoiceHz = None,
    record: Record = None,
) -> None:
    """Play a recorded take, or a voice on standard input, on the face and the servo head, at its own rate.

    Example: omote play alex_rom_3.csv --headless --report r.json
    """
    if str(take) == "-":
        from controller.body.sources import Voice  # start-up: --help does without it

        heard = Voice("-", voice_hz, alone=True)
        _run(stage, None, seconds, headless, no_face, pictures, report, voice=heard, record=record)
    elif dry_run:
        _dry_run(stage, take, seconds, report)
    else:
        _run(stage, take, seconds, headless, no_face, pictures, report, record=record)


def _run(
    stage: str,
    take: Path | None,
    seconds: float | None,
    headless: bool,
    no_face: bool,
    pictures: Path | None,
    report: Path | None,
    *,
    mirror: bool = False,
    voice: Voice | None = None,
    record: Path | None = None,
    identity: dict[str, float] | None = None,
    picture: dict[str, object] | None = None,
) -> None:
    from controller.body.preload import PreloadedBody, uncollected  # start-up: --help does without it

    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy: its threads would spin where others have work
    with console.status("starting") as status, PreloadedBody() as waiting, uncollected():
        from controller.stage.stage import with_picture  # start-up: --help does without it
        from controller.tools.stage_run import StageRun, has_display, write_report  # start-up: --help does without it

        session = StageRun.load(
            stage, take, status.update,
            mirror=mirror, voice=voice, record=record, identity=identity, waiting=waiting,
        )  # fmt: skip
        session.stage = with_picture(session.stage, picture or {})
        if no_face:
            measured = session.run_without_face(seconds)
        elif headless or not has_display():
            measured = session.run_headless(seconds, pictures)
        else:
            measured = session.run_window(seconds)
        if report is not None:
            write_report(measured, report)
            measured["written"].append(str(report))
    show_report(measured)


def _dry_run(stage: str, take: Path | None, seconds: float | None, report: Path | None) -> None:
    from controller.tools.stage_run import StageRun, write_report  # start-up: --help does without it

    with console.status("rehearsing"):
        rows, sent = StageRun.load(stage, take).plan(seconds)
    show_plan(rows)
    if report is not None:
        write_report({"stage": stage, "dry_run": True, "buses": sent}, report)
        console.print(f"wrote {report}", soft_wrap=True)


def show_report(report: dict[str, Any]) -> None:
    """Print the table of what was measured."""
    table = Table("measured", "value", title=f"omote {report['stage']}", title_justify="left")
    for name, value in rows(report):
        table.add_row(name, value)
    show_table(table, console)
    for path in report.get("written", []):
        console.print(f"wrote {path}", soft_wrap=True)


def show_plan(plan: list[dict[str, str]]) -> None:
    """Print what a stage would send, a channel a row."""
    if not plan:
        console.print("This stage has no robot; nothing would be sent.", soft_wrap=True)
        return
    table = Table(*plan[0], title="dry run: no port was opened", title_justify="left")
    for row in plan:
        table.add_row(*row.values())
    show_table(table, console)
