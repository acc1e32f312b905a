"""``omote render --take``: a film of a take, a show or a recording, with its sound."""

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
    typer.Option("--take", metavar="FILE", help="Take, recording or show that the film shows."),
]
Sound = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Sound of the film.", show_default="that of the take or the show"),
]
FilmRate = Annotated[
    float | None, typer.Option("--rate", min=1, max=240, help="Frames a second of --take.", show_default="30")
]
_SOUND_READERS = ("wav", "compressed")
"""Kinds of takes that are a sound themselves."""


def check_film(take: Path | None, sound: Path | None, rate_hz: float | None, others: dict[str, object]) -> None:
    """Raises ConfigError: options of films without one, or of other pictures with one."""
    if take is None:
        given = [name for name, value in {"--sound": sound, "--rate": rate_hz}.items() if value is not None]
        if given:
            raise ConfigError(f"{given[0]}: there is no --take", hint="--take configs/scripts/tour.toml -o tour.mp4")
    elif unfit := [name for name, value in others.items() if value]:
        raise ConfigError(f"--take and {unfit[0]} are two pictures", hint="leave out one of them")


def render_film(still: Still, out: Path, take: Path, sound: Path | None, rate_hz: float | None) -> None:
    """Draw the film and say what was written. Raises TakeError, ConfigError, ViewError."""
    # imported lazily: not needed for --help
    from controller.face.film import FPS, base_of, draw_film
    from controller.tools.motion_file import load_motion

    fps = rate_hz or FPS
    with console.status("reading"):
        motion = load_motion(take, still.parameters, fps)
        heard = sound or _sound_of(take)
    silent = sound is None and out.suffix.lower() != ".mp4"
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("drawing", total=len(motion.values))
        rows = base_of(still, motion.values, motion.mask)
        count = draw_film(still, rows, out, fps, None if silent else heard,
                          lambda done, total: bar.update(task, completed=done))  # fmt: skip
    console.print(f"{count} frames at {fps:g} a second, {_heard(heard, silent=silent)}", soft_wrap=True, markup=False)
    console.print(f"wrote {out}", soft_wrap=True)


def _heard(sound: Path | None, *, silent: bool) -> str:
    if sound is None:
        return "without sound"
    return f"without the sound of {sound}, which an .mp4 has" if silent else f"with the sound of {sound}"


def _sound_of(take: Path) -> Path | None:
    """What is heard of a take or a show; None where nothing is."""
    # imported lazily: not needed for --help
    from controller.base.parameters import PARAMETERS
    from controller.links.line.script import load_script
    from controller.takes.reader import TAKES

    if any(take.suffix.lower() in TAKES.get(kind).suffixes for kind in _SOUND_READERS):
        return take
    return load_script(str(take), PARAMETERS).sound if take.suffix.lower() == ".toml" else None
