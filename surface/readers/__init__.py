"""Readers of surface files: each turns its file into control points with local knots, exactly.

In: paths of files. Out: surfaces with names and domains, or an error that names the line. Imports base to dcp.

====== =========================================== =================================
suffix content                                     module
====== =========================================== =================================
.json  omote's own plain format, read and written  :mod:`surface.readers.plain`
.3dm   openNURBS: surfaces and trimmed faces       :mod:`surface.readers.rhino`
.xml   G+Smo: tensor, rational and (T)HB-splines   :mod:`surface.readers.gismo`
.tsm   T-splines on one rectangle                  :mod:`surface.readers.tsm`
====== =========================================== =================================
"""

from __future__ import annotations

import os
from pathlib import Path

from . import gismo, plain, rhino, tsm
from .common import Location, NamedSurface, summary
from .plain import is_plain, write_surfaces

__all__ = ["SUFFIXES", "NamedSurface", "is_plain", "read_surface", "summary", "write_surfaces"]

_READERS = {".json": plain.read, ".3dm": rhino.read, ".xml": gismo.read, ".tsm": tsm.read}
SUFFIXES = tuple(_READERS)


def read_surface(path: str | os.PathLike[str]) -> list[NamedSurface]:
    """All surfaces of a file, at least one.

    path : its suffix chooses the format: one of :data:`SUFFIXES`

    Raises SurfaceFileError: naming file and line or element: another suffix, a damaged file, or one that no DCP surface
    can be exactly. SurfaceError: for .3dm where rhino3dm is not installed.
    """
    file = Path(path)
    suffix = file.suffix.lower()
    if suffix not in _READERS:
        hint = f"use {', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}"
        raise Location(file).error(f"no surface file: its name ends in {suffix or 'nothing'}", hint=hint)
    surfaces = _READERS[suffix](file)
    if not surfaces:
        raise Location(file).error("holds no surface", hint="export at least one surface into it")
    return surfaces
