"""Charts: samples, folds, slits, tiles."""

import numpy as np
import pytest
from slit_sheet import ROW, SIZE_MM, SLIT, N, slit_sheet

from surface.fit.points.refine import FitRequest, fit_chart
from surface.fit.source.chart import TILE, face_slopes, join_slopes, make_chart, slit_of
from surface.fit.source.islands import Island, find_islands
from surface.fit.source.mesh import FitMesh


def test_samples_are_vertices_face_centres_and_border_edges():
    mesh = slit_sheet()
    chart = make_chart(mesh, find_islands(mesh), normalise=False)
    border = 4 * N + 2 * (SLIT[1] - SLIT[0]) + 2
    assert chart.uv.shape == ((N + 1) ** 2 + len(mesh.faces) + border, 2)
    np.testing.assert_allclose(chart.mix @ mesh.uv, chart.uv, atol=1e-12)
    assert chart.weight.max() > 2 * np.median(chart.weight)


def test_the_slit_is_found_where_it_is():
    mesh = slit_sheet()
    (cut,) = make_chart(mesh, find_islands(mesh), normalise=False).cuts
    assert np.allclose([cut.v, cut.start, cut.end], [(ROW + 0.5) / N, SLIT[0] / N, SLIT[1] / N])


def test_a_round_hole_is_no_slit():
    t = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    assert slit_of(np.column_stack([np.cos(t), np.sin(t)])) is None


def test_islands_stand_in_tiles_of_their_own_and_mirrored_ones_are_turned():
    mesh = slit_sheet()
    island = find_islands(mesh)[0]
    other = Island(island.vertex, island.uv * [-3.0, 3.0], island.faces)
    chart = make_chart(mesh, [island, other])
    first, second = np.split(chart.uv, 2)
    assert first.min() >= 0 and first.max() <= 1
    assert second[:, 0].min() >= TILE and second[:, 0].max() <= TILE + 1
    np.testing.assert_allclose(second - [TILE, 0.0], first, atol=1e-12)


def test_deep_folds_are_held_loosely():
    mesh = slit_sheet()
    pit = np.linalg.norm(mesh.uv - [0.25, 0.25], axis=1) < 0.08
    deep = mesh.vertices.copy()
    deep[pit, 2] -= 2000 * np.maximum(0, 0.08 - np.linalg.norm(mesh.uv[pit] - [0.25, 0.25], axis=1)) / 0.08
    folded = FitMesh(deep, mesh.faces, mesh.uv, mesh.face_uv, mesh.names, mesh.deltas)
    chart = make_chart(folded, find_islands(folded), normalise=False)
    near = np.linalg.norm(chart.uv - [0.25, 0.25], axis=1)
    assert chart.folded[near < 0.05].any()
    assert not chart.folded[near > 0.15].any()
    assert chart.weight[chart.folded].max() < 0.6


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
