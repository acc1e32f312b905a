"""Reading meshes: units, and a clear refusal of everything that cannot be fitted."""

from dataclasses import replace

import numpy as np
import pytest
from slit_sheet import slit_sheet, write_npz

from surface.base.errors import FitError
from surface.fit.source import mesh as mesh_module
from surface.fit.source.load import load_mesh
from surface.fit.source.mesh import (
    FitMesh,
    check_manifold,
    components,
    directed_edges,
    face_areas,
    intersect,
    renumbered,
    triangles,
)
from surface.fit.source.placing.frame import find_frame


def refused(tmp_path, **other) -> FitError:
    path = write_npz(tmp_path / "m.npz", slit_sheet(), **other)
    with pytest.raises(FitError) as e:
        load_mesh(path)
    assert str(path) in str(e.value)
    return e.value


def test_a_mesh_comes_back_as_it_was_written(tmp_path):
    want = slit_sheet()
    got = load_mesh(write_npz(tmp_path / "m.npz", want)).mesh
    assert got.names == want.names
    np.testing.assert_array_equal(got.vertices, want.vertices)
    np.testing.assert_array_equal(got.deltas, want.deltas)


@pytest.mark.parametrize(("unit", "scale"), [(1.0, 1.0), (0.1, 10.0), (0.001, 1000.0)])
def test_units_are_told_by_height(unit, scale):
    assert find_frame(slit_sheet().vertices * unit, {}).scale == scale


def test_a_missing_file_says_so(tmp_path):
    with pytest.raises(FitError, match=r"nowhere\.npz: no such mesh file"):
        load_mesh(tmp_path / "nowhere.npz")


def test_a_file_cut_short_is_refused(tmp_path):
    path = write_npz(tmp_path / "m.npz", slit_sheet())
    path.write_bytes(path.read_bytes()[:2000])
    with pytest.raises(FitError, match="not a sound archive"):
        load_mesh(path)


def test_missing_uvs_name_the_key(tmp_path):
    assert "'uv' is missing" in str(refused(tmp_path, uv=None))


def test_faces_without_uvs_are_read(tmp_path):
    sheet = slit_sheet()
    for bare in ({"face_uv": np.full_like(sheet.faces, -1)}, {"uv": None, "face_uv": None}):
        loaded = load_mesh(write_npz(tmp_path / "m.npz", sheet, **bare))
        assert not mesh_module.is_mapped(loaded.mesh) and len(loaded.mesh.faces) == len(sheet.faces)


def test_damaged_texture_coordinates_are_none() -> None:
    mesh = wall()
    uv, face_uv = mesh.uv.copy(), mesh.face_uv.copy()
    uv[0, 1] = np.nan  # of the first face
    face_uv[1, 1] = -1
    bare = mesh_module.bare_where_damaged(replace(mesh, uv=uv, face_uv=face_uv))
    assert (bare.face_uv[:2] == -1).all() and np.array_equal(bare.face_uv[2], mesh.face_uv[2])
    mesh_module.check_mesh(bare, "m")
    for nowhere in (99, -(1 << 62)):
        face_uv[2, 0] = nowhere
        beyond = mesh_module.bare_where_damaged(replace(mesh, face_uv=face_uv))
        with pytest.raises(FitError, match=rf"face_uv\[2\] points at {nowhere}"):
            mesh_module.check_mesh(beyond, "m")


def test_no_faces_are_refused(tmp_path):
    none = np.zeros((0, 4), np.int64)
    assert "faces is empty" in str(refused(tmp_path, faces=none, face_uv=none))


def test_nan_in_the_neutral_face_names_the_vertex(tmp_path):
    bad = slit_sheet().vertices.copy()
    bad[17, 1] = np.nan
    assert "neutral[17] is not a finite number" in str(refused(tmp_path, neutral=bad))


def test_nan_in_a_shape_names_shape_and_vertex(tmp_path):
    bad = slit_sheet().deltas.copy()
    bad[1, 40, 2] = np.inf
    assert "shape 'mouthSmile_L', vertex 40" in str(refused(tmp_path, deltas=bad))


