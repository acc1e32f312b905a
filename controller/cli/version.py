"""``omote --version``: an option of the command itself."""

from __future__ import annotations

from typing import Annotated

import typer

from controller.cli.console import console


def show_version(wanted: bool) -> None:
    """Print omote's version and exit, if ``wanted``."""
    if not wanted:
        return
    from importlib.metadata import PackageNotFoundError, version  # imported lazily: not needed for --help

    try:
        console.print(f"omote {version('omote')}")
    except PackageNotFoundError:
        console.print("omote, run from source code that is not installed", soft_wrap=True)
    raise typer.Exit


def root(
    version: Annotated[
        bool, typer.Option("--version", callback=show_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Define the options that stand before the name of a command."""
