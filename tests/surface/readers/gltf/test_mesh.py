"""glTF meshes: what is read, and a clear refusal of everything that is wrong."""

import base64
import json
from dataclasses import replace

import numpy as np
import pytest
from meshfiles import FLOAT, UINT, GlbBuilder, glb, triangulated
from scipy.spatial.transform import Rotation
from slit_sheet import slit_sheet

from surface.base.errors import FitError
from surface.fit.source.load import LoadOptions, load_mesh
from surface.readers.gltf import mesh as gltfmesh
from surface.readers.gltf.mesh import read_gltf


def write(tmp_path, builder: GlbBuilder, name: str = "m.glb"):
    path = tmp_path / name
    path.write_bytes(builder.bytes())
    return path


def refused(path) -> str:
    with pytest.raises(FitError) as e:
        load_mesh(path)
    assert str(path) in str(e.value) and e.value.hint
    return str(e.value)


def nearest(points: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    return np.argmin(np.linalg.norm(points[:, None] - wanted, axis=2), axis=0)


@pytest.mark.parametrize("sparse", [False, True])
def test_a_mesh_comes_back(tmp_path, sparse):
    want = slit_sheet()
    got = load_mesh(write(tmp_path, glb(want, sparse=sparse))).mesh
    at = nearest(got.vertices, want.vertices)
    assert got.names == want.names and len(got.vertices) == len(want.vertices)
    assert len(got.faces) == 2 * len(want.faces)
    np.testing.assert_allclose(got.vertices[at], want.vertices, atol=1e-4)
    np.testing.assert_allclose(got.deltas[:, at], want.deltas, atol=1e-4)
    np.testing.assert_allclose(np.sort(got.uv, axis=0), np.sort(want.uv, axis=0), atol=1e-6)


def test_twenty_thousand_nodes_are_too_many(tmp_path):
    builder = glb(slit_sheet())
    builder.document["nodes"] = [{"children": [i + 1]} for i in range(20_000)] + [{"mesh": 0}]
    assert "20001; 10000 are the most" in refused(write(tmp_path, builder))


def test_vertices_doubled_along_a_seam_are_one_again(tmp_path):
    mesh = slit_sheet()
    right = mesh.vertices[mesh.faces].mean(axis=1)[:, 0] > 0
    uv = np.vstack([mesh.uv, mesh.uv + np.array([2.0, 0.0])])
    cut = replace(mesh, uv=uv, face_uv=np.where(right[:, None], mesh.face_uv + len(mesh.uv), mesh.face_uv))
    path = write(tmp_path, glb(cut))
    assert len(read_gltf(path).vertices) == len(mesh.vertices)
    assert len(np.unique(read_gltf(path).face_uv)) > len(mesh.vertices)  # -1 and both sides of the seam


def test_lips_that_touch_but_move_apart_stay_two(tmp_path):
    quad = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    vertices = np.column_stack([np.vstack([quad, quad + np.array([0, 1])]), np.zeros(8)]) * 100
    faces = np.array([[0, 1, 2, 3], [4, 5, 6, 7]])
    drop = np.zeros((1, 8, 3))
    drop[0, :4, 1] = -5
    mesh = slit_sheet().__class__(vertices, faces, vertices[:, :2] / 300, faces, ("jawOpen",), drop)
    assert len(read_gltf(write(tmp_path, glb(mesh))).vertices) == 8
    still = replace(mesh, deltas=0 * drop)
    assert len(read_gltf(write(tmp_path, glb(still))).vertices) == 6


def test_nodes_move_turn_and_mirror_what_hangs_on_them(tmp_path):
    builder = glb(slit_sheet())
    half = float(np.sqrt(0.5))
    builder.document["nodes"] = [
        {"children": [1], "translation": [1.0, 0.0, 0.0]},
        {"mesh": 0, "rotation": [0.0, half, 0.0, half], "scale": [1.0, 1.0, -1.0]},
    ]
    got, plain = read_gltf(write(tmp_path, builder)), read_gltf(write(tmp_path, glb(slit_sheet()), "n.glb"))
    turn = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]) @ np.diag([1.0, 1, -1])
    np.testing.assert_allclose(got.vertices, plain.vertices @ turn.T + [1, 0, 0], atol=1e-6)
    np.testing.assert_allclose(got.deltas, plain.deltas @ turn.T, atol=1e-6)
    assert (got.faces[:, :3] == plain.faces[:, [0, 2, 1]]).all()