def test_shapes_of_another_mesh_are_refused(tmp_path):
    assert "deltas has shape (2, 600, 3), expected (2, 625, 3)" in str(
        refused(tmp_path, deltas=slit_sheet().deltas[:, :600])
    )


def test_an_index_out_of_range_is_refused(tmp_path):
    bad = slit_sheet().faces.copy()
    bad[3, 2] = 9999
    assert "faces[3] points at 9999" in str(refused(tmp_path, faces=bad))


def test_quads_are_cut_in_two_and_triangles_kept():
    faces = np.array([[0, 1, 2, 3], [4, 5, 6, -1]])
    assert {tuple(t) for t in triangles(faces).tolist()} == {(0, 1, 2), (0, 2, 3), (4, 5, 6)}


def flat(faces: list[list[int]], points: int = 9, **other) -> FitMesh:
    rows = np.array(faces)
    vertices = np.random.default_rng(0).random((points, 3))
    return FitMesh(vertices, rows, np.zeros((1, 2)), 0 * rows, (), np.zeros((0, points, 3)), **other)


def test_a_sheet_is_a_manifold_and_a_fan_of_three_faces_is_not():
    check_manifold(slit_sheet(), "m")
    with pytest.raises(FitError, match="m: all faces are without area"):
        check_manifold(flat(np.zeros((0, 4), int)), "m")
    check_manifold(flat([[0, 1, 2, -1], [2, 1, 3, -1], [3, 1, 4, 5]]), "m")
    with pytest.raises(FitError, match=r"m: not a manifold: the edge between vertices 1 and 2 belongs to 3 faces") as e:
        check_manifold(flat([[0, 1, 2, -1], [2, 1, 3, -1], [5, 6, 7, 8], [2, 1, 4, -1]]), "m")
    assert e.value.hint == "delete inner and doubled faces"


def test_neighbours_that_run_opposite_ways_are_named_with_their_object():
    twice = flat([[5, 6, 7, 8], [0, 1, 2, -1], [1, 2, 3, -1]], piece=np.array([0, 1, 1]), pieces=("hat", "face"))
    with pytest.raises(FitError, match=r"edge between vertices 1 and 2 of 'face' is run through twice") as e:
        check_manifold(twice, "m")
    assert e.value.hint == "make all faces look outwards"


def test_faces_are_renumbered_over_the_vertices_they_use():
    used, faces = renumbered(np.array([[7, 3, 9, -1], [9, 3, 5, 4]]))
    assert used.tolist() == [3, 4, 5, 7, 9] and faces.tolist() == [[3, 0, 4, -1], [4, 0, 2, 1]]
    used, faces = renumbered(np.array([[9, 3, 5, 4]]))
    assert used.tolist() == [3, 4, 5, 9] and faces.tolist() == [[3, 0, 2, 1]]


def test_areas_edges_and_components_of_faces():
    points = np.array([[0.0, 0, 0], [2, 0, 0], [2, 3, 0], [0, 3, 0], [0, 0, 4]])
    faces = np.array([[0, 1, 2, 3], [0, 1, 4, -1]])
    np.testing.assert_allclose(face_areas(points, faces), [6.0, 4.0])
    a, b = directed_edges(faces)
    edges = list(zip(a.tolist(), b.tolist(), strict=True))
    assert edges == [(0, 1), (1, 2), (2, 3), (3, 0), (0, 1), (1, 4), (4, 0)]
    label = components(np.array([0, 3]), np.array([1, 4]), 6)
    assert label[0] == label[1] != label[3] == label[4] and len(set(label.tolist())) == 4


def test_rays_meet_triangles_where_they_should():
    tri = np.array([[[0.0, 0, 5], [4, 0, 5], [0, 4, 5]], [[0.0, 0, 9], [4, 0, 9], [0, 4, 9]]])
    rays = np.array([[0.0, 0, 1], [0, 0, -1], [0.6, 0, 0.8]])
    distance, a, b = intersect(tri, np.array([1.0, 2.0, 0.0]), rays)
    np.testing.assert_allclose(distance[0], [5.0, 9.0])
    np.testing.assert_allclose((a[0], b[0]), [[0.25, 0.25], [0.5, 0.5]])
    assert np.isnan(distance[1:]).all()  # behind, and beside
    each, _, _ = intersect(tri, np.array([[1.0, 2, 0], [1, 2, 7], [0.2, 1, 8]]), rays)
    np.testing.assert_allclose(each, [[5.0, 9.0], [2.0, np.nan], [np.nan, 1.25]])


