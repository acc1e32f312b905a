"""Islands of unknown meshes: overlap taken apart, turned upright, true to scale."""

from dataclasses import replace

import numpy as np
import pytest
from meshfiles import remapped
from slit_sheet import SIZE_MM, slit_sheet

from surface.fit.source import layout
from surface.fit.source.chart import TILE
from surface.fit.source.islands import Island, boundary_loops, find_islands
from surface.fit.source.layout import OPENED_ASPECT, lay_out, open_flat_holes, separate, signed_areas


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
    tall = Island(island.vertex, island.uv * [1.0, 1.0 / OPENED_ASPECT * 4], island.faces)
    np.testing.assert_array_equal(open_flat_holes(tall).uv, tall.uv)


def turned_head(angle: float):
    """The sheet and its (u, v) turned about the line of sight: its slit is tilted by the angle, rad."""
    mesh, (c, s) = slit_sheet(), (np.cos(angle), np.sin(angle))
    turn = np.array([[c, -s], [s, c]])
    vertices = np.column_stack([mesh.vertices[:, :2] @ turn.T, mesh.vertices[:, 2]])
    return replace(mesh, vertices=vertices, uv=mesh.uv @ turn.T)


def slit_tilt(island: Island) -> float:
    slit = island.uv[boundary_loops(island)[1]]
    along = np.linalg.svd(slit - slit.mean(axis=0))[2][0]
    return float(np.degrees(np.arctan(along[1] / along[0])))


@pytest.mark.parametrize(("tilt_deg", "wanted"), [(15, 0), (-15, 0), (19, 0), (23, 23), (-60, -60)])
def test_a_slit_that_is_tilted_a_little_is_levelled_and_one_tilted_more_is_none(tilt_deg: float, wanted: float) -> None:
    mesh = turned_head(np.radians(tilt_deg))
    (island,) = lay_out(mesh, find_islands(mesh))
    assert slit_tilt(island) == pytest.approx(wanted, abs=2.0)


def test_an_island_is_anticlockwise_and_up_is_up_however_it_was_mirrored_and_turned() -> None:
    mesh = slit_sheet()
    for factors in ((1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-2.0, -0.3)):
        (island,) = lay_out(mesh, find_islands(replace(mesh, uv=mesh.uv * factors)))
        x, y = (mesh.vertices[island.vertex][:, k] for k in (0, 1))
        assert np.corrcoef(island.uv[:, 0], x)[0, 1] > 0.999 and np.corrcoef(island.uv[:, 1], y)[0, 1] > 0.999
        np.testing.assert_allclose(island.uv.min(axis=0), 0.0, atol=1e-12)
        assert np.ptp(island.uv, axis=0).max() == pytest.approx(1.0)


def test_small_islands_get_a_tile_that_is_not_too_small() -> None:
    mesh = slit_sheet()
    middle = mesh.vertices[mesh.faces].mean(axis=1)
    for reach, size in ((15.0, 0.12), (75.0, 0.375)):
        small = ((middle[:, 0] > 99 - reach) & (middle[:, 1] > 99 - reach)).astype(int)
        islands = lay_out(mesh, find_islands(remapped(mesh, small, lambda k, uv: uv * (1.0, 7.0)[k])))
        largest, least = (float(np.ptp(island.uv, axis=0).max()) for island in islands)
        assert largest == pytest.approx(1.0)
        assert least == pytest.approx(size, rel=0.08)
        assert islands[1].uv[:, 0].min() == pytest.approx(TILE) and islands[1].uv[:, 1].min() == pytest.approx(0.0)


@pytest.mark.parametrize(("columns", "islands"), [(1, 2), (0.5, 1)])
def test_what_is_turned_over_is_an_island_of_its_own_from_three_hundredths_on(columns: float, islands: int) -> None:
    """A column of the sheet is 1/24 of it, half a column 1/48."""
    mesh = slit_sheet()
    rows = 24 if columns == 1 else 12
    middle = mesh.vertices[mesh.faces].mean(axis=1)
    over = (middle[:, 0] > 92) & (middle[:, 1] < -100 + rows * 200 / 24)
    uv = mesh.uv.copy()
    edge = (mesh.vertices[:, 0] > 99) & (mesh.vertices[:, 1] <= -100 + rows * 200 / 24 + 1e-6)
    uv[edge, 0] -= 2.0 / 24
    (island,) = find_islands(replace(mesh, uv=uv))
    parts = separate(island)
    assert over.sum() == rows
    assert len(parts) == islands and sum(len(part.faces) for part in parts) == len(mesh.faces)