def test_a_skinned_mesh_stands_where_its_joints_are(tmp_path):
    builder = glb(slit_sheet())
    primitive = builder.document["meshes"][0]["primitives"][0]
    n = builder.document["accessors"][primitive["attributes"]["POSITION"]]["count"]
    weights = np.tile(np.float32([1, 0, 0, 0]), (n, 1))
    primitive["attributes"] |= {
        "JOINTS_0": builder.accessor(np.zeros((n, 4), np.uint8), 5121, "VEC4"),
        "WEIGHTS_0": builder.accessor(weights, FLOAT, "VEC4"),
    }
    bind = np.eye(4, dtype=np.float32)
    bind[3, :3] = [0, -1.5, 0]  # column by column
    builder.document["skins"] = [
        {"joints": [1], "inverseBindMatrices": builder.accessor(bind.reshape(1, 16), FLOAT, "MAT4")}
    ]
    builder.document["nodes"] = [
        {"mesh": 0, "skin": 0, "translation": [9.0, 9.0, 9.0]}, {"translation": [0.0, 1.75, 0.0]},
    ]  # fmt: skip
    builder.document["scenes"] = [{"nodes": [0, 1]}]
    got, plain = read_gltf(write(tmp_path, builder)), read_gltf(write(tmp_path, glb(slit_sheet()), "n.glb"))
    np.testing.assert_allclose(got.vertices, plain.vertices + np.array([0, 0.25, 0]), atol=1e-6)


def test_several_primitives_and_unnamed_shapes(tmp_path):
    builder = glb(slit_sheet(), names=False)
    first = builder.document["meshes"][0]["primitives"][0]
    builder.document["materials"] = [{"name": "skin"}, {"name": "lips"}]
    builder.document["meshes"][0]["primitives"] = [{**first, "material": 0}, {**first, "material": 1, "mode": 1}]
    builder.document["nodes"] = [{"mesh": 0, "name": "head"}]
    got = read_gltf(write(tmp_path, builder))
    assert got.names == ("target0", "target1") and got.pieces == ("head/skin",)


