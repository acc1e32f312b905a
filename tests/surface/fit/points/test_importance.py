"""Care: control points are added where errors of lids ask for them."""

from dataclasses import replace

import numpy as np
from scipy.sparse import identity

from surface.fit.points.importance import LID_IMPORTANCE, with_importance
from surface.fit.points.refine import FitRequest, Fitted, need
from surface.fit.source.chart import Chart
from surface.fit.source.mesh import FitMesh

EYE = np.array([[30.0, 40.0, 50.0]])


def chart_of(points: np.ndarray) -> tuple[Chart, FitMesh]:
    n = len(points)
    mesh = FitMesh(points, np.zeros((0, 4), int), np.zeros((n, 2)), np.zeros((0, 4), int), (), np.zeros((0, n, 3)))
    none = np.zeros(n, bool)
    return Chart(np.zeros((n, 2)), identity(n, format="csr"), np.ones(n), np.zeros((n, 2)), none, [], []), mesh


def test_skin_near_the_front_of_an_eye_counts_more() -> None:
    away = np.array([1.0, 1.29, 1.5, 1.71, 3.0, 1.0])
    forward = np.array([1.0, 1.0, 1.0, 1.0, 1.0, -1.0])  # the last lies behind the eye
    chart, mesh = chart_of(EYE + 10.0 * np.column_stack([0 * away, 0 * away, away * forward]))
    importance = with_importance(chart, mesh, EYE, 10.0).importance
    assert importance is not None
    np.testing.assert_allclose(
        importance, [LID_IMPORTANCE, LID_IMPORTANCE, 0.5 * (1.0 + LID_IMPORTANCE), 1.0, 1.0, 1.0]
    )


def test_an_error_that_counts_more_is_needed_more() -> None:
    chart, _ = chart_of(np.zeros((3, 3)))
    fitted = Fitted(None, np.zeros((0, 3)), np.zeros((0, 0, 3)), np.full(3, 0.5), np.zeros((0, 3)))  # type: ignore[arg-type]
    np.testing.assert_allclose(need(chart, fitted, FitRequest(10)), [2.0] * 3)
    careful = replace(chart, importance=np.array([1.0, 3.0, 2.0]))
    np.testing.assert_allclose(need(careful, fitted, FitRequest(10)), [2.0, 6.0, 4.0])
