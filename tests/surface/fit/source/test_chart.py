"""Charts: samples, folds, slits, tiles."""

import numpy as np
import pytest
from slit_sheet import ROW, SIZE_MM, SLIT, N, slit_sheet

from surface.fit.points.refine import FitRequest, fit_chart
from surface.fit.source import chart as chart_module
from surface.fit.source.chart import TILE, face_slopes, join_slopes, make_chart, slit_of
from surface.fit.source.islands import Island, find_islands
from surface.fit.source.mesh import FitMesh, face_areas


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


@pytest.mark.parametrize("triangles", [False, True])
def test_turns_go_from_a_face_to_the_mean_of_the_faces_around_each_corner(triangles):
    """Of a quadratic function that is the change of its derivative, where faces lie evenly around a corner."""
    faces = MESH.faces
    if triangles:
        faces = np.vstack([np.pad(faces[:, c], ((0, 0), (0, 1)), constant_values=-1) for c in ([0, 1, 2], [0, 2, 3])])
    mesh = FitMesh(MESH.vertices, faces, MESH.uv, faces.copy(), MESH.names, MESH.deltas)
    (island,) = find_islands(mesh)
    s = face_slopes(island, len(mesh.vertices), np.ones(len(island.uv)))
    assert s.turn_u.shape == (4 * len(faces), len(mesh.vertices))
    linear = mesh.uv @ [3.0, -2.0]
    assert max(np.abs(t @ linear).max() for t in (s.turn_u, s.turn_v)) < 1e-6
    square = 50.0 * mesh.uv[:, 0] ** 2
    turn = (s.turn_u @ square).reshape(-1, 4)
    inside = ((s.corners > 1.5 / N) & (s.corners < 1 - 1.5 / N)).all(axis=2)
    inside &= np.linalg.norm(s.corners - [0.5, 0.5], axis=2) > 0.25
    wanted = 100.0 * (s.corners[..., 0] - s.uv[:, None, 0]) * s.span[:, :1]
    if not triangles:
        np.testing.assert_allclose(turn[inside], wanted[inside], rtol=1e-6, atol=1e-9)
    slope = s.mix_u @ square / s.span[:, 0]
    for f in range(0, len(faces), 61):
        for k, corner in enumerate(faces[f]):
            around = slope[(faces == corner).any(axis=1)] if corner >= 0 else slope[[f]]
            assert turn[f, k] == pytest.approx((around.mean() - slope[f]) * s.span[f, 0], abs=1e-6)
    assert np.abs(turn[inside]).max() > 0.05


def test_faces_count_for_a_turn_by_their_weight_and_area():
    weight = np.ones(len(ISLAND.uv))
    weight[ISLAND.uv[:, 0] < 0.5] = 1e-6
    s = face_slopes(ISLAND, len(MESH.vertices), weight)
    square = 50.0 * MESH.uv[:, 0] ** 2
    corner = int(np.argmin(np.abs(MESH.uv - [0.5, 0.2]).sum(axis=1)))  # faces on its left hardly count
    rows = np.argwhere(MESH.faces == corner)
    slope = s.mix_u @ square / s.span[:, 0]
    right = slope[rows[:, 0]].max()
    for f, k in rows:
        assert (s.turn_u @ square)[4 * f + k] == pytest.approx((right - slope[f]) * s.span[f, 0], abs=1e-3)


def test_joined_slopes_stand_one_after_the_other():
    one = face_slopes(ISLAND, len(MESH.vertices), np.ones(len(ISLAND.uv)))
    two = join_slopes([one, one])
    assert two.mix_u.shape == (2 * one.mix_u.shape[0], one.mix_u.shape[1])
    np.testing.assert_array_equal(two.uv[len(one.uv) :], one.uv)
    assert two.turn_u.shape == (8 * len(one.uv), len(MESH.vertices))
    assert abs(two.turn_v[4 * len(one.uv) :] - one.turn_v).max() == 0 and abs(one.turn_v).max() > 0


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
    s = face_slopes(island, len(mesh.vertices), np.ones(len(island.uv)), downweight_slivers=True)
    assert s.weight[-2] < 1e-3  # the sliver; half a square that is left has 1 - r^2 = 3/4
    np.testing.assert_allclose(s.weight[-1], 0.75, atol=1e-6)
    np.testing.assert_allclose(np.median(s.weight), 1.0, atol=1e-6)


