"""Islands of unknown meshes: overlap taken apart, turned upright, true to scale."""

from dataclasses import replace

import numpy as np
from meshfiles import remapped
from slit_sheet import SIZE_MM, slit_sheet

from surface.fit.source.chart import TILE
from surface.fit.source.islands import Island, boundary_loops, find_islands
from surface.fit.source.layout import OPEN, lay_out, open_flat_holes, separate, signed_areas


def mirrored_halves():
    """The right half of the sheet lies on the left one in (u, v)."""
    mesh = slit_sheet()
    return replace(mesh, uv=np.column_stack([np.abs(mesh.uv[:, 0] - 0.5), mesh.uv[:, 1]]))


def test_mirrored_halves_become_two_islands_that_share_the_middle():
    mesh = mirrored_halves()
    (island,) = find_islands(mesh)
    one, two = separate(island)
    assert len(one.faces) == len(two.faces) and len(one.faces) + len(two.faces) == len(mesh.faces)
    assert (signed_areas(one) > 0).all() != (signed_areas(two) > 0).all()
    shared = np.intersect1d(one.vertex, two.vertex)
    np.testing.assert_allclose(mesh.vertices[shared, 0], 0, atol=1e-9)


def test_a_small_fold_stays_where_it_is():
    mesh = slit_sheet()
    uv = mesh.uv.copy()
    uv[60] += [0.12, 0.0]  # past its neighbour
    (island,) = find_islands(replace(mesh, uv=uv))
    assert (signed_areas(island) < 0).any()
    assert [len(i.faces) for i in separate(island)] == [len(mesh.faces)]


def test_islands_stand_upright_and_true_to_scale_however_they_were_unwrapped():
    mesh = slit_sheet()
    right = (mesh.vertices[mesh.faces].mean(axis=1)[:, 0] > 40).astype(int)

    def place(k, uv):
        c, s = np.cos(2.0 - 3 * k), np.sin(2.0 - 3 * k)
        turned = uv @ np.array([[c, -s], [s, c]]).T * (0.1 if k else 3.0)
        return turned * ([-1.0, 0.4] if k else [1.0, 0.4])

    islands = lay_out(mesh, find_islands(remapped(mesh, right, place)))
    for k, island in enumerate(islands):
        assert island.uv[:, 0].min() >= TILE * k - 1e-9 and island.uv[:, 0].max() <= TILE * k + 1 + 1e-9
        assert signed_areas(island).sum() > 0
        points = mesh.vertices[island.vertex][:, :2]
        system = np.column_stack([island.uv, np.ones(len(island.uv))])
        slope = np.linalg.lstsq(system, points, rcond=None)[0][:2]
        largest = 1.0 / SIZE_MM
        np.testing.assert_allclose(slope * largest, np.eye(2), atol=0.25)


def test_a_sheet_without_height_keeps_its_direction():
    mesh = slit_sheet()
    flat = replace(mesh, vertices=mesh.vertices[:, [0, 2, 1]] * [1, 0, 1])
    (island,) = lay_out(flat, find_islands(flat))
    np.testing.assert_allclose(np.ptp(island.uv, axis=0), [1, 1], atol=0.05)


def test_slits_lie_along_u_on_a_lopsided_mesh():
    mesh = slit_sheet()
    decimated = mesh.vertices + np.column_stack(
        [0.15 * mesh.vertices[:, 1], 0 * mesh.uv[:, 0], 0.3 * mesh.vertices[:, 0]]
    )
    c, s = np.cos(0.8), np.sin(0.8)
    turned = replace(mesh, vertices=decimated, uv=mesh.uv @ np.array([[c, -s], [s, c]]).T)
    (island,) = lay_out(turned, find_islands(turned))
    slit = island.uv[boundary_loops(island)[1]]
    assert np.ptp(slit[:, 1]) < 0.2 * np.ptp(slit[:, 0])
    edge = np.linalg.svd(slit - slit.mean(axis=0))[2][0]
    assert abs(edge[1] / edge[0]) < 1e-6


def flat_island() -> Island:
    island = find_islands(slit_sheet())[0]
    x = island.uv[:, 1] - 0.52
    return Island(island.vertex, np.column_stack([island.uv[:, 0], 0.52 + 0.3 * x + 0.7 * x * np.abs(x)]), island.faces)


def test_the_hole_gets_higher_and_its_sides_stay_straight():
    before, after = flat_island(), open_flat_holes(flat_island())
    loop = boundary_loops(before)[1]
    height, opened = np.ptp(before.uv[loop][:, 1]), np.ptp(after.uv[loop][:, 1])
    assert opened > 1.5 * height
    rows = after.uv[loop][before.uv[loop][:, 1] > 0.52][:, 1]
    assert np.ptp(rows) < 1e-12


def test_no_face_is_turned_over():
    island = open_flat_holes(flat_island())
    a, b, c, d = (island.uv[island.faces[:, k]] for k in range(4))

    def cross(p, q):
        return p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]

    assert cross(c - a, d - b).min() > 0


def test_a_chart_without_flat_holes_is_left_alone():
    island = find_islands(slit_sheet())[0]
    tall = Island(island.vertex, island.uv * [1.0, 1.0 / OPEN * 4], island.faces)
    np.testing.assert_array_equal(open_flat_holes(tall).uv, tall.uv)
