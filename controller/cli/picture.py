"""``omote render``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from controller.cli.console import console


def register(app: typer.Typer) -> None:
    """Add this module's commands to ``app``."""
    app.command()(render)


def render(
    out: Annotated[Path, typer.Option("--out", "-o", help="Picture to write (PNG).")],
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="Set a parameter; may be repeated.")
    ] = None,
    expression: Annotated[
        list[str] | None,
        typer.Option("--expression", "-e", metavar="NAME[=INTENSITY]", help="Add a named expression."),
    ] = None,
    size: Annotated[str | None, typer.Option(help="Width x height in pixels.", show_default="800x800")] = None,
    camera: Annotated[
        str | None,
        typer.Option(help="front, three-quarter, three-quarter-right, profile or profile-right.", show_default="front"),
    ] = None,
    quality: Annotated[str | None, typer.Option(help="full or fast.", show_default="full")] = None,
    theme: Annotated[str | None, typer.Option(help="skin or mask.", show_default="skin")] = None,
    background: Annotated[
        str | None, typer.Option(metavar="#RRGGBB[,#RRGGBB]", help="One colour, or a gradient from top to bottom.")
    ] = None,
    evaluator: Annotated[
        str | None, typer.Option(help="Who works out the vertices: auto, cpu or gpu.", show_default="auto")
    ] = None,
    head: Annotated[
        str | None, typer.Option(help="Head: a name from configs/heads or a folder.", show_default="ict")
    ] = None,
    identity: Annotated[
        str | None, typer.Option(metavar="NAME=AMOUNT,…", help="Variations of the head to mix in, each 0 to 1.")
    ] = None,
    stage: Annotated[
        str | None, typer.Option(help="Stage whose head, groups, expressions and look are taken where nothing is said.")
    ] = None,
    vocabulary: Annotated[
        list[str] | None, typer.Option(metavar="FILE", help="Expressions of your own; may be repeated.")
    ] = None,
    group: Annotated[
        list[str] | None,
        typer.Option(metavar="FILE[=AMOUNT]", help="Group the head wears, by -1 to 1; may be repeated."),
    ] = None,
    sheet: Annotated[
        bool, typer.Option("--sheet", help="Draw every parameter at its end and every named expression.")
    ] = False,
) -> None:
    """Draw one picture of the face, without a display.

    Example: omote render --set jawOpen=0.8 --size 800x800 -o out.png
    """
    from controller.face.still import Still, draw_sheet, draw_still  # start-up: --help does without it
    from controller.stage.picture import parse_background  # start-up: --help does without it

    look = {
        "camera": camera, "quality": quality, "theme": theme, "background": parse_background(background),
        "evaluator": evaluator,
    }  # fmt: skip
    still = Still.parse(
        settings or [], expression or [], size, look, head, identity,
        stage=stage, vocabularies=vocabulary or (), groups=group or (),
    )  # fmt: skip
    if sheet:
        with console.status("drawing") as status:
            draw_sheet(still, out, lambda done, total: status.update(f"drawing {done} of {total}"))
    else:
        draw_still(still, out)
    console.print(f"wrote {out}", soft_wrap=True)
