"""OBJ meshes and folders of shapes."""

import numpy as np
import pytest
from meshfiles import write_obj
from slit_sheet import slit_sheet

from surface.base.errors import FitError
from surface.fit.source.load import LoadOptions, load_mesh
from surface.readers.obj import read_obj

CUBE_FACE = "v 0 0 0 1 0.5 0.2\nv 2 0 0\nv 2 2 0\nv 0 2 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"


def written(tmp_path, text: str, name: str = "m.obj"):
    path = tmp_path / name
    path.write_text(text)
    return path


def test_a_mesh_and_its_shapes_come_back(tmp_path):
    want = slit_sheet()
    path = write_obj(tmp_path / "head.obj", want, tmp_path / "head_shapes")
    got = load_mesh(path).mesh
    assert sorted(got.names) == sorted(want.names)
    np.testing.assert_array_equal(got.faces, want.faces)
    np.testing.assert_allclose(got.vertices, want.vertices, atol=1e-3)
    order = [got.names.index(n) for n in want.names]
    np.testing.assert_allclose(got.deltas[order], want.deltas, atol=2e-3)


def test_a_folder_with_neutral_among_the_shapes(tmp_path):
    folder = tmp_path / "scan"
    write_obj(tmp_path / "x.obj", slit_sheet(), folder)
    write_obj(folder / "Neutral.obj", slit_sheet())
    assert sorted(load_mesh(folder).mesh.names) == sorted(slit_sheet().names)


def test_shapes_elsewhere_are_found_where_told(tmp_path):
    path = write_obj(tmp_path / "m.obj", slit_sheet(), tmp_path / "targets")
    assert load_mesh(path).mesh.names == ()
    assert len(load_mesh(path, LoadOptions(shapes=tmp_path / "targets")).mesh.names) == 2


def test_corners_of_every_kind(tmp_path):
    faces = "o cheek\nf 1/1 2/2 3/3 4/4\nusemtl lip\nf 1/1/1 2/2/1 3/3/1\nf -4/-4 -3/-3 \\\n-2/-2\n"
    mesh = read_obj(written(tmp_path, CUBE_FACE + faces))
    assert mesh.faces.tolist() == [[0, 1, 2, 3], [0, 1, 2, -1], [0, 1, 2, -1]]
    assert mesh.face_uv.tolist() == mesh.faces.tolist()
    assert mesh.pieces == ("cheek", "cheek/lip") and mesh.piece.tolist() == [0, 1, 1]


def test_faces_without_texture_coordinates_have_none_though_others_do(tmp_path):
    mesh = read_obj(written(tmp_path, CUBE_FACE + "f 1 2 3\nf 1//1 2//1 3//1\nf 1/4 2/3 3/2\nf 1/1 2 3/3\n"))
    assert mesh.face_uv[:, :3].tolist() == [[-1, -1, -1], [-1, -1, -1], [3, 2, 1], [-1, -1, -1]]


def test_polygons_become_fans(tmp_path):
    mesh = read_obj(written(tmp_path, CUBE_FACE + "v 1 3 0\nvt 0.5 1\nf 1/1 2/2 3/3 5/5 4/4\n"))
    assert mesh.faces.tolist() == [[0, 1, 2, -1], [0, 2, 4, -1], [0, 4, 3, -1]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (CUBE_FACE + "f 1/1 2/2\n", "line 9: a face needs three corners"),
        (CUBE_FACE + "f 1/1 x/2 3/3\n", "line 9: 'x/2' is no corner"),
        (CUBE_FACE + "f 0/1 2/2 3/3\n", "line 9: corner 0/1 points before"),
        (CUBE_FACE + f"f 1/1 2/2 {10**30}/3\n", f"line 9: corner {10**30}/3 points beyond the last"),
        (CUBE_FACE + f"f 1/1 2/2 3/{10**30}\n", "line 9: corner .* points beyond the last"),
        (CUBE_FACE + "f -9/1 2/2 3/3\n", "line 9: corner -9/1 points before"),
        (CUBE_FACE + "f 1/1 2/2 9/3\n", r"faces\[0\] points at 8, but there are 4"),
        (CUBE_FACE + "f 1/1 2/2 3/9\n", r"face_uv\[0\] points at 8, but there are 4"),
        (CUBE_FACE, "faces is empty"),
        ("", "no line begins with v"),
        ("v 1 2\n", "line 1: v needs 3 numbers"),
        ("v 1 2 nan\n", "line 1: v number 0 is not a finite number"),
    ],
)
def test_a_wrong_line_is_named(tmp_path, text, message):
    with pytest.raises(FitError, match=message):
        load_mesh(written(tmp_path, text))