def test_quantised_and_interleaved_numbers(tmp_path):
    builder = GlbBuilder()
    points = np.array([[0, 0, 0], [255, 0, 0], [0, 255, 0]], np.uint8)
    row = np.zeros((3, 8), np.uint8)
    row[:, :3], row[:, 4:6] = points, [[0, 255], [255, 255], [0, 0]]
    view = builder.view(row)
    builder.document["bufferViews"][view]["byteStride"] = 8
    common = {"bufferView": view, "componentType": 5121, "count": 3, "normalized": True}
    builder.document["accessors"] = [{**common, "type": "VEC3"}, {**common, "type": "VEC2", "byteOffset": 4}]
    builder.document["meshes"] = [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}}]}]
    builder.document["extensionsRequired"] = ["KHR_mesh_quantization"]
    got = read_gltf(write(tmp_path, builder))
    np.testing.assert_allclose(got.vertices, [[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    np.testing.assert_allclose(got.uv, [[0, 0], [1, 0], [0, 1]])


@pytest.mark.parametrize(("mode", "wanted"), [(5, [[0, 1, 2], [1, 3, 2]]), (6, [[0, 1, 2], [0, 2, 3]])])
def test_strips_and_fans(tmp_path, mode, wanted):
    builder = GlbBuilder()
    points = np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])[[0, 1, 3, 2] if mode == 5 else [0, 1, 2, 3]]
    attributes = {"POSITION": builder.accessor(points, FLOAT, "VEC3"),
                  "TEXCOORD_0": builder.accessor(points[:, :2].copy(), FLOAT, "VEC2")}  # fmt: skip
    builder.document["meshes"] = [{"primitives": [{"attributes": attributes, "mode": mode}]}]
    assert read_gltf(write(tmp_path, builder)).faces[:, :3].tolist() == wanted


def test_text_files_with_buffers_inside_and_beside(tmp_path):
    builder = glb(slit_sheet())
    builder.bytes()
    inside = {**builder.document, "buffers": [{
        "byteLength": len(builder.data),
        "uri": "data:application/octet-stream;base64," + base64.b64encode(builder.data).decode(),
    }]}  # fmt: skip
    (tmp_path / "a.gltf").write_text(json.dumps(inside))
    (tmp_path / "my data.bin").write_bytes(builder.data)
    (tmp_path / "b.gltf").write_text(
        json.dumps({**inside, "buffers": [{"byteLength": len(builder.data), "uri": "my%20data.bin"}]})
    )
    a, b = (read_gltf(tmp_path / name) for name in ("a.gltf", "b.gltf"))
    np.testing.assert_array_equal(a.vertices, b.vertices)
    assert len(a.vertices) == len(slit_sheet().vertices)


@pytest.mark.parametrize("uri", ["../secret.bin", "/etc/hostname", "http://example.com/a.bin"])
def test_nothing_but_a_file_beside_is_opened(tmp_path, uri):
    builder = glb(slit_sheet())
    builder.bytes()
    path = tmp_path / "m.gltf"
    path.write_text(json.dumps({**builder.document, "buffers": [{"byteLength": 9, "uri": uri}]}))
    assert "is not beside the file" in refused(path)


def change(builder: GlbBuilder, key: str, index: int, **other) -> GlbBuilder:
    builder.document[key][index] |= other
    return builder


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda b: change(b, "accessors", 0, count=10**9), "says 1000000000 elements"),
        (lambda b: change(b, "accessors", 0, count=626), "do not fit into"),
        (lambda b: change(b, "accessors", 0, count=-1), "says -1 elements"),
        (lambda b: change(b, "accessors", 0, componentType=1), "componentType"),
        (lambda b: change(b, "accessors", 0, type="VEC2"), "which has not 3 numbers"),
        (lambda b: change(b, "accessors", 0, bufferView=99), r"points at bufferViews\[99\]"),
        (lambda b: change(b, "bufferViews", 0, byteLength=10**9), "it is cut short"),
        (lambda b: change(b, "bufferViews", 0, byteOffset=-4), "byteOffset: is -4"),
        (lambda b: change(b, "nodes", 0, mesh=5), r"points at meshes\[5\]"),
        (lambda b: change(b, "nodes", 0, children=[0]), "its own ancestor"),
        (lambda b: change(b, "nodes", 0, scale=[1, 1]), "needs 3 finite numbers"),
        (lambda b: change(b, "scenes", 0, nodes=[]), "holds no triangles"),
        (lambda b: b.document.update(extensionsRequired=["KHR_draco_mesh_compression"]), "KHR_draco"),
        (lambda b: b.document.update(asset={"version": "1.0"}), "asset.version"),
    ],
)
def test_damage_names_its_place(tmp_path, damage, message):
    builder = glb(slit_sheet())
    damage(builder)
    with pytest.raises(FitError, match=message):
        load_mesh(write(tmp_path, builder))


def test_nan_names_the_shape_and_the_vertex(tmp_path):
    mesh = slit_sheet()
    bad = mesh.deltas.copy()
    bad[1, 3, 0] = np.nan
    builder = glb(replace(triangulated(mesh), deltas=bad))
    assert "mouthSmile_L), element" in refused(write(tmp_path, builder))


def test_a_primitive_without_uvs_can_be_left_out(tmp_path):
    builder = glb(slit_sheet())
    builder.document["nodes"] = [{"children": [1, 2]}, {"mesh": 0, "name": "face"}, {"mesh": 1, "name": "Beard"}]
    points = builder.accessor(np.float32(np.eye(3)), FLOAT, "VEC3")
    builder.document["meshes"].append({"primitives": [{"attributes": {"POSITION": points}}]})
    path = write(tmp_path, builder)
    assert len(load_mesh(path, LoadOptions()).mesh.vertices) == len(slit_sheet().vertices) + 3
    assert len(load_mesh(path, LoadOptions(without=("beard",))).mesh.vertices) == len(slit_sheet().vertices)
    with pytest.raises(FitError, match=r"--without hair: .* holds face, Beard"):
        load_mesh(path, LoadOptions(without=("hair",)))


def test_an_index_beyond_the_vertices_is_named(tmp_path):
    builder = glb(slit_sheet())
    primitive = builder.document["meshes"][0]["primitives"][0]
    primitive["indices"] = builder.accessor(np.uint32([0, 1, 9999]), UINT, "SCALAR")
    assert "element 2: points at vertex 9999" in refused(write(tmp_path, builder))


