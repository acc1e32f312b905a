"""Where a surface is calm, and what its slopes are to be there."""

import numpy as np
import pytest
from slit_sheet import N, slit_sheet

from surface.fit.points.calm import (
    MIN_HOLD,
    STEADIER,
    SlopeTargets,
    beside,
    calm_faces,
    calm_points,
    level_at_rims,
    samples_of,
)
from surface.fit.points.net import coarse_places, net_at
from surface.fit.points.solve import basis
from surface.fit.source.chart import Chart, make_chart
from surface.fit.source.islands import find_islands
from surface.fit.source.mesh import FitMesh


def split(mesh: FitMesh) -> FitMesh:
    """Every quad as two triangles."""
    a, b, c, d = mesh.faces.T
    none = np.full(len(a), -1)
    faces = np.concatenate([np.column_stack([a, b, c, none]), np.column_stack([a, c, d, none])])
    return FitMesh(mesh.vertices, faces, mesh.uv, faces.copy(), mesh.names, mesh.deltas)


@pytest.fixture(scope="module", params=[False, True], ids=["quads", "triangles"])
def sheet(request) -> tuple[FitMesh, Chart]:
    mesh = split(slit_sheet()) if request.param else slit_sheet()
    return mesh, make_chart(mesh, find_islands(mesh), normalise=False)


def vertices_of(mesh: FitMesh, chart: Chart, samples: np.ndarray) -> np.ndarray:
    return np.flatnonzero(np.abs(chart.mix[np.flatnonzero(samples)].toarray()).max(axis=0) > 0)


def chosen(chart: Chart, *places: int) -> np.ndarray:
    return np.isin(np.arange(len(chart.uv)), places)


@pytest.mark.parametrize("where", [(0,), (140, 300), (700,)])
def test_faces_are_calm_that_share_no_vertex_with_a_strict_sample(sheet, where):
    mesh, chart = sheet
    strict = chosen(chart, *where)
    own = vertices_of(mesh, chart, strict)
    expected = ~np.isin(mesh.faces, own).any(axis=1)
    np.testing.assert_array_equal(calm_faces(chart, chart.slopes, strict), expected)
    assert 0 < (~expected).sum() < 40
    assert calm_faces(chart, chart.slopes, strict & False).all()


@pytest.mark.parametrize("where", [(140,), (700, 20)])
def test_samples_beside_others_share_a_vertex_with_them(sheet, where):
    mesh, chart = sheet
    own = vertices_of(mesh, chart, chosen(chart, *where))
    expected = np.abs(chart.mix.toarray()[:, own]).max(axis=1) > 0
    np.testing.assert_array_equal(beside(chart, chosen(chart, *where)), expected)
    assert len(where) < expected.sum() < 60


def test_points_are_calm_that_hold_no_strict_sample(sheet):
    _, chart = sheet
    rows = basis(net_at(coarse_places(chart.uv, 0.1), 0.1, [], chart.uv), chart.uv)
    strict = chosen(chart, 140, 300)
    held = (rows.toarray()[[140, 300]] > MIN_HOLD).any(axis=0)
    np.testing.assert_array_equal(calm_points(rows, strict), ~held)
    assert 0 < held.sum() < 20 and calm_points(rows, strict & False).all()


def test_slopes_are_smooth_ones_where_calm_and_those_of_flat_faces_elsewhere(sheet):
    """A calm face has the mean slope of its corners, and turns half of what is left half-way to each."""
    mesh, chart = sheet
    s = chart.slopes
    mixes = (s.mix_u, s.mix_v, s.turn_u, s.turn_v)
    own_u, own_v, turn_u, turn_v = (samples_of(mesh, m) for m in mixes)
    calm = np.random.default_rng(3).random(len(mesh.faces)) < 0.5
    (slopes, *got), turns = SlopeTargets(s, own_u, own_v, turn_u, turn_v).at(calm)
    np.testing.assert_array_equal(slopes.weight, s.weight * np.where(calm, STEADIER, 1.0))
    corners = (mesh.faces >= 0).sum(axis=1)
    for own, turn, slope, turned in zip((own_u, own_v), (turn_u, turn_v), got, turns, strict=True):
        for f in range(0, len(calm), 37):
            at = own[f] + turn[4 * f : 4 * f + corners[f]]  # slopes at the corners
            smooth = at.mean(axis=0)
            np.testing.assert_allclose(slope[f], smooth if calm[f] else own[f], atol=1e-12)
            half = 0.5 * (at - smooth) if calm[f] else 0 * at
            np.testing.assert_allclose(turned[4 * f : 4 * f + corners[f]], half, atol=1e-12)
            np.testing.assert_array_equal(turned[4 * f + corners[f] : 4 * f + 4], 0.0)
    assert np.abs(turns[0]).max() > 1e-3


def test_samples_of_a_mesh_are_neutral_and_then_each_shape(sheet):
    mesh, chart = sheet
    rows = samples_of(mesh, chart.mix)
    assert rows.shape == (len(chart.uv), 9)
    for k, field in enumerate((mesh.vertices, *mesh.deltas)):
        np.testing.assert_array_equal(rows[:, 3 * k : 3 * k + 3], chart.mix @ field)
    assert len(chart.uv) > N**2


def tube(sides: int) -> FitMesh:
    """A tube of flat sides, upright, whose two halves are islands of their own in (u, v) and share their borders."""
    angle = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([10 * np.cos(angle), 0 * angle, 10 * np.sin(angle)])
    vertices = np.concatenate([ring + np.array([0, y, 0]) for y in (0.0, 5.0, 10.0)])
    k, row = (x.ravel() for x in np.meshgrid(np.arange(sides), np.arange(2)))
    faces = np.column_stack([row * sides + k, (row + 1) * sides + k, (row + 1) * sides + (k + 1) % sides,
                             row * sides + (k + 1) % sides])  # fmt: skip
    half = sides // 2
    u = np.column_stack([k, k, k + 1, k + 1]) / half * 0.4 + np.where(k >= half, 0.1, 0.0)[:, None]
    v = 0.2 * np.column_stack([row, row + 1, row + 1, row])
    uv = np.column_stack([u.ravel(), v.ravel()])
    uv, place = np.unique(uv.round(9), axis=0, return_inverse=True)
    none = np.zeros((0, len(vertices), 3))
    return FitMesh(vertices, faces.astype(np.int64), uv, place.reshape(-1, 4).astype(np.int64), (), none)


@pytest.mark.parametrize(("sides", "smooth"), [(8, True), (4, False)])
def test_borders_lie_as_the_whole_mesh_does_unless_it_has_a_crease_there(sides, smooth):
    mesh = tube(sides)
    chart = make_chart(mesh, find_islands(mesh))
    s = chart.slopes
    before = SlopeTargets(s, *(samples_of(mesh, m) for m in (s.mix_u, s.mix_v, s.turn_u, s.turn_v)))
    after = level_at_rims(mesh, before)
    upright = np.isin(s.rim % sides, [0, sides // 2]) & (s.rim >= 0)
    assert upright.sum() == 16
    face = np.flatnonzero(upright) // 4
    for wanted, level in ((before, False), (after, smooth)):
        u, v = wanted.u[face] + wanted.turn_u[upright], wanted.v[face] + wanted.turn_v[upright]
        normal = np.cross(u, v)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        outwards = mesh.vertices[s.rim[upright]] * [0.1, 0.0, 0.1]
        assert np.allclose(np.abs((normal * outwards).sum(axis=1)), 1.0, atol=1e-9) == level
    inside = s.rim < 0
    np.testing.assert_array_equal(after.turn_u[inside], before.turn_u[inside])
