"""``omote export`` around the exporter: find the head, read the pose, say what was written."""

from __future__ import annotations

import logging
from pathlib import Path

from rich.console import Console

from controller.base.parameters import PARAMETERS
from controller.face.still import Still
from drivers.base.plugins import Registry
from surface.export import API, Exporter, export_head, exporters
from surface.head import Head

log = logging.getLogger(__name__)

EXPORTERS: Registry[Exporter] = Registry(
    Exporter,
    "exporter",
    "omote.exporters",
    API,
    lambda: {one.kind: f"surface.export.{one.kind}" for one in exporters()},
    "EXPORTER",
)


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
        written = export_head(loaded, out, {n: v for n, v in pose.items() if n in loaded.parameters}, _foreign())
    for path in written:
        console.print(f"wrote {path}", soft_wrap=True)


def _foreign() -> list[Exporter]:
    """Exporters that other packages add."""
    own = {suffix: one for one in exporters() for suffix in one.suffixes}
    found = []
    for one in EXPORTERS.all():
        taken = [suffix for suffix in one.suffixes if own.setdefault(suffix, one).kind != one.kind]
        if taken:
            log.warning("exporter %r is left out: %s is written by another one", one.kind, ", ".join(taken))
        elif one not in exporters():
            found.append(one)
    return found
