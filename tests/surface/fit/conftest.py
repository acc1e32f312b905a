"""A small fitted head that several tests look at."""

from dataclasses import replace

import numpy as np
import pytest
from eye_face import face, joined, pair, shell
from fewer_points import fewer_points

from surface.fit import fit_mesh
from surface.fit.source.load import Loaded
from surface.fit.source.names import map_names
from surface.head import Head, HeadData
from tests.once import once


@pytest.fixture
def given_charts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Keeps the face's charts as they are: charts of our own take seconds and say nothing about eyes."""
    monkeypatch.setattr("surface.fit.source.owncharts.MAX_UNEVENNESS", np.inf)


@pytest.fixture(scope="package")
def head(tmp_path_factory: pytest.TempPathFactory) -> Head:
    """A small fit of the face, with eyes in halves and a blink that leaves a fifth of the opening."""
    return Head(once(tmp_path_factory, "fitted-face", fitted_face))


def fitted_face() -> HeadData:
    lazy = replace(face(), deltas=face().deltas * np.array([0.8, 0.8, 1.0])[:, None, None])
    mesh = joined([("Head", lazy), *pair(lambda c: shell(c, reach=np.pi / 2), ("eye_L", "eye_R"))])
    with fewer_points(1600):  # lids are narrow
        return fit_mesh(Loaded(mesh, map_names(mesh.names)), "plain", lambda *_: None).head