def wall() -> FitMesh:
    """A square and two triangles on the same plane, of two pieces."""
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0]]) * 50
    faces = np.array([[0, 1, 4, 3], [1, 2, 5, -1], [1, 5, 4, -1]])
    return FitMesh(vertices, faces, vertices[:, :2] / 100, faces.copy(), (), np.zeros((0, 6, 3)),
                   np.array([0, 0, 1]), ("left", "right"))  # fmt: skip


@pytest.mark.parametrize("key", ["faces", "face_uv"])
@pytest.mark.parametrize(
    ("face", "corner", "index", "named"),
    [(0, 3, 6, 6), (0, 0, 6, 6), (2, 1, 7, 7), (1, 3, -2, -2), (2, 0, -2, -2), (1, 2, -1, -1)],
)
def test_corners_point_at_what_is_there(key: str, face: int, corner: int, index: int, named: int) -> None:
    mesh = wall()
    mesh_module.check_mesh(mesh, "m")
    changed = getattr(mesh, key).copy()
    changed[face, corner] = index
    why = rf"m: {key}\[{face}\] points at {named}, but there are 6|other corners"
    with pytest.raises(FitError, match=why):
        mesh_module.check_mesh(replace(mesh, **{key: changed}), "m")


def test_an_edge_of_three_faces_is_named_with_the_piece_of_the_first() -> None:
    mesh = wall()
    mesh_module.check_manifold(mesh, "m")
    third = np.vstack([mesh.faces, [[5, 1, 3, -1]]])
    crowded = replace(mesh, faces=third, face_uv=third, piece=np.array([0, 0, 1, 1]))
    with pytest.raises(FitError, match=r"vertices \d and \d of 'left' belongs to 3 faces") as caught:
        mesh_module.check_manifold(crowded, "m")
    assert "between vertices 5 and 1" in str(caught.value) or "between vertices 1 and 5" in str(caught.value)
    turned = mesh.faces.copy()
    turned[2, :3] = turned[2, 2::-1]
    with pytest.raises(FitError, match=r"vertices \d and \d of '\w+' is run through twice"):
        mesh_module.check_manifold(replace(mesh, faces=turned), "m")


def test_rays_hit_triangles_where_they_cross_them() -> None:
    """Random rays and triangles: the place on the ray is the mix of the corners."""
    rng = np.random.default_rng(5)
    tri, origins, rays = rng.normal(size=(30, 3, 3)), rng.normal(size=(40, 3)), rng.normal(size=(40, 3))
    distance, a, b = mesh_module.intersect(tri, origins, rays)
    hits = 0
    for r in range(40):
        for t in range(30):
            system = np.column_stack([tri[t, 1] - tri[t, 0], tri[t, 2] - tri[t, 0], -rays[r]])
            u, v, d = np.linalg.solve(system, origins[r] - tri[t, 0])
            if min(u, v, d, 1 - u - v) > 1e-3:
                assert (a[r, t], b[r, t], distance[r, t]) == (pytest.approx(u), pytest.approx(v), pytest.approx(d))
                hits += 1
            elif min(u, v, d, 1 - u - v) < -1e-3:
                assert np.isnan(distance[r, t])
    assert hits > 20
    along = mesh_module.intersect(tri[:1], tri[:1, 0] - [[1.0, 0, 0]], (tri[0, 1] - tri[0, 0])[None])[0]
    assert np.isnan(along).all()  # within the plane, or beside it
    flat = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    for x, y, met in ((0.2, 0.2, True), (0.0, 0.0, True), (0.5, 0.5, True), (-0.01, 0.5, False), (0.51, 0.51, False)):
        found = mesh_module.intersect(flat, np.array([[x, y, 3.0]]), np.array([[0.0, 0, -1]]))[0]
        assert (found[0, 0] == 3.0) if met else np.isnan(found[0, 0])
    assert np.isnan(mesh_module.intersect(flat, np.array([[0.2, 0.2, 0.0]]), np.array([[0.0, 0, 1]]))[0]).all()