def test_a_file_cut_short_anywhere_is_refused(tmp_path):
    whole = glb(slit_sheet()).bytes()
    path = tmp_path / "m.glb"
    for size in [0, 3, 11, 19, 50, 500, len(whole) // 2, len(whole) - 1]:
        path.write_bytes(whole[:size])
        refused(path)


def test_flipped_bits_give_one_kind_of_error(tmp_path):
    whole = bytearray(glb(slit_sheet(), sparse=True).bytes())
    rng, path, errors = np.random.default_rng(3), tmp_path / "m.glb", 0
    for _ in range(150):
        bad = bytearray(whole)
        for at in rng.integers(0, 3000 if rng.random() < 0.8 else len(bad), rng.integers(1, 4)):
            bad[at] ^= 1 << int(rng.integers(8))
        path.write_bytes(bad[: len(bad) if rng.random() < 0.8 else int(rng.integers(len(bad)))])
        try:
            load_mesh(path)
        except FitError:
            errors += 1
    assert errors > 50


def moved(tmp_path, **node) -> np.ndarray:
    """(3, 4): the matrix that a node applies."""
    builder = GlbBuilder()
    points = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    index = builder.accessor(np.uint32([0, 1, 2, 0, 1, 3]), UINT, "SCALAR")
    attributes = {"POSITION": builder.accessor(points, FLOAT, "VEC3")}
    builder.document["meshes"] = [{"primitives": [{"attributes": attributes, "indices": index}]}]
    builder.document["nodes"] = [{"mesh": 0, **node}]
    got = read_gltf(write(tmp_path, builder)).vertices
    return np.column_stack([*(got[1:] - got[0]), got[0]])


def test_any_rotation_and_scale_is_that_of_the_specification(tmp_path):
    rotation = Rotation.from_euler("xyz", [20, -35, 70], degrees=True)
    scale, shift = np.array([2.0, 3.0, 0.5]), [1.0, -2.0, 4.0]
    got = moved(tmp_path, rotation=rotation.as_quat().tolist(), scale=scale.tolist(), translation=shift)
    np.testing.assert_allclose(got, np.column_stack([rotation.as_matrix() * scale, shift]), atol=1e-6)
    whole = np.eye(4)
    whole[:3] = np.column_stack([rotation.as_matrix() * scale, shift])
    np.testing.assert_allclose(moved(tmp_path, matrix=whole.T.ravel().tolist()), whole[:3], atol=1e-6)


@pytest.mark.parametrize(
    ("node", "why"),
    [
        ({"matrix": [1.0] * 15}, "matrix: needs 16 finite numbers"),
        ({"rotation": [0, 0, "x", 1]}, "rotation: holds something that is not a number"),
        ({"translation": [0, 0]}, "translation: needs 3 finite numbers"),
        ({"scale": 3}, "scale: '3' is no list"),
    ],
)
def test_wrong_matrices_are_refused(tmp_path, node, why):
    with pytest.raises(FitError, match=rf"nodes\[0\]\.{why}"):
        moved(tmp_path, **node)


def test_without_scenes_all_roots_are_read_in_order(tmp_path):
    builder = glb(slit_sheet())
    del builder.document["scenes"], builder.document["scene"]
    builder.document["nodes"] = [
        {"mesh": 0, "name": "child", "translation": [0, 5, 0]}, {"children": [0, 2], "name": "root"},
        {"mesh": 0, "name": "second", "translation": [0, 9, 0]}, {"mesh": 0, "name": "last"},
    ]  # fmt: skip
    assert read_gltf(write(tmp_path, builder)).pieces == ("child", "second", "last")


def test_shapes_of_several_primitives_are_joined_by_name(tmp_path):
    builder = glb(slit_sheet())
    first = builder.document["meshes"][0]["primitives"][0]
    other = {**first, "targets": first["targets"][::-1]}
    builder.document["meshes"].append({"primitives": [other], "extras": {"targetNames": ["x", slit_sheet().names[0]]}})
    builder.document["nodes"] = [{"mesh": 0}, {"mesh": 1, "translation": [7.0, 0, 0]}]
    builder.document["scenes"] = [{"nodes": [0, 1]}]
    got = read_gltf(write(tmp_path, builder))
    assert got.names == (*slit_sheet().names, "x") and set(got.piece) == {0, 1}
    far = got.vertices[:, 0] > 3
    assert np.abs(got.deltas[2, ~far]).max() == 0 < np.abs(got.deltas[2, far]).max()
    assert np.abs(got.deltas[1, far]).max() == 0 < np.abs(got.deltas[1, ~far]).max()
    np.testing.assert_allclose(np.sort(got.deltas[0, far], axis=0), np.sort(got.deltas[0, ~far], axis=0), atol=1e-7)


def test_skin_weights_blend_joints_and_need_not_sum_to_one(tmp_path):
    builder = GlbBuilder()
    points = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    attributes = {
        "POSITION": builder.accessor(points, FLOAT, "VEC3"),
        "JOINTS_0": builder.accessor(np.tile(np.uint8([0, 1, 0, 0]), (3, 1)), 5121, "VEC4"),
        "WEIGHTS_0": builder.accessor(np.float32([[2, 0, 0, 0], [0, 3, 0, 0], [1, 3, 0, 0]]), FLOAT, "VEC4"),
    }
    builder.document |= {
        "meshes": [{"primitives": [{"attributes": attributes}]}], "skins": [{"joints": [1, 2]}],
        "nodes": [{"mesh": 0, "skin": 0}, {"translation": [4.0, 0, 0]}, {"translation": [0, 8.0, 0]}],
        "scenes": [{"nodes": [0, 1, 2]}],
    }  # fmt: skip
    got = read_gltf(write(tmp_path, builder)).vertices
    np.testing.assert_allclose(got, points + np.array([[4, 0, 0], [0, 8, 0], [1, 6, 0]]), atol=1e-6)
    builder.document["skins"] = [{"joints": [1]}]
    assert "joints and weights do not fit" in refused(write(tmp_path, builder))
    builder.document["skins"] = [{"joints": [1, 9]}]
    assert "names a joint that is not in the scene" in refused(write(tmp_path, builder))


def only(tmp_path, points: np.ndarray, index: list[int] | None = None, **primitive) -> GlbBuilder:
    """One mesh of points with nothing else."""
    builder = GlbBuilder()
    if index is not None:
        primitive["indices"] = builder.accessor(np.uint32(index), UINT, "SCALAR")
    attributes = {"POSITION": builder.accessor(np.float32(points), FLOAT, "VEC3")}
    builder.document["meshes"] = [{"primitives": [{"attributes": attributes, **primitive}]}]
    builder.document["nodes"] = [{"mesh": 0, "name": "n"}]
    return builder


@pytest.mark.parametrize("count", [3, 4, 7, 8])
def test_strips_and_fans_of_any_length_face_one_way(tmp_path, count):
    """A zigzag as a strip, and an arc around its first point as a fan: every triangle counts, all anticlockwise."""
    k = np.arange(count)
    zigzag = np.column_stack([k, k % 2, 0 * k]) * [1.0, -1.0, 1.0]
    angle = np.linspace(0.1, 2.5, count - 1)
    arc = np.vstack([[0.0, 0, 0], np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])])
    for mode, points in ((5, zigzag), (6, arc)):
        got = read_gltf(write(tmp_path, only(tmp_path, points, mode=mode)))
        corners = got.vertices[got.faces[:, :3]]
        up = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
        assert len(corners) == count - 2 and ((up > 0).all() or (mode == 5 and (up < 0).all()))
        if mode == 5:
            wanted = [{i, i + 1, i + 2} for i in range(count - 2)]
        else:
            wanted = [{0, i + 1, i + 2} for i in range(count - 2)]
        at = nearest(points, got.vertices)
        assert [set(at[face].tolist()) for face in got.faces[:, :3]] == wanted
    assert up[0] > 0


