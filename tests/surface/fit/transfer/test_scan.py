"""Reading of bare meshes, and samples of their surface."""

import numpy as np
import pytest

from surface.base.errors import FitError
from surface.fit.transfer.scan import _border_line, borders_of, make_scan, read_scan, sample, spread, vertex_normals

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
TWO = np.array([[0, 1, 2], [0, 2, 3]])


def write_obj(path, vertices, faces, names=()):
    lines = [f"v {x} {y} {z}" for x, y, z in vertices]
    for k, face in enumerate(faces):
        lines += [f"o {names[k]}"] if names else []
        lines += ["f " + " ".join(str(i + 1) for i in face)]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_vertices_in_one_place_become_one():
    loose = make_scan(SQUARE[TWO].reshape(-1, 3), np.arange(6).reshape(2, 3), "x")
    assert len(loose.vertices) == 4 and len(borders_of(loose)[0]) == 4
    np.testing.assert_allclose(loose.vertices[loose.original], SQUARE[TWO].reshape(-1, 3))


def test_samples_are_even_and_know_the_border():
    found = sample(make_scan(10 * SQUARE, TWO, "x"), 4000)
    counts = np.histogram2d(*found.points[:, :2].T, bins=4, range=[[0, 10], [0, 10]])[0]
    assert counts.min() > 0.7 * counts.mean()
    np.testing.assert_allclose(found.normals, np.tile([0, 0, 1], (4000, 1)), atol=1e-12)
    inside = np.abs(found.points[:, :2] - 5).max(axis=1)
    assert found.border[inside > 4.95].all() and not found.border[inside < 4].any()


def test_a_ply_file_is_read(tmp_path):
    path = tmp_path / "scan.ply"
    head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    head += "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    path.write_text(head + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n")
    assert len(read_scan(path).triangles) == 2


def test_an_obj_file_needs_no_texture_coordinates_and_objects_can_be_left_out(tmp_path):
    path = write_obj(tmp_path / "scan.obj", SQUARE, TWO, ["skin", "nose"])
    assert len(read_scan(path).triangles) == 2
    assert len(read_scan(path, ("NOSE",)).triangles) == 1
    with pytest.raises(FitError, match=r"--without hat.*skin, nose"):
        read_scan(path, ("hat",))


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.txt", "", "is no mesh"),
        ("a.ply", "ply\nformat ascii 1.0\nelement vertex 9\n", "damaged"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no faces"),
        ("a.obj", "v 2 2 2\nv 2 2 2\nv 2 2 2\nf 1 2 3\n", "in one place"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "without area"),
    ],
)
def test_what_is_no_scan_is_refused_by_name(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    with pytest.raises(FitError, match=message) as caught:
        read_scan(tmp_path / name)
    assert name in str(caught.value)


def test_a_missing_file_and_numbers_that_are_none():
    with pytest.raises(FitError, match="no such"):
        read_scan("nowhere.stl")
    with pytest.raises(FitError, match="vertex 1 is not a finite"):
        make_scan(np.array([[0, 0, 0], [np.nan, 0, 0], [1, 0, 0]]), TWO[:1], "x")
    with pytest.raises(FitError, match="vertex 2 is not a finite number of usable size"):
        make_scan(np.array([[0, 0, 0], [0, 1, 0], [1e7, 0, 0]]), TWO[:1], "x")
    with pytest.raises(FitError, match="not there"):
        make_scan(SQUARE, TWO + 2, "x")


def test_normals_that_are_no_numbers_are_passed_over_in_silence(tmp_path, caplog):
    facet = "facet normal 0 0 {}\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 {}\nendloop\nendfacet\n"
    path = tmp_path / "scan.stl"
    path.write_text("solid x\n" + facet.format("1", 0) + facet.format("one", 1) + "endsolid x\n")
    with caplog.at_level("DEBUG", logger="trimesh.util"):
        try:
            assert len(read_scan(path).triangles) in (1, 2)
        except FitError as error:
            assert "STL" in str(error)
    assert "Traceback" not in caplog.text and "normals" not in caplog.text


def test_what_a_person_wears_and_what_grows_on_the_skin_is_no_scan_and_is_said(tmp_path):
    names = ("body", "helper-hair", "joint-neck", "Wolf3D_Headwear", "Glasses", "Teeth", "Hair_cards", "EyeLeft")
    at = np.vstack([SQUARE[:3] + np.array([0, 0, k]) for k in range(len(names))])
    faces = np.arange(3 * len(names)).reshape(-1, 3)
    scan = read_scan(write_obj(tmp_path / "a.obj", at, faces, names))
    assert sorted(scan.vertices[scan.triangles][:, 0, 2]) == [0, 7]  # skin and eye
    told = " ".join(scan.notes)
    worn = ("Wolf3D_Headwear", "Glasses", "Hair_cards")
    assert [f"'{n}'" in told for n in names[1:-1]] == [n not in worn for n in names[1:-1]]
    assert scan.worn is not None and {scan.worn.pieces[k] for k in scan.worn.piece} == set(worn)
    assert "prop left out: 'helper-hair', 'joint-neck'" in scan.notes
    every = read_scan(write_obj(tmp_path / "b.obj", at[:3], faces[:1], ["Hat"]))
    assert (
        len(every.triangles) == 1 and not every.notes and every.worn is None
    )  # a name alone leaves nothing: it is not believed
    named = read_scan(tmp_path / "a.obj", ("body",))
    assert len(named.triangles) == 1


@pytest.mark.parametrize(("height", "kept"), [(1.5e-12, 2), (0.5e-12, 1)])
def test_triangles_without_area_are_left_out(height, kept):
    """Of a mesh of size 1: less than a millionth of it, squared."""
    at = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1.0, 0, height * 1e6], [1e-6, 0, 0]])
    base = make_scan(np.vstack([at[:3], [[0.0, 0, 0.5], [2e-6, 0, 0.5], [0, height / 2e-6, 0.5]]]),
                     np.array([[0, 1, 2], [3, 4, 5]]), "x")  # fmt: skip
    assert len(base.triangles) == kept


