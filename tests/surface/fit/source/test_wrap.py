"""One skin is wrapped round the islands of a tongue."""

import numpy as np
import pytest

from surface.fit.features.joins import find_seams
from surface.fit.points.refine import FitRequest, fit_chart
from surface.fit.points.solve import basis
from surface.fit.source import wrap
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


@pytest.mark.slow
def test_samples_are_mixes_of_vertices_on_the_skin(wrapped):
    mesh, chart, _ = wrapped
    np.testing.assert_allclose(chart.mix.sum(axis=1), 1.0)
    assert chart.mix.data.min() > -1e-5
    away = np.linalg.norm((chart.mix @ mesh.vertices - [0.0, -40.0, 65.0]) / RADII, axis=1)
    assert np.abs(away - 1.0).max() < 0.02


def test_even_rays_are_as_dense_at_the_rim_of_a_flat_tongue_as_on_its_back():
    mesh, islands = body()
    flat = mesh.vertices * [1.0, 0.2, 1.0]
    widest = []
    for even in (False, True):
        chart = wrap_chart(FitMesh(**(vars(mesh) | {"vertices": flat})), islands, even=even)
        ring = (chart.mix @ flat)[chart.uv[:, 0] == chart.uv[10 * 41, 0]]
        widest.append(float(np.linalg.norm(np.diff(ring, axis=0), axis=1).max()))
    assert len(ring) == 41 and widest[0] > 6.0 and widest[1] < 4.0, widest


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


@pytest.mark.slow
def test_rays_that_meet_nothing_take_their_nearest_neighbour_and_are_not_counted():
    mesh, islands = body()
    holed = [Island(i.vertex, i.uv, i.faces[:-40] if k else i.faces) for k, i in enumerate(islands)]
    chart = wrap_chart(mesh, holed)
    assert 0 < chart.folded.sum() < 0.2 * len(chart.uv)
    assert (chart.weight[chart.folded & (chart.uv[:, 0] < 1.0)] == 0.05).all()
    np.testing.assert_allclose(chart.mix.sum(axis=1), 1.0)


def test_the_tile_has_a_hole_at_the_tip_and_one_line_along_both_sides(wrapped):
    _, chart, _ = wrapped
    (loop,), (sewn,) = chart.loops, chart.loop_vertices
    assert loop.tolist() == [[0, 0], [0.997, 0], [0.997, 1], [0, 1]] and sewn.tolist() == [-1, -2, -2, -1]
    tip = chart.uv[:, 0] == 1.0
    assert tip.sum() == wrap.AROUND
    assert (chart.weight[tip] == 8.0).all() and set(chart.weight[~tip].tolist()) <= {1.0, 0.05}
    np.testing.assert_array_equal(chart.weight[~tip] == 0.05, chart.folded[~tip])
    steps = [np.diff(np.unique(chart.uv[:, k].round(12))) for k in range(2)]
    for k in range(2):
        np.testing.assert_allclose(steps[k], chart.spacing[0, k], rtol=1e-6)
    assert (chart.spacing == chart.spacing[0]).all()
    assert (chart.uv.min(axis=0).tolist(), chart.uv.max(axis=0).tolist()) == ([0.0, -0.125], [1.0, 1.125])


