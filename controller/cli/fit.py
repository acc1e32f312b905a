"""``omote fit`` and ``export``: heads in from meshes, heads out for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from controller.base.errors import ConfigError
from controller.cli.console import console


def register(app: typer.Typer) -> None:
    """Add this module's commands to ``app``."""
    app.command()(fit)
    app.command()(export)


def fit(
    mesh: Annotated[
        Path, typer.Argument(help="Mesh with UVs and shapes: .glb, .gltf, .obj, a folder of .obj files, or .npz.")
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder of the head to write.")],
    name: Annotated[str | None, typer.Option(help="Name of the head; the folder's without it.")] = None,
    shapes: Annotated[Path | None, typer.Option(help="Folder with one .obj a shape, for an .obj mesh.")] = None,
    names: Annotated[Path | None, typer.Option(help="TOML table of shape names: [names] theirs = ARKit's.")] = None,
    unit: Annotated[str | None, typer.Option(help="mm, cm, m or in; guessed by the head's size without it.")] = None,
    up: Annotated[str | None, typer.Option(help="Axis that points up: x, y, z, -x, -y or -z.")] = None,
    forward: Annotated[str | None, typer.Option(help="Axis that the face looks along.")] = None,
    without: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Leave out an object or material; may be repeated.")
    ] = None,
    identities: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Identity modes of the mesh (.npz): adds named variations.")
    ] = None,
    keep: Annotated[bool, typer.Option("--keep", help="Keep the head that is there; only add --identities.")] = False,
    report: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for a report: figures, tables, error drawn on the face.")
    ] = None,
) -> None:
    """Turn a mesh with UVs and expression shapes into a head of control points.

    Example: omote fit me.glb -o heads/me --report report
    """
    from controller.tools.fit import add_with_progress, fit_with_progress  # start-up: --help does without it
    from surface.fit.source.load import LoadOptions  # start-up: --help does without it

    if keep and identities is None:
        raise ConfigError("--keep: fits nothing, and there is nothing to add", hint="--keep --identities FILE")
    if not keep:
        options = LoadOptions(shapes, names, unit, up, forward, tuple(without or ()))
        fit_with_progress(mesh, out, name or out.resolve().name, console, options, report)
    if identities is not None:
        add_with_progress(mesh, out, identities, console)


def export(
    out: Annotated[
        Path,
        typer.Argument(metavar="OUT", help="File to write: .glb, .obj or what a plug-in adds."),
    ],
    head: Annotated[str, typer.Option("--head", help="Head: a name from configs/heads or a folder.")] = "ict",
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="Pose it: set a parameter; may be repeated.")
    ] = None,
    expression: Annotated[
        list[str] | None,
        typer.Option("--expression", "-e", metavar="NAME[=INTENSITY]", help="Pose it: add a named expression."),
    ] = None,
    identity: Annotated[
        str | None, typer.Option(metavar="NAME=AMOUNT,…", help="Variations of the head to mix in, each 0 to 1.")
    ] = None,
) -> None:
    """Write a head for other programs: .glb with morph targets, or .obj with a folder of shapes.

    Example: omote export head.glb
    """
    from controller.tools.export import export_with_progress  # start-up: --help does without it

    export_with_progress(head, out, settings or [], expression or [], identity, console)