@pytest.mark.parametrize(("apart", "count"), [(0.4e-6, 3), (1.6e-6, 4)])
def test_vertices_a_millionth_of_the_size_apart_are_one(apart, count):
    at = 100.0 * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1.0 + apart, 0, 0]])
    scan = make_scan(at, np.array([[0, 1, 2], [0, 3, 2]]), "x")
    assert len(scan.vertices) == count and len(scan.original) == 4
    assert (scan.original[1] == scan.original[3]) == (count == 3)


def test_places_are_spread_by_area_one_in_each_equal_share():
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6]])
    at = np.vstack([SQUARE * [3.0, 1.0, 1.0], SQUARE[:3]])  # areas of 1.5, 1.5 and 0.5
    face, share = spread(at, faces, 70)
    assert np.bincount(face).tolist() == [30, 30, 10]
    assert (np.diff(face) >= 0).all() and (share >= 0).all()
    np.testing.assert_allclose(share.sum(axis=1), 1.0)
    np.testing.assert_allclose(share.mean(axis=0), 1 / 3, atol=0.1)
    again = spread(at, faces, 70)
    np.testing.assert_array_equal(again[1], share)


def test_the_border_is_walked_in_equal_steps():
    scan = make_scan(10 * SQUARE, TWO, "x")
    line = _border_line(scan, 2.5)
    assert len(line) == 16 and len(_border_line(scan, 2.6)) == 16 and len(_border_line(scan, 2.4)) == 20
    on_side = np.isclose(line[:, :2], 0.0) | np.isclose(line[:, :2], 10.0)
    assert on_side.any(axis=1).all()
    assert len(np.unique(np.round(line, 6), axis=0)) == 16 and set(np.unique(line[:, :2])) == {0.0, 2.5, 5.0, 7.5, 10.0}


def test_samples_within_one_and_a_half_spacings_lie_at_the_border():
    found = sample(make_scan(10 * SQUARE, TWO, "x"), 400)  # half a unit apart
    inside = 5.0 - np.abs(found.points[:, :2] - 5.0).max(axis=1)
    assert not found.border[inside > 0.75].any()
    assert found.border[inside < np.sqrt(0.75**2 - 0.375**2)].all()  # between two places of the line


def test_normals_are_means_by_area_and_a_scan_is_turned_with_its_vertices():
    at = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0], [0, 0, 4]])
    scan = make_scan(at, np.array([[0, 1, 2], [0, 2, 3]]), "x")
    order = [int(np.flatnonzero((scan.vertices == row).all(axis=1))[0]) for row in at]
    normals = vertex_normals(scan)[order]
    slant = np.array([8.0, 0, 4]) / np.sqrt(80)
    np.testing.assert_allclose(normals, [slant, [0, 0, 1], slant, [1, 0, 0]])
    turn = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    np.testing.assert_allclose(scan.turned(turn, 3.0, np.ones(3)).vertices, 3.0 * scan.vertices @ turn.T + 1.0)
    assert scan.kept(np.array([True, False])).triangles.tolist() == scan.triangles[:1].tolist()


def test_too_many_vertices_are_refused(monkeypatch):
    monkeypatch.setattr("surface.fit.transfer.scan.MAX_VERTICES", 4)
    assert len(make_scan(SQUARE, TWO, "x").triangles) == 2
    with pytest.raises(FitError, match="x: 5 vertices; 4 are the most"):
        make_scan(np.vstack([SQUARE, SQUARE[:1]]), TWO, "x")
    for faces in (TWO - 1, TWO + 1):
        with pytest.raises(FitError, match="a vertex that is not there"):
            make_scan(SQUARE, faces, "x")


def test_colours_of_eyes_are_apart_from_those_of_skin(tmp_path):
    """Skin that closes over an eye must not have the eye's colour."""
    path = tmp_path / "scan.obj"
    red, green = "0.8 0.2 0.2", "0.1 0.8 0.1"
    skin = [f"v {x} {y} 0 {red}" for x, y in ((0, 0), (100, 0), (0, 100))]
    eye = [f"v {x} {y} 5 {green}" for x, y in ((10, 10), (30, 10), (10, 30))]
    path.write_text("\n".join(["o Head", *skin, "f 1 2 3", "o EyeLeft", *eye, "f 4 5 6"]) + "\n")
    scan = read_scan(path)
    assert scan.colours is not None and scan.eye_colours is not None
    assert (scan.colours.colour[:, 0] > scan.colours.colour[:, 1]).all()
    assert (scan.eye_colours.colour[:, 0] < scan.eye_colours.colour[:, 1]).all()
