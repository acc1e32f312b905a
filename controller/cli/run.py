"""``omote demo``, ``run``, ``edit``, ``play`` and ``convert``: run a stage, or show what it would send.

A stage is a TOML file that ties a head, its links to other programs, and its robots together.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from controller.base.errors import OMOTE_ERRORS, ConfigError
from controller.cli.completion import names_of
from controller.cli.console import console, show_table
from controller.cli.heads import Identity, Person, Vocabularies
from drivers.base.permission import ports_forbidden
from surface.base.extras import require

Seconds = Annotated[float | None, typer.Option("--seconds", "-s", min=0.1, max=1e8, help="Stop after this long.")]
ReportFile = Annotated[Path | None, typer.Option("--report", help="Write what was measured to this JSON file.")]
Headless = Annotated[bool, typer.Option("--headless", help="Open no window even where there is a display.")]
Pictures = Annotated[
    Path | None, typer.Option("--pictures", help="Folder for a contact sheet and a clip (with --headless).")
]
NoFace = Annotated[bool, typer.Option("--no-face", help="Draw nothing: links and servos only, needs no OpenGL.")]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Open no port, move nothing; show what would be sent.")]
Mirror = Annotated[bool, typer.Option("--mirror", help="Torque off: the face follows a robot that is moved by hand.")]
VoiceSource = Annotated[
    str | None, typer.Option("--voice", help="Voice that moves the mouth: a WAV file or pipe, - for standard input.")
]
VoiceHz = Annotated[
    int | None,
    typer.Option(
        "--voice-rate", min=1000, help="Sample rate (Hz) of a voice without a header: mono 16 bit signed PCM."
    ),
]
Record = Annotated[Path | None, typer.Option("--record", help="Write every command and tick to this file (.rec).")]
STAGE = "Stage file, which ties a head, links and robots together: a name from configs/stages or a path."
LAST_STAGE = "If omitted, the stage that was last shown in a window."
StageName = Annotated[str, typer.Option("--stage", help=STAGE, autocompletion=names_of("stages"))]


def demo(
    seconds: Seconds = None,
    headless: Headless = False,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for pictures and report (no window).")] = Path("out"),
) -> None:
    """Play a demonstration: a simulated robot host sends commands to the CG face and a simulated 24-servo head.

    With a display it opens a window. Without one it runs for 15 seconds (if --seconds is omitted) and writes a contact
    sheet, a clip and a report.

    Example: omote demo --seconds 5 --headless
    """
    from controller.tools.stage_run import has_display  # imported lazily: not needed for --help

    if has_display() and not headless:
        _run("demo", seconds)
    else:
        _run("demo", seconds or 15.0, headless, pictures=out, report=out / "report.json")


def run(
    stage: Annotated[
        str | None,
        typer.Argument(help=f"{STAGE} {LAST_STAGE}", autocompletion=names_of("stages")),
    ] = None,
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
    person: Person = None,
    kiosk: Annotated[
        bool, typer.Option("--kiosk", help="Full screen, no panel, no cursor; Esc or Ctrl-C ends.")
    ] = False,
    monitor: Annotated[int | None, typer.Option(help="Monitor of the full screen, from 0.")] = None,
    quality: Annotated[str | None, typer.Option(help="full, fast, or auto: the best one that reaches --fps.")] = None,
    fps: Annotated[float | None, typer.Option(help="Target frame rate (frames per second), never exceeded.")] = None,
    theme: Annotated[str | None, typer.Option(help="skin, mask or robot.")] = None,
    camera: Annotated[str | None, typer.Option(help="front, three-quarter, profile and so on.")] = None,
    evaluator: Annotated[str | None, typer.Option(help="Where vertices are computed: auto, cpu or gpu.")] = None,
    web: Annotated[
        str | None,
        typer.Option("--web", metavar="HOST:PORT", help="Serve a web panel. Default address: 127.0.0.1:8080."),
    ] = None,
    role: Annotated[
        str | None,
        typer.Option("--role", help="Role of this process, with [zenoh]: conductor, head, face or recorder."),
    ] = None,
    heads: Annotated[
        str | None,
        typer.Option("--heads", metavar="NAME[,NAME]", help="Heads of this process, with [zenoh]."),
    ] = None,
    vocabulary: Vocabularies = None,
) -> None:
    """Run a stage until it is stopped (Ctrl-C) or its time is up.

    Example: omote run everything --headless --seconds 20 --report r.json
    """
    stage, vocabularies = _resolve_stage(stage, vocabulary)
    if dry_run:
        _dry_run(stage, None, seconds, report, voice, voice_hz, vocabularies=vocabularies)
        return
    from controller.stage.persons import parse_person  # imported lazily: not needed for --help

    picture = {"kiosk": kiosk or None, "monitor": monitor, "quality": quality, "fps": fps, "theme": theme,
               "camera": camera, "evaluator": evaluator, "person": parse_person(person)}  # fmt: skip
    _run(stage, seconds, headless, no_face, pictures, report, mirror=mirror, voice=voice, voice_hz=voice_hz,
         record=record, identity=identity, picture=picture, web=web, role=role, heads=heads,
         vocabularies=vocabularies)  # fmt: skip


def edit(
    stage: Annotated[
        str | None,
        typer.Argument(help=f"{STAGE} {LAST_STAGE}", autocompletion=names_of("stages")),
    ] = None,
    seconds: Seconds = None,
    identity: Identity = None,
    person: Person = None,
    vocabulary: Vocabularies = None,
) -> None:
    """Edit expressions, groups and shows in a window that shows the face of a stage, without its links and robots.

    Example: omote edit demo --vocabulary mine.toml
    """
    from controller.stage.last import last_stage  # imported lazily: not needed for --help
    from controller.stage.persons import parse_person  # imported lazily: not needed for --help
    from controller.tools.stage_run import has_display  # imported lazily: not needed for --help

    if not has_display():
        raise ConfigError("omote edit needs a display to open a window on", hint="omote render draws without one")
    stage = "demo" if stage is None and last_stage() is None else stage
    name, vocabularies = _resolve_stage(stage, vocabulary)
    picture = {"person": parse_person(person)}
    _run(name, seconds, identity=identity, picture=picture, vocabularies=vocabularies, at_rest=True)


def vocabulary_files(names: Sequence[str] | None) -> tuple[Path, ...]:
    """Return the absolute paths of the files of ``--vocabulary``. Raises ConfigError: one of them does not exist."""
    from controller.base.paths import find_config  # imported lazily: not needed for --help

    return tuple(find_config("vocabularies", name).resolve() for name in names or ())


def _resolve_stage(stage: str | None, vocabulary: Sequence[str] | None) -> tuple[str, tuple[Path, ...]]:
    """Return the stage and the vocabulary files of a run.

    If ``stage`` is None, they are the stage that was last shown in a window, with its vocabularies before the given
    ones. Raises ConfigError: no stage was shown in a window before.
    """
    files = vocabulary_files(vocabulary)
    if stage is not None:
        return stage, files
    from controller.stage.last import last_stage  # imported lazily: not needed for --help

    if (last := last_stage()) is None:
        raise ConfigError("no stage is named, and none was shown in a window before", hint="omote run demo")
    console.print(f"opening the last stage, {last.stage}", soft_wrap=True)
    return str(last.stage), tuple(dict.fromkeys((*last.vocabularies, *files)))


def play(
    take: Annotated[
        Path,
        typer.Argument(
            help="Take, which is performance data or speech (omote plugins lists the formats), recording (.rec), or - "
            "for a voice on standard input."
        ),
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
    if dry_run:
        source = (None, "-") if str(take) == "-" else (take, None)
        _dry_run(stage, source[0], seconds, report, source[1], voice_hz, voice_only=True)
    elif str(take) == "-":
        _run(stage, seconds, headless, no_face, pictures, report, voice="-", voice_hz=voice_hz, voice_only=True,
             record=record)  # fmt: skip
    else:
        _run(stage, seconds, headless, no_face, pictures, report, take=take, record=record)


def convert(
    take: Annotated[Path, typer.Argument(help="Take of any kind, voice, recording (.rec) or show (.toml).")],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Table of time and parameters to write: .csv or .mcap.")],
    rate_hz: Annotated[
        float | None,
        typer.Option("--rate", min=1, max=1000, help="Rows per second.", show_default="the take's own, or 60"),
    ] = None,
    voice_model: Annotated[
        Path | None, typer.Option("--voice-model", help="Network (ONNX) that computes the face from a voice (WAV).")
    ] = None,
    ranges: Annotated[
        Path | None,
        typer.Option("--ranges", help="File with the ranges of a person's face, to which the take is scaled."),
    ] = None,
    vocabulary: Annotated[
        list[str] | None, typer.Option("--vocabulary", help="File with parameters of your own; may be repeated.")
    ] = None,
) -> None:
    """Convert a take for other programs: to a table with the columns time (s), jawOpen and so on, or to MCAP.

    Example: omote convert alex_rom_3.csv alex.csv --rate 30
    """
    # imported lazily: not needed for --help
    from controller.base.parameters import PARAMETERS
    from controller.base.paths import find_config
    from controller.tools.motion_file import convert as convert_file

    with console.status("converting"):
        parameters = PARAMETERS.with_files(find_config("vocabularies", name) for name in vocabulary or ())
        motion = convert_file(take, out, parameters, rate_hz, voice_model, ranges)
    rows = f"{len(motion.times_s)} rows of {int(motion.mask.sum())} parameters, {motion.times_s[-1]:.1f} s"
    console.print(f"{rows}\nwrote {out}", soft_wrap=True)


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
    voice_only: bool = False,
    record: Path | None = None,
    identity: str | None = None,
    picture: Mapping[str, object] | None = None,
    web: str | None = None,
    role: str | None = None,
    heads: str | None = None,
    vocabularies: tuple[Path, ...] = (),
    at_rest: bool = False,
) -> None:
    """Run a stage, print what was measured, and write it to ``report``.

    voice_only : the voice is all there is to play, so the run ends with it. picture : options that replace those of the
    stage's ``[face]``. heads : names separated by commas. at_rest : show the face without links, robots and sources.
    """
    from controller.body.preload import PreloadedBody, garbage_collection_off  # imported lazily: not needed for --help

    if not no_face:
        require("a face (--no-face runs without one)", "moderngl", *(["PIL"] if pictures else []))
    with console.status("starting") as status, PreloadedBody() as preloaded, garbage_collection_off():
        # imported lazily: the control process (body) loads its code at the same time
        from controller.body.messages import RunOptions
        from controller.body.sources import Voice
        from controller.stage.stage import parse_identity
        from controller.tools.stage_run import StageRun, has_display, write_report

        local_heads = tuple(name.strip() for name in (heads or "").split(",") if name.strip())
        voice_source = None if voice is None else Voice(voice, voice_hz, voice_only)
        options = RunOptions(
            take, mirror, voice_source, record, role=role, heads=local_heads, vocabularies=vocabularies, at_rest=at_rest
        )
        session = StageRun(stage, options, parse_identity(identity), picture, status.update, preloaded, web)
        try:
            if no_face:
                measured = session.run_without_face(seconds)
            elif headless or not has_display():
                measured = session.run_headless(seconds, pictures)
            else:
                require("a window (--headless runs without one)", "imgui_bundle")
                measured = session.run_window(seconds)
                while (next_run := session.next_run) is not None:  # a stage was dropped on the window, or a group saved
                    options = RunOptions(vocabularies=next_run.vocabularies, at_rest=at_rest)
                    mixed = parse_identity(identity) if next_run.carried else None
                    stage = str(next_run.stage)
                    session = StageRun(stage, options, mixed, picture, status.update, web=web, carried=next_run)
                    measured = session.run_window(seconds)
        except OMOTE_ERRORS:
            if report is not None and session.measured:
                write_report(session.measured, report)
            raise
        if report is not None:
            write_report(measured, report)
            measured["written"].append(str(report))
    table = Table("measured", "value", title=f"omote {measured['stage']}", title_justify="left")
    for row in report_rows(measured):
        table.add_row(*row)
    show_table(table)
    for path in measured["written"]:
        console.print(f"wrote {path}", soft_wrap=True)


def _dry_run(
    stage: str,
    take: Path | None,
    seconds: float | None,
    report: Path | None,
    voice: str | None = None,
    voice_hz: int | None = None,
    *,
    voice_only: bool = False,
    vocabularies: tuple[Path, ...] = (),
) -> None:
    """Compute what a stage would send, print it, and write it to ``report``; no port is opened."""
    # imported lazily: not needed for --help
    from controller.base.parameters import PARAMETERS
    from controller.body.sources import Voice
    from controller.stage.dry_run import dry_run
    from controller.stage.stage import load_stage
    from controller.takes.voice import voice_take
    from controller.tools.stage_run import write_report

    with console.status("computing what would be sent"), ports_forbidden("a dry run"):
        spoken, loaded = None, load_stage(stage, PARAMETERS, vocabularies)
        if voice is not None:
            with Voice(voice, voice_hz).open() as stream:
                spoken = voice_take(stream, "voice", loaded.parameters, raw_hz=voice_hz, longest_s=seconds)
        found = dry_run(loaded, take, seconds, loaded.parameters, spoken, alone=voice_only)
    if found.rows:
        title = f"dry run: no port was opened; computed {_computed_span(found.seconds, found.length_s)}"
        table = Table(*found.rows[0], title=title, title_justify="left")
        for channel in found.rows:
            table.add_row(*channel.values())
        show_table(table)
        if found.seconds < found.length_s:
            whole_s = math.ceil(found.length_s)
            console.print(f"The rest was not computed; --seconds {whole_s} computes all.", soft_wrap=True)
    else:
        console.print("This stage has no robot; nothing would be sent.", soft_wrap=True)
    if report is not None:
        length = {"played_s": found.seconds, "length_s": found.length_s}
        write_report({"stage": stage, "dry_run": True, **length, "buses": found.buses}, report)
        console.print(f"wrote {report}", soft_wrap=True)


def _computed_span(seconds: float, length_s: float) -> str:
    return f"{seconds:.1f} s" if seconds >= length_s else f"the first {seconds:.1f} s of {length_s:.1f} s"


def report_rows(report: dict[str, Any]) -> list[tuple[str, str]]:
    """Return name and value of the most important entries of a run's report."""
    face = report.get("face")
    parts = [(f"{part['part']} failed", f"{part['failures']} times, {part['state']} at the end: {part['why']}")
             for part in report.get("parts", [])]  # fmt: skip
    face_rows = _face_rows(face) if face else []
    return [*face_rows, *_control_rows(report), *_bus_rows(report.get("buses", [])), *parts]


