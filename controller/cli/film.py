"""``omote render --take``: draws a film of a take, a show (timed script) or a recording, with its sound."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from controller.base.errors import ConfigError
from controller.cli.console import console

if TYPE_CHECKING:
    from controller.face.still import Still  # imported lazily: not needed for --help

FilmTake = Annotated[
    Path | None,
    typer.Option("--take", metavar="FILE", help="Draw a film of this take, recording (.rec) or show (.toml)."),
]
Sound = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Sound of the film.", show_default="sound of the take or the show"),
]
FilmRate = Annotated[
    float | None, typer.Option("--rate", min=1, max=240, help="Frames per second of --take.", show_default="30")
]
_SOUND_READERS = ("wav", "compressed")
"""Kinds of takes whose file is itself a sound."""


def check_film(take: Path | None, sound: Path | None, rate_hz: float | None, others: dict[str, object]) -> None:
    """Check the options of a film. ``others`` : options of other pictures, by name.

    Raises ConfigError: an option of films without ``take``, or an option of other pictures with it.
    """
    if take is None:
        given = [name for name, value in {"--sound": sound, "--rate": rate_hz}.items() if value is not None]
        if given:
            raise ConfigError(f"{given[0]}: there is no --take", hint="--take configs/scripts/tour.toml -o tour.mp4")
    elif conflicts := [name for name, value in others.items() if value]:
        raise ConfigError(f"--take and {conflicts[0]} draw different pictures", hint="leave out one of them")


def render_film(still: Still, out: Path, take: Path, sound: Path | None, rate_hz: float | None) -> None:
    """Draw the film and print what was written. Raises TakeError, ConfigError, ViewError."""
    # imported lazily: not needed for --help
    from controller.face.film import FPS, draw_film, film_rows
    from controller.stage.stage import heads_of
    from controller.takes.recording import default_state
    from controller.tools.motion_file import load_motion

    fps = rate_hz or FPS
    with console.status("reading"):
        make = default_state if still.stage is None else heads_of(still.stage)[0].state
        motion = load_motion(take, still.parameters, fps, make=make, vocabulary=still.vocabulary)
        rows, lives = film_rows(still, take, motion.values, motion.mask, motion.lives, fps)
        track = sound or _sound_of(take, still)
    silent = sound is None and out.suffix.lower() != ".mp4"
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("drawing", total=len(rows))
        count = draw_film(still, rows, lives, out, fps, None if silent else track,
                          lambda done, total: bar.update(task, completed=done))  # fmt: skip
    described = _describe_sound(track, silent=silent)
    console.print(f"{count} frames at {fps:g} per second, {described}", soft_wrap=True, markup=False)
    console.print(f"wrote {out}", soft_wrap=True)


def _describe_sound(sound: Path | None, *, silent: bool) -> str:
    if sound is None:
        return "without sound"
    return f"without the sound of {sound}, which only an .mp4 gets" if silent else f"with the sound of {sound}"


def _sound_of(take: Path, still: Still) -> Path | None:
    """Return the sound file of a take, or of a show with the expressions of ``still``; None if it has none."""
    # imported lazily: not needed for --help
    from controller.links.line.script import load_script
    from controller.takes.reader import TAKES

    if any(take.suffix.lower() in TAKES.get(kind).suffixes for kind in _SOUND_READERS):
        return take
    if take.suffix.lower() != ".toml":
        return None
    return load_script(str(take), still.parameters, still.vocabulary).sound
