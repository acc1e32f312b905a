"""Slopes of the mesh in (u, v)."""

import numpy as np
import pytest
from slit_sheet import SIZE_MM, N, slit_sheet

from surface.fit.points.refine import FitRequest, fit_chart
from surface.fit.source.chart import make_chart
from surface.fit.source.islands import Island, find_islands
from surface.fit.source.mesh import FitMesh
from surface.fit.source.slopes import face_slopes, join_slopes

MESH = slit_sheet()
ISLAND = find_islands(MESH)[0]


def test_slopes_of_a_linear_function_are_exact():
    s = face_slopes(ISLAND, len(MESH.vertices), np.ones(len(ISLAND.uv)))
    f = MESH.uv @ [3.0, -2.0] + 1.0
    np.testing.assert_allclose(s.mix_u @ f, 3.0 * s.span[:, 0], rtol=1e-6)
    np.testing.assert_allclose(s.mix_v @ f, -2.0 * s.span[:, 1], rtol=1e-6)
    np.testing.assert_allclose(s.span, 1.0 / N, rtol=1e-6)


def test_slopes_of_the_sheet_are_its_derivatives():
    s = face_slopes(ISLAND, len(MESH.vertices), np.ones(len(ISLAND.uv)))
    want = SIZE_MM * -0.6 * np.sin(3 * (s.uv[:, 0] - 0.5)) * np.cos(3 * (s.uv[:, 1] - 0.5)) / N
    np.testing.assert_allclose(s.mix_u @ MESH.vertices[:, 2], want, atol=0.02)


def test_joined_slopes_stand_one_after_the_other():
    one = face_slopes(ISLAND, len(MESH.vertices), np.ones(len(ISLAND.uv)))
    two = join_slopes([one, one])
    assert two.mix_u.shape == (2 * one.mix_u.shape[0], one.mix_u.shape[1])
    np.testing.assert_array_equal(two.uv[len(one.uv) :], one.uv)


def sliver_sheet() -> FitMesh:
    """The sheet with one quad cut in two: a corner lies beside the diagonal, 0.3 mm off where (u, v) says."""
    a, b, c, d = MESH.faces[60]
    uv, vertices = MESH.uv.copy(), MESH.vertices.copy()
    uv[b] = 0.5 * (uv[a] + uv[c]) + [1e-4, -1e-4]
    vertices[b] = 0.5 * (vertices[a] + vertices[c]) + [0.2, -0.2, 0.0]
    faces = np.vstack([np.delete(MESH.faces, 60, axis=0), [[a, b, c, -1], [a, c, d, -1]]])
    return FitMesh(vertices, faces, uv, faces.copy(), MESH.names, MESH.deltas)


def test_slivers_in_uv_say_little_of_the_slope_across_them():
    mesh = sliver_sheet()
    (island,) = find_islands(mesh)
    s = face_slopes(island, len(mesh.vertices), np.ones(len(island.uv)), doubt_slivers=True)
    assert s.weight[-2] < 1e-3  # the sliver; half a square that is left has 1 - r^2 = 3/4
    np.testing.assert_allclose(s.weight[-1], 0.75, atol=1e-6)
    np.testing.assert_allclose(np.median(s.weight), 1.0, atol=1e-6)


@pytest.mark.parametrize("squeezed", [[0.0, 1.0], [1.0, 0.0], [0.0, 0.0]])
def test_faces_without_extent_in_uv_have_finite_slopes(squeezed):
    flat = Island(ISLAND.vertex, ISLAND.uv * squeezed, ISLAND.faces)
    s = face_slopes(flat, len(MESH.vertices), np.ones(len(flat.uv)), doubt_slivers=True)
    assert s.weight.min() >= 0 and s.weight.max() <= 1
    assert np.isfinite(s.mix_u.data).all() and np.isfinite(s.mix_v.data).all()


def test_a_sliver_in_uv_raises_no_spike():
    mesh = sliver_sheet()
    worst = []
    for doubt in (True, False):
        chart = make_chart(mesh, find_islands(mesh), normalise=False, doubt_slivers=doubt)
        worst.append(fit_chart(mesh, chart, FitRequest(200, coarse=0.2)).error.max())
    assert worst[0] < 1.0 < 3.0 < worst[1]
