"""``omote webcam``: sends the face that a webcam sees to a link of a stage or to another program."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape


def webcam(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="File face_landmarker.task of MediaPipe.")],
    target: Annotated[str, typer.Argument(metavar="OUT", help="KIND:ADDRESS to send to.")] = "json",
    camera: Annotated[int, typer.Option("--camera", "-c", min=0, help="Number of the camera.")] = 0,
    seconds: Annotated[float | None, typer.Option("--seconds", "-s", min=0.1, help="Stop after this long.")] = None,
) -> None:
    """Detect the face in front of a webcam with MediaPipe on this machine, and send it; nothing is downloaded.

    A stage receives it by a link of `kind = "json"` and `listen = "127.0.0.1:9400"`; OUT may be any other kind.

    Example: omote webcam face_landmarker.task json:127.0.0.1:9400
    """
    # imported lazily: not needed for --help
    from controller.base.parameters import PARAMETERS
    from controller.tools.webcam import send_webcam

    console = Console(stderr=True, highlight=False, emoji=False, soft_wrap=True)
    seen = send_webcam(model, target, PARAMETERS, camera=camera, seconds=seconds,
                       ready=lambda text: console.print(escape(f"{text}; Ctrl-C ends")))  # fmt: skip
    console.print(escape(f"{seen.frames} pictures, {seen.faces} of them with a face; {seen.sent} messages sent"))
