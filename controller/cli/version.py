"""``omote --version``: the option of the command itself."""

from __future__ import annotations

from typing import Annotated

import typer

from controller.cli.console import console


def show_version(wanted: bool) -> None:
    """Print omote's version and end, where the option was given."""
    if not wanted:
        return
    from importlib.metadata import PackageNotFoundError, version  # imported lazily: not needed for --help

    try:
        console.print(f"omote {version('omote')}")
    except PackageNotFoundError:
        console.print("omote, started from a checkout that is not installed", soft_wrap=True)
    raise typer.Exit


def root(
    version: Annotated[
        bool, typer.Option("--version", callback=show_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Options before the name of a command."""
