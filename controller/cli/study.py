"""``omote study``: shows the conditions of a study in a seeded order, with an event log and a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from controller.cli.console import console


def study(
    file: Annotated[Path, typer.Argument(help="The study: a stage, conditions, repeats and a seed (TOML).")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for event log, recording and report.")],
    seed: Annotated[
        int | None, typer.Option("--seed", min=0, help="Seed of a participant, instead of the file's.")
    ] = None,
    lsl: Annotated[bool, typer.Option("--lsl", help="Also send the marks as LSL markers.")] = False,
    headless: Annotated[bool, typer.Option("--headless", help="Draw without a window.")] = False,
    no_face: Annotated[bool, typer.Option("--no-face", help="Draw nothing: servos only, needs no OpenGL.")] = False,
) -> None:
    """Show the conditions of a study in a seeded order, and write events, a recording, latencies and pose errors.

    Example: omote study smiles.toml -o participant-7 --seed 7
    """
    # imported lazily: not needed for --help
    from controller.tools.stage_run import StageRun, has_display
    from controller.tools.study_run import run_study
    from surface.base.extras import require

    if not no_face:
        require("a face (--no-face runs without one)", "moderngl")
    show = StageRun.run_without_face if no_face else StageRun.run_window
    if not no_face and (headless or not has_display()):
        show = StageRun.run_headless
    with console.status("starting") as status:
        report = run_study(file, out, seed=seed, lsl=lsl, show=show, status=status.update)
    trials = len(report["study"]["trials"])
    console.print(f"{trials} trial{'s' if trials != 1 else ''}\nwrote {out}", soft_wrap=True)