@pytest.mark.parametrize(("indices", "faces"), [(3, 1), (4, 1), (5, 1), (6, 2)])
def test_indices_that_make_no_whole_triangle_are_left_out(tmp_path, indices, faces):
    points = np.random.default_rng(1).normal(size=(6, 3))
    assert len(read_gltf(write(tmp_path, only(tmp_path, points, list(range(indices))))).faces) == faces


def test_materials_name_pieces_where_there_are_such(tmp_path):
    for material, name in ((0, "n/skin"), (1, "n/1"), (2, "n"), (-1, "n"), ("0", "n")):
        builder = only(tmp_path, np.eye(3), material=material)
        builder.document["materials"] = [{"name": "skin"}, {}]
        assert read_gltf(write(tmp_path, builder)).pieces == (name,)


def test_vertices_without_a_weight_go_to_the_middle_not_to_nowhere(tmp_path):
    builder = GlbBuilder()
    attributes = {
        "POSITION": builder.accessor(np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), FLOAT, "VEC3"),
        "JOINTS_0": builder.accessor(np.zeros((3, 4), np.uint8), 5121, "VEC4"),
        "WEIGHTS_0": builder.accessor(np.float32([[1, 0, 0, 0], [1, 0, 0, 0], [0, 0, 0, 0]]), FLOAT, "VEC4"),
    }
    builder.document |= {
        "meshes": [{"primitives": [{"attributes": attributes}]}], "skins": [{"joints": [1]}],
        "nodes": [{"mesh": 0, "skin": 0}, {"translation": [4.0, 0, 0]}], "scenes": [{"nodes": [0, 1]}],
    }  # fmt: skip
    np.testing.assert_allclose(read_gltf(write(tmp_path, builder)).vertices, [[4, 0, 0], [5, 0, 0], [0, 0, 0]])


