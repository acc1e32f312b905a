"""Definition of an exporter: the object by which a module or another package writes heads in one file format."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from surface.export.animation import Animation
from surface.head import Head

API = 1
"""Version of the interface of exporters: this module and :class:`surface.head.Head`."""
Write = Callable[[Head, Path, Mapping[str, float]], list[Path]]
Animate = Callable[[Head, Animation, Path, Mapping[str, float]], list[Path]]


@dataclass(frozen=True, kw_only=True)
class Exporter:
    """One file format.

    api : version of the interface it uses; see :data:`API`
    write_in_file : as ``write``, but in axes, origin and unit of the file that the head was fitted to
        (``head.data.placement``); None for a format that is always written in head space
    kind : a short name, as "glb"; the module's own for the exporters of this folder
    title : short description of the file's content
    suffixes : of such files, in lower case, as (".glb",)
    animate : as ``write``, with an animation before the path; None for a format that has none
    write_web : as ``write``, small and with what a page of a browser needs; None for a format that has no such files
    install : argument of ``pip install`` for a missing package
    write : is called with the head, the path and a pose (values by parameter, empty at rest) and returns the paths
        written. It leaves no incomplete files, and raises ExportError, or OSError if a path cannot be written to
    """

    api: int
    kind: str
    title: str
    suffixes: tuple[str, ...]
    write: Write
    install: str = ""
    write_in_file: Write | None = None
    animate: Animate | None = None
    write_web: Write | None = None
