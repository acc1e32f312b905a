"""What an exporter is: one module, or one object from another package, that writes a head in one kind of file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from surface.head import Head

API = 1
"""Version of what an exporter must keep: this module and :class:`surface.head.Head`."""
Write = Callable[[Head, Path, Mapping[str, float]], list[Path]]


@dataclass(frozen=True, kw_only=True)
class Exporter:
    """One kind of file.

    Attributes
    ----------
    api : version it is made for; see :data:`API`
    kind : a short name, as "glb"; the module's own for the exporters of this folder
    title : what the file will hold, in half a sentence
    suffixes : what names of such files end in, in lower case, as (".glb",)
    install : what ``pip install`` takes where a package is missing
    write : is called with the head, the path and a pose (values by parameter, empty at rest) and returns the paths
        written. It leaves nothing half-written, and raises ExportError, or OSError where a place cannot be written to
    """

    api: int
    kind: str
    title: str
    suffixes: tuple[str, ...]
    write: Write
    install: str = ""
