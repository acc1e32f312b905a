"""A sheet with a slit, and the head that was fitted to it."""

from __future__ import annotations

import pytest
from slit_sheet import slit_sheet

from surface.fit.api import fit_mesh
from surface.fit.points.report import FitResult
from surface.fit.source.load import Loaded
from surface.fit.source.mesh import FitMesh
from surface.fit.source.names import map_names


@pytest.fixture(scope="module")
def mesh() -> FitMesh:
    return slit_sheet()


@pytest.fixture(scope="module")
def result(mesh: FitMesh) -> FitResult:
    return fit_mesh(Loaded(mesh, map_names(mesh.names)), "sheet", lambda part, done: None)