def test_a_flat_hole_is_opened_to_four_tenths_of_its_width_and_what_is_far_stays() -> None:
    before, after = flat_island(), open_flat_holes(flat_island())
    np.testing.assert_array_equal(after.uv[:, 0], before.uv[:, 0])
    loop = boundary_loops(before)[1]
    (u0, v0), (u1, v1) = before.uv[loop].min(axis=0), before.uv[loop].max(axis=0)
    width, height = u1 - u0, v1 - v0
    assert np.ptp(after.uv[loop][:, 1]) == pytest.approx(0.4 * width, rel=0.03)
    shift = after.uv[:, 1] - before.uv[:, 1]
    outside = np.maximum(u0 - before.uv[:, 0], before.uv[:, 0] - u1) / width
    assert (shift[outside > 1.2] == 0.0).all() or not (outside > 1.2).any()
    v = before.uv[:, 1] - 0.5 * (v0 + v1)
    assert (np.sign(shift[outside < 0.9]) == np.sign(np.round(v[outside < 0.9], 9))).all()
    above = (outside <= 0.0) & (np.abs(v) > 0.3 * width)
    full = (0.4 * width / height - 1.0) * 2.0 * height * np.arctan(np.abs(v[above]) / (2.0 * height))
    np.testing.assert_allclose(np.abs(shift[above]), full * np.exp(-((v[above] / (2.0 * width)) ** 2)), rtol=1e-6)
    beside = (outside > 0.55) & (outside < 0.65)  # half of 1.2 widths: half of the shift
    for k in np.flatnonzero(beside):
        same = np.flatnonzero((np.abs(before.uv[:, 1] - before.uv[k, 1]) < 1e-9) & (outside <= 0.0))
        if abs(v[k]) > 0.3 * width:
            t = outside[k] / 1.2
            assert shift[k] == pytest.approx(shift[same[0]] * (1.0 - t * t * (3.0 - 2.0 * t)))


def mixed() -> Island:
    """A square, two triangles beside it and one more square: 0 1 4 3, 1 2 5, 1 5 4 and 3 4 7 6."""
    uv = np.array([[0.0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1], [0, 2], [1, 2]])
    return Island(np.arange(8), uv, np.array([[0, 1, 4, 3], [1, 2, 5, -1], [1, 5, 4, -1], [3, 4, 7, 6]]))


def test_neighbours_share_an_edge_whatever_their_corners() -> None:
    one, two = layout._neighbours(mixed())
    assert {tuple(sorted(pair)) for pair in zip(one.tolist(), two.tolist(), strict=True)} == {(0, 2), (1, 2), (0, 3)}
    assert len(one) == 3


def test_small_pieces_join_the_large_one_that_they_reach_first() -> None:
    chain = np.arange(6)  # faces 0 to 6 in a row
    label, large = np.array([0, 0, 1, 2, 3, 4, 4]), np.array([True, False, False, False, True])
    for one, two in ((chain, chain + 1), (chain + 1, chain), (chain[::-1], chain[::-1] + 1)):
        joined = layout._join_small(label, large, one, two)
        assert joined[:2].tolist() == [0, 0] and joined[5:].tolist() == [4, 4]
        assert joined[2] == 0 and joined[4] == 4 and joined[3] in (0, 4)
    apart = layout._join_small(np.array([0, 1]), np.array([True, False]), chain[:0], chain[:0])
    assert apart.tolist() == [0, 1]
    assert label.tolist() == [0, 0, 1, 2, 3, 4, 4]


def test_slopes_are_those_of_the_map_and_slivers_and_cliffs_do_not_count() -> None:
    grid = np.stack(np.meshgrid(np.arange(7.0), np.arange(3.0), indexing="ij"), axis=-1).reshape(-1, 2)
    at = np.arange(21).reshape(7, 3)
    faces = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], axis=-1).reshape(-1, 4)
    turn = np.array([[2.0, 0.5, -1.0], [0.0, 3.0, 1.0]])  # along u and along v
    mesh = slit_sheet().__class__(grid @ turn, faces, grid, faces, (), np.zeros((0, 21, 3)))
    slope, weight = layout._slopes(mesh, Island(np.arange(21), grid, faces))
    np.testing.assert_allclose(slope, np.tile(turn, (12, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(weight, 1.0)
    uv, steep = grid.copy(), mesh.vertices.copy()
    uv[0] = uv[1] + [0.99999, -1e-5]  # the first face is as good as a line
    steep[20] += [0.0, 0.0, 40.0]  # the last one, whose third corner it is, a cliff
    slope, weight = layout._slopes(replace(mesh, vertices=steep), Island(np.arange(21), uv, faces))
    assert weight[0] == 0.0 and not slope[0].any() and weight[11] == 0.0
    np.testing.assert_allclose(weight[1:11], 1.0)
    over = Island(np.arange(21), grid * [-1.0, 1.0], faces)  # clockwise: nothing to go by
    assert not layout._slopes(mesh, over)[1].any()


def test_several_flat_holes_are_levelled_by_their_length() -> None:
    """Two slits in one sheet, tilted by 10 and -5 degrees, three and one long: the sheet turns by 6.25."""
    ring = 10 * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    loops = [ring]
    for degrees, length, y in ((10.0, 3.0, 4.0), (-5.0, 1.0, -4.0)):
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        slit = 0.5 * length * np.array([[-1.0, -0.05], [1, -0.05], [1, 0.05], [-1, 0.05]])
        loops.append(slit @ np.array([[c, s], [-s, c]]) + [0.0, y])
    uv = np.vstack(loops)
    island = Island(np.arange(12), uv, np.zeros((0, 4), np.int64))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(layout, "boundary_loops", lambda _: [np.arange(4 * k, 4 * k + 4) for k in range(3)])
        turned = layout._levelled(island).uv
        angle = np.arctan2(*(turned[1] - turned[0])[::-1])
        assert np.degrees(angle) == pytest.approx(-6.25, abs=0.01)
        patch.setattr(layout, "boundary_loops", lambda _: [np.arange(4)])
        assert layout._levelled(island) is island
        tall = replace(island, uv=uv @ np.array([[0.0, 1.0], [-1.0, 0.0]]))  # upright holes are no slits
        patch.setattr(layout, "boundary_loops", lambda _: [np.arange(4 * k, 4 * k + 4) for k in range(3)])
        assert layout._levelled(tall) is tall
