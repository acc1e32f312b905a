"""Fitting a chart: accuracy grows with points, and a slit lets its lips part."""

import numpy as np
import pytest
from slit_sheet import ROW, N, slit_sheet

from surface.fit.points.refine import FitRequest, Fitted, fit_chart
from surface.fit.points.solve import basis, fairness
from surface.fit.source.chart import make_chart
from surface.fit.source.islands import find_islands


@pytest.fixture(scope="module")
def fitted() -> tuple:
    mesh = slit_sheet()
    chart = make_chart(mesh, find_islands(mesh), normalise=False)
    return mesh, chart, fit_chart(mesh, chart, FitRequest(500, coarse=0.2, neutral_mm=0.05, shape_mm=0.05))


def rms(e: np.ndarray) -> float:
    return float(np.sqrt((e**2).mean()))


def test_neutral_and_shapes_are_met(fitted):
    _, _, fit = fitted
    assert len(fit.net) <= 500
    assert rms(fit.error) < 0.15
    assert max(rms(e) for e in fit.shape_error) < 0.4


def test_more_points_fit_better(fitted):
    mesh, chart, fine = fitted
    coarse = fit_chart(mesh, chart, FitRequest(90, coarse=0.2, neutral_mm=0.05, shape_mm=0.05))
    assert len(coarse.net) < len(fine.net)
    assert rms(coarse.shape_error[0]) > 1.5 * rms(fine.shape_error[0])


def test_the_lower_lip_opens_and_the_upper_one_stays(fitted):
    _, _, fit = fitted
    lips = np.array([[0.5, (ROW + 1) / N], [0.5, ROW / N]])
    moved = basis(fit.net, lips) @ fit.moves[0]
    assert abs(moved[0, 1]) < 0.5
    assert moved[1, 1] < -13


def test_errors_are_those_of_the_surface(fitted):
    mesh, chart, fit = fitted
    error = np.linalg.norm(basis(fit.net, chart.uv) @ fit.points - chart.mix @ mesh.vertices, axis=1)
    np.testing.assert_allclose(error, fit.error, atol=1e-9)


def test_fairness_vanishes_for_a_point_cloud_in_one_place(fitted):
    _, _, fit = fitted
    assert np.abs(fairness(fit.net) @ np.ones(len(fit.net))).max() < 1e-9


def test_progress_never_falls(fitted):
    mesh, chart, _ = fitted
    heard: list[float] = []
    result = fit_chart(mesh, chart, FitRequest(120, coarse=0.25), heard.append)
    assert isinstance(result, Fitted)
    assert heard == sorted(heard) and heard[-1] <= 1.0