@pytest.mark.parametrize("squeezed", [[0.0, 1.0], [1.0, 0.0], [0.0, 0.0]])
def test_faces_without_extent_in_uv_have_finite_slopes(squeezed):
    flat = Island(ISLAND.vertex, ISLAND.uv * squeezed, ISLAND.faces)
    s = face_slopes(flat, len(MESH.vertices), np.ones(len(flat.uv)), downweight_slivers=True)
    assert s.weight.min() >= 0 and s.weight.max() <= 1
    assert np.isfinite(s.mix_u.data).all() and np.isfinite(s.mix_v.data).all()


def test_a_sliver_in_uv_raises_no_spike():
    mesh = sliver_sheet()
    worst = []
    for doubt in (True, False):
        chart = make_chart(mesh, find_islands(mesh), normalise=False, downweight_slivers=doubt)
        worst.append(fit_chart(mesh, chart, FitRequest(200, coarse=0.2, astray_mm=np.inf)).error.max())
    assert worst[0] < 1.0 < 3.0 < worst[1]


def apart(stretches: list[float]) -> FitMesh:
    """Unit squares of (u, v) without a common corner; each is so many times as long and wide in space."""
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    vertices = np.vstack([square * s + [20.0 * k, 0, 0] for k, s in enumerate(stretches)])
    uv = np.vstack([square[:, :2] + [2.0 * k, 0] for k in range(len(stretches))])
    faces = np.arange(len(vertices)).reshape(-1, 4)
    return FitMesh(vertices, faces, uv, faces, (), np.zeros((0, len(vertices), 3)))


def test_a_fold_begins_at_four_and_a_half_times_the_usual_stretch_and_is_full_at_seven() -> None:
    stretches = [2.0] * 9 + [8.9, 9.1, 10.0, 11.5, 13.9, 14.1, 40.0]  # the median is 2
    mesh = apart(stretches)
    island = Island(np.arange(len(mesh.uv)), mesh.uv, mesh.faces)
    fold = chart_module._fold(mesh, island).reshape(-1, 4)
    wanted = np.clip((np.array(stretches) - 9.0) / 5.0, 0.0, 1.0)
    np.testing.assert_allclose(fold, np.tile(wanted[:, None], (1, 4)), atol=1e-9)
    weights = chart_module._fold_weight(wanted)
    np.testing.assert_allclose(weights, 1.0 - 0.95 * wanted)


def test_a_corner_lies_as_deep_as_its_faces_do_on_average() -> None:
    """Triangles and a square around one corner, which have 1, 49 and 25 times their areas of (u, v)."""
    mesh = apart([1.0] * 9 + [7.0, 5.0])
    uv, vertices, faces = mesh.uv.copy(), mesh.vertices, mesh.faces.copy()
    faces[9:, 0] = faces[8, 0]  # their first corner is that of the ninth
    faces[9, 3] = -1
    island = Island(np.arange(len(uv)), uv, faces)
    fold = chart_module._fold(mesh, island)
    areas3, areas2 = face_areas(vertices, faces), face_areas(np.pad(uv, ((0, 0), (0, 1))), faces)
    stretch = np.sqrt(areas3 / areas2)
    depth = np.clip((stretch / np.median(stretch) - 4.5) / 2.5, 0, 1)
    assert fold[faces[8, 0]] == pytest.approx(depth[8:].mean())
    assert fold[faces[9, 1]] == pytest.approx(depth[9]) and fold[faces[10, 3]] == pytest.approx(depth[10])


@pytest.mark.parametrize("mirrored", [False, True])
def test_an_island_fills_its_tile_and_runs_anticlockwise(mirrored: bool) -> None:
    lean = np.array([[3.0, 5.0], [7.0, 5.5], [4.0, 7.0], [8.0, 6.5]]) * ([-1.0, 1.0] if mirrored else [1.0, 1.0])
    island = Island(np.arange(4), lean, np.array([[0, 1, 2, -1], [1, 3, 2, -1]]))
    for k in (0, 3):
        placed = chart_module.in_tile(island, k)
        assert placed.uv.min(axis=0).tolist() == [TILE * k, 0.0]
        assert np.ptp(placed.uv, axis=0).max() == pytest.approx(1.0)
        factor = -5.0 if mirrored else 5.0
        np.testing.assert_allclose((placed.uv[1:] - placed.uv[0]) * [factor, 5.0], lean[1:] - lean[0])
    point = Island(np.arange(3), np.ones((3, 2)), np.array([[0, 1, 2, -1]]))
    assert np.isfinite(chart_module.in_tile(point, 0).uv).all()


