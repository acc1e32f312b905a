"""One skin is wrapped round the islands of a tongue."""

import numpy as np
import pytest

from surface.fit.features.joins import find_seams
from surface.fit.points.refine import FitRequest, fit_chart
from surface.fit.points.solve import basis
from surface.fit.source.islands import Island
from surface.fit.source.mesh import FitMesh
from surface.fit.source.wrap import wrap_chart

RADII = np.array([18.0, 10.0, 30.0])


def body() -> tuple[FitMesh, list[Island]]:
    """An ellipsoid along z in two islands, its upper and its lower half; one shape pulls it sideways."""
    a, b = np.meshgrid(np.linspace(0.02, np.pi - 0.02, 25), np.linspace(0, 2 * np.pi, 49), indexing="ij")
    p = np.stack([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)], axis=-1) * RADII + [0.0, -40.0, 65.0]
    at = np.arange(25 * 49).reshape(25, 49)
    quads = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], axis=-1)
    islands = []
    for half in (quads[:, :24], quads[:, 24:]):
        vertex, faces = np.unique(half.reshape(-1, 4), return_inverse=True)
        islands.append(Island(vertex, np.zeros((len(vertex), 2)), faces.reshape(-1, 4)))
    faces, points = quads.reshape(-1, 4), p.reshape(-1, 3)
    sideways = np.zeros_like(points)
    sideways[:, 0] = (points[:, 2] - 35.0) / 10.0
    return FitMesh(points, faces, np.zeros((1, 2)), np.zeros_like(faces), ("aside",), sideways[None]), islands


@pytest.fixture(scope="module")
def wrapped():
    mesh, islands = body()
    chart = wrap_chart(mesh, islands)
    return mesh, chart, fit_chart(mesh, chart, FitRequest(160, coarse=0.2))


def test_samples_are_mixes_of_vertices_on_the_skin(wrapped):
    mesh, chart, _ = wrapped
    np.testing.assert_allclose(chart.mix.sum(axis=1), 1.0)
    assert chart.mix.data.min() > -1e-5
    away = np.linalg.norm((chart.mix @ mesh.vertices - [0.0, -40.0, 65.0]) / RADII, axis=1)
    assert np.abs(away - 1.0).max() < 0.02


def test_the_surface_follows_the_skin_and_its_shape(wrapped):
    _, _, fit = wrapped
    assert np.sqrt((fit.error**2).mean()) < 0.5
    assert np.sqrt((fit.shape_error**2).mean()) < 0.05


def test_it_faces_outwards(wrapped):
    _, _, fit = wrapped
    at, step = np.array([[0.3, 0.1], [0.3, 0.5], [0.3, 0.75], [0.5, 0.3]]), 1e-4
    u, v = ((basis(fit.net, at + d) - basis(fit.net, at - d)) @ fit.points for d in ([step, 0.0], [0.0, step]))
    outward = basis(fit.net, at) @ fit.points - [0.0, -40.0, 65.0]
    assert ((np.cross(u, v) * outward).sum(axis=1) > 0).all()


def test_its_two_long_sides_are_one_line_without_a_crease(wrapped):
    _, chart, fit = wrapped
    u = np.linspace(0.05, 0.95, 40)
    low, high = np.column_stack([u, np.zeros(40)]), np.column_stack([u, np.ones(40)])
    assert np.linalg.norm((basis(fit.net, low) - basis(fit.net, high)) @ fit.points, axis=1).max() < 0.5
    (seam,) = find_seams({"tongue": chart})
    assert seam.part_a == seam.part_b == "tongue"
    assert sorted({seam.uv_a[0, 1], seam.uv_b[0, 1]}) == [0.0, 1.0]


def test_samples_are_as_far_apart_as_the_rays_and_those_at_the_tip_count_more(wrapped):
    _, chart, _ = wrapped
    u, v = (np.unique(x.round(9)) for x in chart.uv.T)
    np.testing.assert_allclose(chart.spacing, np.tile([u[1] - u[0], v[1] - v[0]], (len(chart.uv), 1)))
    assert (v.min(), v.max(), len(v), len(u)) == (-0.125, 1.125, 41, 38)
    tip = chart.uv[:, 0] == 1.0
    assert (chart.weight[tip & ~chart.folded] == 8.0).all() and (chart.weight[~tip & ~chart.folded] == 1.0).all()


def test_rays_that_meet_nothing_take_their_nearest_neighbour_and_are_not_counted():
    mesh, islands = body()
    holed = [Island(i.vertex, i.uv, i.faces[:-40] if k else i.faces) for k, i in enumerate(islands)]
    chart = wrap_chart(mesh, holed)
    assert 0 < chart.folded.sum() < 0.2 * len(chart.uv)
    assert (chart.weight[chart.folded & (chart.uv[:, 0] < 1.0)] == 0.05).all()
    np.testing.assert_allclose(chart.mix.sum(axis=1), 1.0)