def _face_rows(face: dict[str, Any]) -> list[tuple[str, str]]:
    width, height = face["size"]
    found = [
        ("picture", f"{width} x {height}, {face['quality']}, {face['renderer']}"),
        ("frames", f"{face['frames']} in {face['seconds']:.1f} s, {face['frames_with_motion']} of them with motion"),
        ("frames per second", f"{face['frames_per_second']:.1f}"),
        ("milliseconds per frame", _format_percentiles(face["frame_ms"])),
    ]
    if first_frame_s := face.get("start_to_first_frame_s"):
        found.append(("start to first frame", f"{first_frame_s:.2f} s"))
    return found


def _describe_link(link: dict[str, Any]) -> str:
    """Return the counts of a link: of requests that it answered, or of frames received and messages sent."""
    refused = f"{sum(link['refused'].values())} refused"
    if "unanswered" in link or not {"rate_hz", "sent"} & {*link}:
        return f"{link['accepted']} accepted, {refused}"
    received = [f"{link['accepted']} frames received, {link['lost']} lost, {refused}"] if "rate_hz" in link else []
    sent = [f"{link['sent']} messages sent, {link['dropped']} dropped"] if "sent" in link else []
    errors = [str(link[key]) for key in ("error", "send_error") if link.get(key)]
    return "; ".join([*received, *sent, *errors])


