"""Turn meshes with texture coordinates and expression shapes into heads made of DCP surfaces."""

from surface.fit.api import fit_head, fit_mesh
from surface.fit.points.report import FitReport, PartReport

__all__ = ["FitReport", "PartReport", "fit_head", "fit_mesh"]
