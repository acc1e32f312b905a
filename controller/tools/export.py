"""``omote export`` around the exporter: find the head, read the pose, say what was written."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from controller.base.parameters import PARAMETERS
from controller.face.still import Still
from drivers.base.plugins import Registry
from surface.export import API, Exporter, export_head, exporters
from surface.head import Head


def _check(exporter: Exporter) -> None:
    """ValueError for a suffix that a built-in exporter has."""
    for one in exporters():
        clash = sorted({*one.suffixes} & {*exporter.suffixes}) if one.kind != exporter.kind else []
        if clash:
            raise ValueError(f"{', '.join(clash)} is written by the built-in kind {one.kind!r}")


EXPORTERS: Registry[Exporter] = Registry(
    Exporter,
    "exporter",
    "omote.exporters",
    API,
    lambda: {one.kind: f"surface.export.{one.kind}" for one in exporters()},
    "EXPORTER",
    check=_check,
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
        foreign = _foreign()
        kind = next((one.kind for one in foreign if out.suffix.lower() in one.suffixes), "")
        with EXPORTERS.blaming(kind):
            written = export_head(loaded, out, {n: v for n, v in pose.items() if n in loaded.parameters}, foreign)
    for path in written:
        console.print(f"wrote {path}", soft_wrap=True)


def _foreign() -> list[Exporter]:
    """Exporters that other packages add; of two that want one suffix the first."""
    own, taken = {one.kind for one in exporters()}, set[str]()
    found = []
    for one in EXPORTERS.all():
        if one.kind not in own and not taken & {*one.suffixes}:
            taken |= {*one.suffixes}
            found.append(one)
    return found
