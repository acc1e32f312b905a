"""``omote landmarks``: finds the landmarks of a bare mesh, writes them to a file and draws them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from controller.base.paths import find_config
from controller.cli.completion import names_of
from controller.cli.console import console
from surface.base.extras import require


def landmarks(
    mesh: Annotated[Path, typer.Argument(help="Bare mesh: .obj, .glb, .gltf, .vrm, .npz, .ply, .stl or .off.")],
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="FILE", help="File to write (.toml); a picture goes beside it.")
    ],
    keep: Annotated[
        bool, typer.Option("--keep", help="Keep the landmarks in FILE, find the missing ones, and draw all again.")
    ] = False,
    like: Annotated[
        str,
        typer.Option(
            "--like", metavar="HEAD", help="Head whose landmarks are transferred.", autocompletion=names_of("heads")
        ),
    ] = "ict",
    up: Annotated[str | None, typer.Option(help="Axis that points up: x, y, z, -x, -y or -z.")] = None,
    forward: Annotated[str | None, typer.Option(help="Axis that the face looks along.")] = None,
    without: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Leave out an object or material; may be repeated.")
    ] = None,
) -> None:
    """Find the landmarks of a face for omote fit --expressions-from; check them in the picture and correct the file.

    Example: omote landmarks scan.ply -o landmarks.toml
    """
    require("finding landmarks", "scipy", "PIL")
    # imported lazily: not needed for --help
    from surface.fit.source.load import LoadOptions
    from surface.fit.transfer.pick_landmarks import pick_landmarks

    options = LoadOptions(up=up, forward=forward, without=tuple(without or ()))
    with console.status("finding the face") as status:

        def progress(part: str, done: float) -> None:
            status.update(f"finding {part}: {100 * done:.0f} %")

        source = find_config("heads", like)
        marks, picture = pick_landmarks(mesh, source, out, keep=keep, options=options, progress=progress)
    by_kind: dict[str, list[str]] = {}
    for name, mark in marks.items():
        by_kind.setdefault(mark.how, []).append(name)
    for how, names in by_kind.items():
        console.print(f"{how}: {', '.join(names)}", soft_wrap=True)
    console.print(f"wrote {out} and {picture}: check the landmarks in the picture", soft_wrap=True)
