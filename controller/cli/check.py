"""``omote check``: read a configuration, a head, a take or a surface and say everything that is wrong with it."""

from __future__ import annotations

from typing import Annotated

import typer

from controller.cli.console import console


def register(app: typer.Typer) -> None:
    """Add this module's command to ``app``."""
    app.command()(check)


def check(
    file: Annotated[
        str,
        typer.Argument(
            help="A stage, robot, head, expressions, script, take, recording, group or surface: path or name."
        ),
    ],
) -> None:
    """Check any file omote reads, and all it refers to, without running it; lists every fault with its place.

    Example: omote check configs/robots/head24.toml
    """
    from controller.tools.check import check_anything  # start-up: --help does without it

    for line in check_anything(file):
        console.print(line, soft_wrap=True)
