"""Charts: samples, folds, slits, tiles."""

import numpy as np
from slit_sheet import ROW, SLIT, N, slit_sheet

from surface.fit.source.chart import TILE, make_chart, slit_of
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
