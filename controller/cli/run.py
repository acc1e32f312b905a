"""``omote demo``, ``run`` and ``play``: run a stage, or show what it would send."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from controller.cli.console import console
from controller.cli.heads import Identity
from controller.tools.report import rows
from controller.tools.tables import show_table

Seconds = Annotated[float | None, typer.Option("--seconds", "-s", min=0.1, help="Stop after this long.")]
ReportFile = Annotated[Path | None, typer.Option("--report", help="Write what was measured to this JSON file.")]
Headless = Annotated[bool, typer.Option("--headless", help="Open no window even where there is a display.")]
Pictures = Annotated[
    Path | None, typer.Option("--pictures", help="Folder for a contact sheet and a clip (headless only).")
]
NoFace = Annotated[bool, typer.Option("--no-face", help="Draw nothing: links and servos only, needs no OpenGL.")]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Open no port, move nothing; show what would be sent.")]
Mirror = Annotated[bool, typer.Option("--mirror", help="Motors off: the face follows a head that is moved by hand.")]
VoiceSource = Annotated[
    str | None, typer.Option("--voice", help="WAV that moves the mouth: a file or pipe, - for standard input.")
]
VoiceHz = Annotated[
    int | None,
    typer.Option("--voice-rate", min=1000, help="The voice is signed 16 bit mono PCM without a header, at this rate."),
]
Record = Annotated[Path | None, typer.Option("--record", help="Write every command and tick to this file (.rec).")]
StageName = Annotated[str, typer.Option("--stage", help="Stage: a name from configs/stages or a file.")]


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

    if has_display() and not headless:
        _run("demo", seconds)
    else:
        _run("demo", seconds or 15.0, headless, pictures=out, report=out / "report.json")


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
    identity: Identity = None,
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
    look = {"kiosk": kiosk or None, "monitor": monitor, "quality": quality, "theme": theme, "camera": camera,
            "evaluator": evaluator}  # fmt: skip
    _run(stage, seconds, headless, no_face, pictures, report, mirror=mirror, voice=voice, voice_hz=voice_hz,
         record=record, identity=identity, look=look)  # fmt: skip


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
        _run(stage, seconds, headless, no_face, pictures, report, voice="-", voice_hz=voice_hz, alone=True,
             record=record)  # fmt: skip
    elif dry_run:
        _dry_run(stage, take, seconds, report)
    else:
        _run(stage, seconds, headless, no_face, pictures, report, take=take, record=record)


def _run(
    stage: str,
    seconds: float | None,
    headless: bool = False,
    no_face: bool = False,
    pictures: Path | None = None,
    report: Path | None = None,
    *,
    take: Path | None = None,
    mirror: bool = False,
    voice: str | None = None,
    voice_hz: int | None = None,
    alone: bool = False,
    record: Path | None = None,
    identity: str | None = None,
    look: Mapping[str, object] | None = None,
) -> None:
    from controller.body.preload import PreloadedBody, garbage_collection_off  # start-up: --help does without it

    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy: its threads would spin where others have work
    with console.status("starting") as status, PreloadedBody() as preloaded, garbage_collection_off():
        # start-up: the body's process loads its code at the same time
        from controller.body.messages import RunOptions
        from controller.body.sources import Voice
        from controller.stage.stage import parse_identity
        from controller.tools.stage_run import StageRun, has_display, write_report

        options = RunOptions(take, mirror, None if voice is None else Voice(voice, voice_hz, alone), record)
        session = StageRun.load(stage, options, parse_identity(identity), look, status.update, preloaded)
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
    # start-up: --help does without any of these
    from controller.base.parameters import PARAMETERS
    from controller.stage.dry_run import dry_run
    from controller.stage.stage import load_stage
    from controller.tools.stage_run import write_report

    with console.status("computing what would be sent"):
        rows, sent = dry_run(load_stage(stage, PARAMETERS), take, seconds, PARAMETERS)
    show_plan(rows)
    if report is not None:
        write_report({"stage": stage, "dry_run": True, "buses": sent}, report)
        console.print(f"wrote {report}", soft_wrap=True)


def show_report(report: dict[str, Any]) -> None:
    """Print a run's report as a table."""
    table = Table("measured", "value", title=f"omote {report['stage']}", title_justify="left")
    for name, value in rows(report):
        table.add_row(name, value)
    show_table(table, console)
    for path in report.get("written", []):
        console.print(f"wrote {path}", soft_wrap=True)


def show_plan(plan: list[dict[str, str]]) -> None:
    """Print what a stage would send, a row for each channel."""
    if not plan:
        console.print("This stage has no robot; nothing would be sent.", soft_wrap=True)
        return
    table = Table(*plan[0], title="dry run: no port was opened", title_justify="left")
    for row in plan:
        table.add_row(*row.values())
    show_table(table, console)
