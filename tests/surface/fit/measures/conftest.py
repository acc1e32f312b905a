"""A sheet with a slit, and the head that was fitted to it."""

from __future__ import annotations

import pytest
from slit_sheet import slit_sheet

from surface.fit.api import fit_mesh
from surface.fit.points.report import FitResult
from surface.fit.source.load import Loaded
from surface.fit.source.mesh import FitMesh
from surface.fit.source.names import map_names
from tests.once import once


@pytest.fixture(scope="package")
def mesh() -> FitMesh:
    return slit_sheet()


@pytest.fixture(scope="package")
def result(mesh: FitMesh, tmp_path_factory: pytest.TempPathFactory) -> FitResult:
    return once(tmp_path_factory, "fitted-sheet", lambda: fitted(mesh))


def fitted(mesh: FitMesh) -> FitResult:
    return fit_mesh(Loaded(mesh, map_names(mesh.names)), "sheet", lambda part, done: None)
