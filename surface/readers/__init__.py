"""Readers of surface files: each turns its file into control points with local knots, exactly.

In: paths of files. Out: surfaces with names and domains, or an error that names the line. Imports base to dcp.

====== =========================================== =================================
suffix what                                        module
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

from .named import NamedSurface, Place, summary
from .plain import is_plain, write_surfaces

__all__ = ["SUFFIXES", "NamedSurface", "is_plain", "read_surface", "summary", "write_surfaces"]

SUFFIXES = (".json", ".3dm", ".xml", ".tsm")


def read_surface(path: str | os.PathLike[str]) -> list[NamedSurface]:
    """All surfaces of a file, at least one.

    Parameters
    ----------
    path : its suffix says what it is: one of :data:`SUFFIXES`

    Raises
    ------
    SurfaceFileError
        naming file and line or element: another suffix, a damaged file, or one that no DCP surface can be exactly.
    SurfaceError
        for .3dm where rhino3dm is not installed.
    """
    file = Path(path)
    kind = file.suffix.lower()
    if kind == ".json":
        from .plain import read  # of the readers only the one that is needed is loaded
    elif kind == ".3dm":
        from .rhino import read
    elif kind == ".xml":
        from .gismo import read
    elif kind == ".tsm":
        from .tsm import read
    else:
        raise Place(file).error(f"no surface file: its name ends in {kind or 'nothing'}", hint="use " + _kinds())
    surfaces = read(file)
    if not surfaces:
        raise Place(file).error("holds no surface", hint="export at least one surface into it")
    return surfaces


def _kinds() -> str:
    return ", ".join(SUFFIXES[:-1]) + f" or {SUFFIXES[-1]}"