def _control_rows(report: dict[str, Any]) -> list[tuple[str, str]]:
    found = []
    if control := report.get("control"):
        found.append(("control loop", _format_rate(control)))
    if take := report.get("take"):
        rate = f"{take['rows']} rows at {take['rate_hz']:.0f} Hz"
        found.append(("take", f"{take['played_s']:.1f} of {take['duration_s']:.1f} s played, {rate}"))
    if voice := report.get("voice"):
        found.append(("voice", f"{voice['heard_s']:.1f} s heard"))
    return found + [(f"link {link['port']}", _describe_link(link)) for link in report.get("links", [])]


def _bus_rows(buses: list[dict[str, Any]]) -> list[tuple[str, str]]:
    found = []
    for bus in buses:
        name = f"bus {bus['name']}"
        errors = ", ".join(f"{count} {kind}" for kind, count in bus["bus"]["errors"].items()) or "none"
        found += [
            (f"{name}: {bus['servos']} servos", _format_rate(bus)),
            (f"{name}: jitter (ms)", _format_percentiles(bus["jitter_ms"])),
            (f"{name}: command to wire (ms)", _format_percentiles(bus["command_to_wire_ms"])),
            (f"{name}: errors", errors),
            (f"{name}: targets held at a limit", str(bus["channels_held_at_limit"] + bus["bus"]["limits_hit"])),
        ]
        if difference := bus.get("face_difference"):
            worst = difference["worst"][0]
            text = f"rms {difference['rms_deg']:.1f} deg, most at {worst['channel']}: rms {worst['rms_deg']:.1f} deg"
            found.append((f"{name}: measured minus commanded face", text))
            regions = difference.get("regions_rms_deg", {})
            by_region = "  ".join(f"{region} {rms:.1f}" for region, rms in regions.items())
            found.append((f"{name}: by region (rms deg)", by_region))
        for rule in bus.get("rules", []):
            found.append((f"{name}: rule", f"{rule['rule']}: {rule['times']} times, {rule['seconds']:.1f} s"))
    return found


def _format_rate(loop: dict[str, Any]) -> str:
    return f"{loop['rate_hz']:.1f} Hz of {loop['wanted_hz']:g} wanted, {loop['skipped']} skipped"


def _format_percentiles(summary: dict[str, float]) -> str:
    if not summary:
        return "nothing measured"
    return "  ".join(f"{key} {summary[key]:.2f}" for key in ("p50", "p95", "p99", "max"))
