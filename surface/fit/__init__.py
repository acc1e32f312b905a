"""Turn meshes with texture coordinates and expression shapes into heads made of DCP surfaces.

In: files of meshes with texture coordinates and shapes. Out: head folders, and reports of how well they fit.
Imports base to dcp, readers, head, and view for the pictures of a report.
"""

from surface.fit.api import fit_head, fit_mesh
from surface.fit.points.report import FitReport, PartReport

__all__ = ["FitReport", "PartReport", "fit_head", "fit_mesh"]