def test_triangles_have_area_where_their_corners_differ():
    rows = np.array([[0, 1, 2], [0, 0, 2], [0, 1, 1], [2, 1, 2], [3, 3, 3]])
    assert gltfmesh._has_area(rows).tolist() == [True, False, False, False, False]


def test_edges_of_more_than_two_triangles_or_two_in_one_direction_are_no_surface():
    for triangles, wanted in (
        ([[0, 1, 2], [1, 0, 3]], []),
        ([[0, 1, 2], [0, 1, 3]], [0, 1]),  # both run from 0 to 1
        ([[0, 1, 2], [1, 0, 3], [1, 0, 4]], [0, 1]),
        ([[0, 1, 2], [1, 0, 3], [0, 1, 1]], []),  # what has no area does not count
        ([[5, 6, 7], [0, 1, 2], [0, 1, 3], [6, 5, 4]], [0, 1]),
    ):
        assert gltfmesh._non_manifold(np.array(triangles), 8).tolist() == wanted, triangles


def test_only_vertices_of_borders_are_welded(tmp_path):
    """Two pyramids that touch with their tips: the tips are inside their sheets and stay two."""
    base = np.array([[1.0, 0, -1], [0, 1, -1], [-1, 0, -1], [0, -1, -1]])
    points = np.vstack([[0.0, 0, 0], base, [0.0, 0, 0], base * [1, 1, -1]])
    fan = [x for k in range(4) for x in (0, 1 + k, 1 + (k + 1) % 4)]
    other = [x for k in range(4) for x in (5, 6 + (k + 1) % 4, 6 + k)]
    got = read_gltf(write(tmp_path, only(tmp_path, points, fan + other)))
    assert len(got.vertices) == 10 and len(got.faces) == 8
    open_ = read_gltf(write(tmp_path, only(tmp_path, points, fan[:-3] + other[:-3])))
    assert len(open_.vertices) == 9  # with a gap in each, the tips are on the borders


@pytest.mark.parametrize(("gap", "count"), [(0.5e-6, 4), (2e-6, 6)])
def test_vertices_are_welded_up_to_a_millionth_of_the_mesh(tmp_path, gap, count):
    builder = GlbBuilder()
    far = np.float32(gap)
    points = np.float32([[0, 0, 0], [0, 1, 0], [1, 0, 0], [far, 0, 0], [far, 1, 0], [-0.0, -0.5, 0]])
    points = np.concatenate([points[:3], points[[3, 4]], [[-0.5, 0.5, 0]]]).astype(np.float32)
    index = builder.accessor(np.uint32([0, 2, 1, 3, 4, 5]), UINT, "SCALAR")
    attributes = {"POSITION": builder.accessor(points, FLOAT, "VEC3")}
    builder.document["meshes"] = [{"primitives": [{"attributes": attributes, "indices": index}]}]
    assert len(read_gltf(write(tmp_path, builder)).vertices) == count
