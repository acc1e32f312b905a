"""The tree of errors that the surface room raises.

A wrong argument to :class:`surface.DCPSurface` is a ``ValueError`` that names the argument and the index.
"""

from __future__ import annotations


class SurfaceError(Exception):
    """Any error of the surface room.

    message : what failed, where (file and key) and why.
    hint : the next thing to type or do; may be empty.
    """

    def __init__(self, message: str, *, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint


class HeadFileError(SurfaceError):
    """A head's files are missing, damaged or of another version."""


class FitError(SurfaceError):
    """A mesh cannot be turned into a head: no texture coordinates, NaN, mismatched shapes."""


class ExportError(SurfaceError):
    """A head cannot be written for other programs."""


class SurfaceFileError(SurfaceError):
    """A surface file is damaged, or holds what no DCP surface can be exactly."""


class ViewError(SurfaceError):
    """No picture can be drawn: no OpenGL, no display, or a context that is too old."""


class MissingPackage(SurfaceError, ImportError):
    """An optional package is not installed; :attr:`hint` is the command that installs it."""
