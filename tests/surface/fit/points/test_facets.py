"""surface.fit.points.facets: the distance of flat faces from what is smooth, on balls, where a closed form has it."""

import numpy as np
import pytest

from surface.fit.points.facets import facet_sag
from surface.fit.source.chart import make_chart
from surface.fit.source.islands import find_islands
from surface.fit.source.mesh import FitMesh

RADIUS = 100.0


def cap(step: float, spread: float = 0.4) -> FitMesh:
    """A piece of a ball as a net of triangles, ``step`` rad apart."""
    ticks = np.arange(-spread, spread + 1e-9, step)
    u, v = (x.ravel() for x in np.meshgrid(ticks, ticks, indexing="ij"))
    at = RADIUS * np.column_stack([np.sin(u) * np.cos(v), np.sin(v), np.cos(u) * np.cos(v)])
    k = np.arange(len(at)).reshape(len(ticks), -1)
    a, b, c, d = k[:-1, :-1].ravel(), k[1:, :-1].ravel(), k[1:, 1:].ravel(), k[:-1, 1:].ravel()
    none = np.full(len(a), -1)
    faces = np.concatenate([np.column_stack([a, b, c, none]), np.column_stack([a, c, d, none])])
    uv = (np.column_stack([u, v]) + spread) / (2 * spread)
    return FitMesh(at, faces, uv, faces, (), np.zeros((0, len(at), 3)))


@pytest.mark.parametrize("step", [0.05, 0.1, 0.2])
def test_in_the_middle_of_a_ball_it_is_what_its_faces_cut_off(step):
    mesh = cap(step)
    chart = make_chart(mesh, find_islands(mesh), normalise=False)
    centre = chart.mix @ mesh.vertices
    inner = (np.diff(chart.mix.indptr) == 3) & (np.linalg.norm(centre[:, :2], axis=1) < 0.2 * RADIUS)
    true = RADIUS - np.linalg.norm(centre[inner], axis=1)
    np.testing.assert_allclose(facet_sag(mesh, chart)[inner], true, rtol=0.12)


def test_a_vertex_has_the_mean_of_its_faces():
    mesh = cap(0.2)
    chart = make_chart(mesh, find_islands(mesh), normalise=False)
    sag, mix = facet_sag(mesh, chart), chart.mix.tocsr()
    middle = int(np.linalg.norm(mesh.vertices[:, :2], axis=1).argmin())
    own = np.flatnonzero((np.diff(mix.indptr) == 1) & (mix @ (np.arange(len(mesh.vertices)) == middle) > 0))
    around = np.flatnonzero((np.diff(mix.indptr) == 3) & (mix @ (np.arange(len(mesh.vertices)) == middle) > 0))
    assert len(own) == 1 and len(around) == 6
    assert sag[own[0]] == pytest.approx(sag[around].mean())


def test_a_flat_sheet_has_none():
    mesh = cap(0.2)
    flat = FitMesh(mesh.vertices * [1.0, 1.0, 0.0], mesh.faces, mesh.uv, mesh.face_uv, (), mesh.deltas)
    chart = make_chart(flat, find_islands(flat), normalise=False)
    np.testing.assert_allclose(facet_sag(flat, chart), 0.0, atol=1e-9)
