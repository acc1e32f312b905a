"""Turn meshes with texture coordinates and expression shapes into heads made of DCP surfaces.

In: files of meshes with texture coordinates and shapes. Out: head folders, and reports of how well they fit.
Imports base to dcp, readers, head, and view for the pictures of a report.

Importing it raises MissingPackage where scipy, which the extra ``fit`` brings, is not installed.
"""

from surface.base.extras import require

require("fitting a head", "scipy")

from surface.fit.api import fit_head, fit_mesh  # noqa: E402  what it imports needs scipy
from surface.fit.points.report import FitReport, PartReport  # noqa: E402  the same

__all__ = ["FitReport", "PartReport", "fit_head", "fit_mesh"]
