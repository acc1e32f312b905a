"""The DCP engine: control-point surfaces, their tessellation and their deformation.

In: control points, surface files, head folders, meshes to fit, values of parameters. Out: vertices and normals that
follow, pictures, heads, files for other programs. Imports numpy, numba and scipy, OpenGL under ``view`` alone, and
neither ``drivers`` nor ``controller``.

What stands here is loaded when it is first asked for: whoever only needs an error's name does not wait for numpy.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from surface.base.errors import FitError, HeadFileError, SurfaceError, SurfaceFileError, ViewError
    from surface.mesh.domain import Domain, Slit
    from surface.mesh.mesh import Mesh
    from surface.spline.basis import blending

    from .dcp import DCPSurface

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
_ERRORS = ("FitError", "HeadFileError", "SurfaceError", "SurfaceFileError", "ViewError")
_WHERE = {"DCPSurface": "dcp", "Domain": "mesh.domain", "Mesh": "mesh.mesh", "Slit": "mesh.domain"}
_WHERE |= {"blending": "spline.basis"} | dict.fromkeys(_ERRORS, "base.errors")


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_WHERE[name]}", __name__), name)


def __dir__() -> list[str]:
    return [*globals(), *__all__]