def test_samples_know_the_longest_step_of_the_mesh_around_them() -> None:
    uv = np.array([[0.0, 0.0], [1.0, 0.1], [1.2, 3.0], [0.0, 0.5], [5.0, 0.0]])
    island = Island(np.arange(5), uv, np.array([[0, 1, 2, 3], [1, 4, 2, -1]]))
    np.testing.assert_allclose(
        chart_module._spacing(island), [[1.0, 0.5], [4.0, 2.9], [3.8, 3.0], [1.2, 2.5], [4.0, 3.0]]
    )


@pytest.mark.parametrize(("height", "slit"), [(0.0, True), (1.39, True), (1.41, False), (3.0, False)])
def test_a_hole_lower_than_seven_tenths_of_its_width_is_a_slit(height: float, slit: bool) -> None:
    hole = np.array([[1.0, 4.0], [2.0, 4.0 - height / 2], [3.0, 4.1], [2.2, 4.0 + height / 2]])
    found = slit_of(np.where(height == 0.0, hole * [1, 0] + [0, 4.0], hole))
    assert (found is not None) == slit
    if found is not None:
        assert (found.v, found.start, found.end) == (pytest.approx(4.0), 1.0, 3.0)


@pytest.mark.parametrize(("width", "slit"), [(0.0, False), (1e-7, False), (1e-3, True)])
def test_a_hole_whose_corners_share_one_place_is_no_slit(width: float, slit: bool) -> None:
    """As where a small face at a pole is missing: there is nothing to cut, and no length to divide by."""
    rim = np.array([[2.0, 0.2], [2.0 + width, 0.2], [2.0 + 0.5 * width, 0.2]])
    assert (slit_of(rim) is not None) is slit


def test_the_hole_next_to_an_eye_is_its_own() -> None:
    mesh = slit_sheet()
    chart = make_chart(mesh, find_islands(mesh), normalise=False)
    middles = [mesh.vertices[ids].mean(axis=0) for ids in chart.loop_vertices]
    for k, middle in enumerate(middles):
        assert chart.hole_near(mesh.vertices, middle + np.array([0.0, 0.0, 3.0])) == k
    moved = mesh.vertices * [1.0, 1.0, -1.0] + [50.0, 0.0, 0.0]  # of the vertices that are given
    assert chart.hole_near(moved, middles[1] * [1.0, 1.0, -1.0] + [50.0, 0.0, 0.0]) == 1


def test_border_samples_weigh_eight_times_as_much() -> None:
    mesh = slit_sheet()
    chart = make_chart(mesh, find_islands(mesh), normalise=False)
    rows = (N + 1) ** 2
    border = np.zeros(len(chart.uv), bool)
    border[:rows] = np.isin(np.arange(rows), np.concatenate(chart.loop_vertices))
    border[rows + len(mesh.faces) :] = True
    clear = ~chart.folded
    np.testing.assert_allclose(chart.weight[border & clear] / chart.weight[~border & clear].max(), 8.0)
    ends = chart.uv[rows + len(mesh.faces) :]
    halves = np.concatenate([0.5 * (loop + np.roll(loop, -1, axis=0)) for loop in chart.loops])
    np.testing.assert_allclose(ends, halves)


def test_faces_without_area_are_no_folds_and_do_not_count_in_the_median() -> None:
    for stretches in ([0.0] * 4, [0.0] * 9 + [2.0, 2.0, 11.5]):
        mesh = apart(stretches)
        fold = chart_module._fold(mesh, Island(np.arange(len(mesh.uv)), mesh.uv, mesh.faces)).reshape(-1, 4)
        np.testing.assert_allclose(fold[:, 0], 0.5 * (np.array(stretches) == 11.5), atol=1e-9)


def test_a_rim_without_extent_in_uv_is_no_hole() -> None:
    corner = np.arange(16).reshape(4, 4)
    faces = np.stack([corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]], axis=-1).reshape(-1, 4)
    x, y = np.meshgrid(np.arange(4.0), np.arange(4.0), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()])
    holed = faces[np.arange(9) != 4]  # without the one in the middle
    inner = np.abs(points[:, :2] - 1.5).max(axis=1, keepdims=True) < 1
    for squeezed, loops in ((points, 2), (np.where(inner, 1.5, points), 1)):
        mesh = FitMesh(100 * points, holed, squeezed[:, :2] / 3, holed.copy(), (), np.zeros((0, 16, 3)))
        chart = make_chart(mesh, find_islands(mesh), normalise=False)
        assert len(chart.loops) == len(chart.loop_vertices) == loops
