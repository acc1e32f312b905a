"""What an exporter is: one module, or one object from another package, that writes a head in one kind of file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from surface.head import Head

API = 1  # counts up when exporters have to be written otherwise
Write = Callable[[Head, Path, Mapping[str, float]], list[Path]]


@dataclass(frozen=True)
class Exporter:
    """One kind of file.

    Attributes
    ----------
    kind : a short name, as "glb"
    suffixes : what names of such files end in, in lower case, as (".glb",)
    help : what the file will hold, in half a sentence
    write : is called with the head, the path and a pose (values by parameter, empty at rest) and returns the paths
        written. It leaves nothing half-written, and raises ExportError, or OSError where a place cannot be written to
    api : the :data:`API` it was written for
    """

    kind: str
    suffixes: tuple[str, ...]
    help: str
    write: Write
    api: int = API
