"""``omote export`` around the exporter: find the head, read the pose, say what was written."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from controller.base.parameters import PARAMETERS
from controller.face.still import Still
from surface.export import export_head
from surface.head import Head


def export_with_progress(
    head: str, out: Path, settings: list[str], expressions: list[str], identity: str | None, console: Console
) -> None:
    """Write the head ``head`` to ``out`` in the pose that the words of a command line ask for.

    Raises
    ------
    ParameterError, ConfigError
        naming the word that is wrong.
    HeadFileError, ExportError
        when the head cannot be read or written.
    """
    still = Still.parse(settings, expressions, head=head, identity=identity)
    pose = {name: float(v) for name, v in zip(PARAMETERS.names, still.values, strict=True) if v}
    with console.status("exporting"):
        loaded = Head.load(still.head, still.identity)
        written = export_head(loaded, out, {n: v for n, v in pose.items() if n in loaded.parameters})
    for path in written:
        console.print(f"wrote {path}", soft_wrap=True)
