"""Readers of surface files: each turns its file into control points with local knots, exactly.

In: paths of files. Out: surfaces with names and domains, or an error that names the line. Imports base to dcp.

====== =========================================== =================================
suffix content                                     module
====== =========================================== =================================
.json  omote's own plain format, read and written  :mod:`surface.readers.plain`
.3dm   openNURBS: surfaces and trimmed faces       :mod:`surface.readers.rhino`
.xml   G+Smo: tensor, rational and (T)HB-splines   :mod:`surface.readers.gismo`
.tsm   T-splines of any form                       :mod:`surface.readers.tsm`
====== =========================================== =================================
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from . import gismo, plain, rhino, tsm
from .common import LeaveOut, Location, NamedSurface, Ties, summary
from .plain import is_plain, write_surfaces

__all__ = ["SUFFIXES", "NamedSurface", "Ties", "is_plain", "read_surface", "summary", "write_surfaces"]

_READERS: dict[str, Callable[[Path], list[NamedSurface]]] = {
    ".json": plain.read, ".3dm": rhino.read, ".xml": gismo.read, ".tsm": tsm.read,
}  # fmt: skip
SUFFIXES = tuple(_READERS)


def read_surface(path: str | os.PathLike[str], leave_out: LeaveOut | None = None) -> list[NamedSurface]:
    """Return all surfaces of a file, at least one.

    path : its suffix chooses the format: one of :data:`SUFFIXES`
    leave_out : is called with the error of each object or face of a .3dm file that cannot be read, and the rest is
        returned; without it the first such error is raised

    Raises SurfaceFileError: naming file and line or element: another suffix, a damaged file, or one that no DCP surface
    can be exactly. SurfaceError: for .3dm where rhino3dm is not installed.
    """
    file = Path(path)
    suffix = file.suffix.lower()
    if suffix not in _READERS:
        hint = f"use {', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}"
        raise Location(file).error(f"no surface file: its name ends in {suffix or 'nothing'}", hint=hint)
    surfaces = rhino.read(file, leave_out) if suffix == ".3dm" else _READERS[suffix](file)
    if not surfaces:
        raise Location(file).error("holds no surface", hint="export at least one surface into it")
    return surfaces
