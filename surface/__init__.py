"""The DCP engine: control-point surfaces, their tessellation and their deformation."""

from __future__ import annotations

from .basis import blending
from .dcp import DCPSurface
from .errors import FitError, HeadFileError, SurfaceError, ViewError

__all__ = ["DCPSurface", "FitError", "HeadFileError", "SurfaceError", "ViewError", "blending"]
