"""PLY meshes in all three forms: faces, strips, colours, textures; and what is no PLY file."""

import struct

import numpy as np
import pytest

from surface.base.errors import FitError
from surface.fit.source.mesh import triangles
from surface.readers.ply.mesh import read_ply

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 1]], float)
RGB = np.array([[255, 0, 0], [0, 128, 0], [0, 0, 64], [255, 255, 255], [0, 0, 0]])
FACES = [[0, 1, 2, 3], [1, 4, 2], [0, 1, 4, 2, 3]]
GRID = np.array([[x, y, 0] for y in (0, 1) for x in range(4)], float)  # two rows of four
STRIP = [0, 4, 1, 5, 2, 6, 3, 7]
PNG = b"\x89PNG\r\n\x1a\n"


def text_ply(points, faces, colours=None, comments=(), element="face", name="vertex_indices") -> str:
    head = ["ply", "format ascii 1.0", *(f"comment {c}" for c in comments), f"element vertex {len(points)}"]
    head += [f"property float {c}" for c in "xyz"]
    head += [f"property uchar {c}" for c in ("red", "green", "blue")] if colours is not None else []
    head += [f"element {element} {len(faces)}", f"property list uchar int {name}", "end_header"]
    rows = [[*p, *(() if colours is None else colours[k])] for k, p in enumerate(points)]
    rows += [[len(f), *f] for f in faces]
    return "\n".join([*head, *(" ".join(str(x) for x in row) for row in rows)]) + "\n"


def binary_ply(order, faces) -> bytes:
    mark, word = {"<": ("<", "little"), ">": (">", "big")}[order]
    head = f"ply\nformat binary_{word}_endian 1.0\nobj_info a scanner\nelement vertex 5\nproperty double x\n"
    head += "property double y\nproperty double z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
    head += f"element face {len(faces)}\nproperty uchar flags\nproperty list int uint vertex_index\nend_header\n"
    body = b"".join(struct.pack(f"{mark}3d3B", *p, *c) for p, c in zip(POINTS, RGB.tolist(), strict=True))
    body += b"".join(struct.pack(f"{mark}Bi{len(f)}I", 7, len(f), *f) for f in faces)
    return head.encode() + body


def area(mesh) -> np.ndarray:
    a, b, c = (mesh.vertices[triangles(mesh.faces)[:, k]] for k in range(3))
    return 0.5 * np.cross(b - a, c - a)


@pytest.mark.parametrize("form", ["text", "<", ">"])
@pytest.mark.parametrize("faces", [FACES, FACES[1:2] * 3])
def test_faces_and_colours_are_read_in_every_form(tmp_path, form, faces):
    path = tmp_path / "a.ply"
    data = text_ply(POINTS, faces, RGB.tolist()).encode() if form == "text" else binary_ply(form, faces)
    path.write_bytes(data)
    mesh = read_ply(path)
    np.testing.assert_array_equal(mesh.vertices, POINTS)
    np.testing.assert_allclose(mesh.colours[1], [0, 0.21586, 0], atol=1e-4)  # sRGB 128 of IEC 61966-2-1
    if faces is FACES:
        assert mesh.faces.tolist() == [[0, 1, 2, 3], [1, 4, 2, -1], [0, 1, 4, -1], [0, 4, 2, -1], [0, 2, 3, -1]]
    else:
        assert mesh.faces.tolist() == [[1, 4, 2, -1]] * 3


def test_strips_turn_every_second_triangle_and_end_at_minus_one(tmp_path):
    path = tmp_path / "a.ply"
    path.write_text(text_ply(GRID, [[*STRIP[:5], -1, *STRIP[4:]]], element="tristrips"))
    found = area(read_ply(path))
    assert len(found) == 5  # of six triangles of the whole strip, the one across the break is missing
    np.testing.assert_allclose(found, np.tile(found[0], (5, 1)))  # all look the same way
    path.write_text(text_ply(GRID, [STRIP, [0, 1, 1, 2]], element="tristrips"))
    assert len(area(read_ply(path))) == 6  # what has no area is left out; strips in rows of their own do not join


def test_textures_of_meshlab_and_of_vertices_are_read(tmp_path):
    (tmp_path / "skin.png").write_bytes(PNG)
    head = "ply\nformat ascii 1.0\ncomment TextureFile skin.png\nelement vertex 3\nproperty float x\nproperty float y\n"
    head += "property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
    points = "0 0 0\n1 0 0\n0 1 0\n"
    path = tmp_path / "a.ply"
    path.write_text(head + "property list uchar float texcoord\nend_header\n" + points + "3 0 1 2 6 0 0 0.5 0 0 0.25\n")
    mesh = read_ply(path)
    assert mesh.materials[0].mime == "image/png" and mesh.materials[0].texture == PNG
    np.testing.assert_allclose(mesh.uv[mesh.face_uv[0, :3]], [[0, 0], [0.5, 0], [0, 0.25]])
    text = head.replace("property float z\n", "property float z\nproperty float s\nproperty float t\n").replace(
        "TextureFile skin.png", "TextureFile ../skin.png"
    )
    path.write_text(text + "end_header\n0 0 0 0.1 0.2\n1 0 0 0.3 0.4\n0 1 0 0.5 0.6\n3 0 1 2\n")
    mesh = read_ply(path)
    assert not mesh.materials  # outside of its folder
    np.testing.assert_allclose(mesh.uv[mesh.face_uv[0, :3]], [[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]])


GOOD = text_ply(POINTS, FACES)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"solid x", "does not begin with ply"),
        (b"ply\nformat ascii 1.0\n", "no end_header"),
        (b"ply\nelement vertex 1\nend_header\n", "names no format"),
        (GOOD.replace("float z", "real z").encode(), "'property real z' is no line"),
        (GOOD.replace("uchar int", "float int").encode(), "'property list float int vertex_indices' is no line"),
        (GOOD.replace("uchar int", "uchar long").encode(), "'property list uchar long vertex_indices' is no line"),
        (GOOD.replace("float z", "float y").encode(), "'y' is out of place"),
        (GOOD.replace("float z", "float w").encode(), "no x, y and z"),
        (GOOD.replace("vertex 5", "vertex 99999999999").encode(), "cut short: it says 99999999999 rows"),
        (GOOD.replace("face 3", "face 4").encode(), "element face: the file is cut short"),
        (GOOD.replace("4 0 1 2 3", "4 0 1 two 3").encode(), "a word in it is no number"),
        (GOOD.replace("4 0 1 2 3", "4 0 1 1e300 3").encode(), "points at a vertex that is not there"),
        (GOOD.replace("4 0 1 2 3", "-4 0 1 2 3").encode(), "element face: the file is cut short"),
        (GOOD.replace("\n0.0 0.0 0.0", "\n0.0 nan 0.0").encode(), "vertex 0: is not a finite"),
        (binary_ply("<", FACES)[:-3], "element face: the file is cut short"),
        (binary_ply(">", FACES).replace(b"face 3", b"face 9"), "element face: the file is cut short"),
    ],
)
def test_what_is_no_ply_file_is_named(tmp_path, data, message):
    (tmp_path / "a.ply").write_bytes(data)
    with pytest.raises(FitError, match=message) as caught:
        read_ply(tmp_path / "a.ply")
    assert "a.ply" in str(caught.value) and caught.value.hint