def test_rays_go_out_around_a_line_and_over_its_end():
    points = np.array([[-2.0, 10.0, 100.0], [4.0, 18.0, 200.0], [0.0, 12.0, 150.0]])
    origins, rays, uv = wrap._rays(points)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1.0)
    np.testing.assert_allclose(origins[:, :2], [[1.0, 14.0]] * len(origins))  # in the middle
    z = origins[:, 2].reshape(-1, wrap.AROUND)
    assert (z == z[:, :1]).all() and z[0, 0] == pytest.approx(112.0) and z[-1, 0] == pytest.approx(178.0)
    along = uv[:, 0].reshape(-1, wrap.AROUND)[:, 0]
    straight, turning = slice(0, wrap.STATIONS), slice(wrap.STATIONS, None)
    np.testing.assert_allclose(z[straight, 0], np.linspace(112.0, 178.0, wrap.STATIONS))
    np.testing.assert_allclose(z[turning, 0], 178.0)
    np.testing.assert_allclose(along, np.linspace(0, 1, wrap.STATIONS + wrap.FAN))
    by_row = rays.reshape(len(along), wrap.AROUND, 3)
    # from below over the subject's right, the top and the left
    for v, way in ((0.0, [0, -1, 0]), (0.25, [-1, 0, 0]), (0.5, [0, 1, 0]), (0.75, [1, 0, 0]), (1.0, [0, -1, 0])):
        column = int(np.argmin(np.abs(uv[: wrap.AROUND, 1] - v)))
        assert uv[column, 1] == pytest.approx(v, abs=1e-9)
        np.testing.assert_allclose(by_row[straight, column], [way] * wrap.STATIONS, atol=1e-12)
        # then they turn by equal steps until all look ahead, 45 degrees down
        turns = by_row[wrap.STATIONS - 1 :, column]
        if way[0]:
            rise = turns[:, 0] * way[0]
            np.testing.assert_allclose(rise, np.cos(np.linspace(0, np.pi / 2, wrap.FAN + 1)), atol=1e-12)
    np.testing.assert_allclose(by_row[-1], [[0.0, -np.sqrt(0.5), np.sqrt(0.5)]] * wrap.AROUND, atol=1e-12)


def test_rays_that_lie_in_one_plane_turn_evenly_within_it():
    _, rays, uv = wrap._rays(np.array([[-1.0, -1, 0], [1.0, 1, 10]]))
    middle = rays.reshape(-1, wrap.AROUND, 3)[:, wrap.AROUND // 2]  # over the top: from up to down ahead
    assert uv[wrap.AROUND // 2, 1] == pytest.approx(0.5)
    angle = np.degrees(np.arctan2(middle[wrap.STATIONS - 1 :, 1], middle[wrap.STATIONS - 1 :, 2]))
    np.testing.assert_allclose(angle, np.linspace(90.0, -45.0, wrap.FAN + 1), atol=1e-9)


@pytest.mark.slow
def test_triangles_and_squares_are_wrapped_alike():
    mesh, islands = body()
    split = [Island(i.vertex, i.uv, np.vstack([np.column_stack([i.faces[:, [0, 1, 2]], 0 * i.faces[:, 0] - 1]),
                                               np.column_stack([i.faces[:, [0, 2, 3]], 0 * i.faces[:, 0] - 1])]))
             for i in islands]  # fmt: skip
    whole, cut = wrap_chart(mesh, islands), wrap_chart(mesh, split)
    np.testing.assert_allclose(cut.mix @ mesh.vertices, whole.mix @ mesh.vertices, atol=1e-6)
    for by in (7, 300):  # whichever face comes first
        turned = [Island(i.vertex, i.uv, np.roll(i.faces, by, axis=0)) for i in islands]
        np.testing.assert_array_equal(wrap_chart(mesh, turned).weight, whole.weight)


def test_vertices_that_lie_inside_the_skin_or_behind_its_beginning_are_inner() -> None:
    """A groove below: its two walls and its bottom are vertices that no skin around the tongue reaches."""
    mesh, islands = body()
    outer = wrap_chart(mesh, islands).inner
    assert np.all(mesh.vertices[outer][:, 2] < 35.0 + 60.0 * wrap.ROOT), "of a convex one, its root alone"
    sheet = np.array([[-4.0, -45.0, 60.0], [4.0, -45.0, 60.0], [4.0, -45.0, 70.0], [-4.0, -45.0, 70.0]])
    n = len(mesh.vertices)
    own = Island(np.arange(n, n + 4), np.zeros((4, 2)), np.array([[0, 1, 2, 3]]))
    more = FitMesh(np.concatenate([mesh.vertices, sheet]), np.concatenate([mesh.faces, [[n, n + 1, n + 2, n + 3]]]),
                   mesh.uv, np.zeros((len(mesh.faces) + 1, 4), int), (), np.zeros((0, n + 4, 3)))  # fmt: skip
    inner = wrap_chart(more, [*islands, own]).inner
    assert set(inner) == {*outer, n, n + 1, n + 2, n + 3}