def test_a_shape_of_another_mesh_is_refused(tmp_path):
    path = write_obj(tmp_path / "m.obj", slit_sheet(), tmp_path / "m_shapes")
    short = tmp_path / "m_shapes" / "jawOpen.obj"
    short.write_text("\n".join(short.read_text().splitlines()[:-1]))
    with pytest.raises(FitError, match=r"jawOpen\.obj: 624 vertices, but .*m\.obj has 625"):
        load_mesh(path)


def test_folders_without_what_is_needed(tmp_path):
    with pytest.raises(FitError, match=r"holds no neutral\.obj"):
        load_mesh(tmp_path)
    path = write_obj(tmp_path / "m.obj", slit_sheet())
    with pytest.raises(FitError, match="no such folder of shapes"):
        load_mesh(path, LoadOptions(shapes=tmp_path / "none"))
    (tmp_path / "empty").mkdir()
    with pytest.raises(FitError, match=r"holds no \.obj shape"):
        load_mesh(path, LoadOptions(shapes=tmp_path / "empty"))


def test_vertices_have_colours_where_all_of_them_do(tmp_path):
    rows = ["v 0 0 0 0 0.5 1\n", "v 2 0 0 1 0.02 0\n", "v 2 2 0 0.5 0.5 0.5 9\n"]
    tail = "f 1 2 3\n"
    srgb = np.array([[0, 0.5, 1], [1, 0.02, 0], [0.5, 0.5, 0.5]])
    wanted = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(read_obj(written(tmp_path, "".join(rows) + tail)).colours, wanted)
    for row in ("v 2 2 0\n", "v 2 2 0 1 1\n", "v 2 2 0 1 1 1.01\n", "v 2 2 0 -0.01 1 1\n", "v 2 2 0 nan 1 1\n",
                "v 2 2 0 1 1 x\n", "v 2 2 0 1 1 1 1 1\n"):  # fmt: skip
        assert read_obj(written(tmp_path, "".join(rows[:2]) + row + tail)).colours is None, row


def test_corners_are_counted_from_the_last_vertex_up_to_the_first(tmp_path):
    mesh = read_obj(written(tmp_path, CUBE_FACE + "f -4/-4 -3/-3 -1/-1\nf 4/4 3/-4 1/1\n"))
    assert mesh.faces[:, :3].tolist() == [[0, 1, 3], [3, 2, 0]]
    assert mesh.face_uv[:, :3].tolist() == [[0, 1, 3], [3, 0, 0]]
    for corner in ("-5", "1/-5", "1/-6", "0"):
        with pytest.raises(FitError, match=f"corner {corner} points before the first vertex"):
            read_obj(written(tmp_path, CUBE_FACE + f"f {corner} 2 3\n"))
    with pytest.raises(FitError, match="line 9: a face needs three corners, not 2"):
        read_obj(written(tmp_path, CUBE_FACE + "f 1 2\n"))
    largest = read_obj(written(tmp_path, CUBE_FACE + f"f {2**31} 2 3\n"))
    assert largest.faces[0, 0] == 2**31 - 1
    with pytest.raises(FitError, match="points beyond the last vertex"):
        read_obj(written(tmp_path, CUBE_FACE + f"f {2**31 + 1} 2 3\n"))


def test_a_line_that_goes_on_counts_once_and_names_may_hold_spaces(tmp_path):
    text = CUBE_FACE + "g  the cheek \nusemtl skin 1\nf 1 2 \\\n3\no lip\nf 1 2 3\n"
    assert read_obj(written(tmp_path, text)).pieces == ("the cheek/skin 1", "lip/skin 1")
    assert read_obj(written(tmp_path, CUBE_FACE + "usemtl a\nf 1 2 3\n")).pieces == ("a",)
    assert read_obj(written(tmp_path, CUBE_FACE + "f 1 2 3\n")).pieces == ("",)
