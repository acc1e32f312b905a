"""Heads of surface files: the surfaces' own control points, with groups made by hand or taken from another head.

In: a surface file, or surfaces in memory. Out: a head's data, its folder, a report. Imports base to head, check and the
parts of fit before it.
"""

from surface.fit.surfaces.api import SurfaceOptions, fit_surfaces, head_of
from surface.fit.surfaces.report import SurfaceReport, SurfaceRow

__all__ = ["SurfaceOptions", "SurfaceReport", "SurfaceRow", "fit_surfaces", "head_of"]
