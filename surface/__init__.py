"""The DCP engine: control-point surfaces, their tessellation and their deformation.

In: control points, surface files, head folders, meshes to fit, values of parameters. Out: vertices and normals that
follow, pictures, heads, files for other programs. Imports numpy and numba; scipy where
something is fitted, OpenGL under ``view`` alone, and neither ``drivers`` nor ``controller``.

The errors are imported at once; the rest is imported on first use, because it imports numpy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from surface.base.errors import FitError, HeadFileError, SurfaceError, SurfaceFileError, ViewError

if TYPE_CHECKING:
    from surface.dcp import DCPSurface
    from surface.mesh.domain import Domain, Slit
    from surface.mesh.mesh import Mesh
    from surface.spline.basis import blending

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


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    # start-up: code that only needs an error does not wait for numpy
    from surface.dcp import DCPSurface
    from surface.mesh.domain import Domain, Slit
    from surface.mesh.mesh import Mesh
    from surface.spline.basis import blending

    return {each.__name__: each for each in (DCPSurface, Domain, Mesh, Slit, blending)}[name]


def __dir__() -> list[str]:
    return [*globals(), *__all__]
