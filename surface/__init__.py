"""The DCP engine: control-point surfaces, their tessellation and their deformation."""

from __future__ import annotations

from .basis import blending
from .dcp import DCPSurface
from .domain import Domain, Slit
from .errors import FitError, HeadFileError, SurfaceError, SurfaceFileError, ViewError
from .mesh import Mesh

__all__ = [
    "DCPSurface",
    "Domain",
    "FitError",
    "HeadFileError",
    "Mesh",
    "Slit",
    "SurfaceError",
    "SurfaceFileError",
    "ViewError",
    "blending",
]
