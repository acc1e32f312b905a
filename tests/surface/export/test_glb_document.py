"""surface.export.glb_document: a decoder of a few lines reads every number, target, material and texture."""

import io
import json
import struct
from dataclasses import replace

import numpy as np
import pytest
from shapes import hills
from small_head import all_points, part, small_head

from surface.export import export_head
from surface.export.glb_document import Document, asset, materials
from surface.export.shapes import export_parts
from surface.head import Head, OwnGroup
from surface.head.model.data import Group


class Decoded:
    """A .glb by the letter of the specification, for float and uint32 accessors."""

    def __init__(self, path) -> None:
        raw = path.read_bytes()
        size = struct.unpack_from("<I", raw, 12)[0]
        self.document, self.data = json.loads(raw[20 : 20 + size]), raw[28 + size :]

    def view(self, index: int, dtype: str) -> np.ndarray:
        view = self.document["bufferViews"][index]
        assert view["buffer"] == 0
        return np.frombuffer(self.data[view["byteOffset"] :][: view["byteLength"]], dtype)

    def accessor(self, index: int) -> np.ndarray:
        a = self.document["accessors"][index]
        dtype, width = {5126: "<f4", 5125: "<u4"}[a["componentType"]], {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[a["type"]]
        out = np.zeros((a["count"], width), dtype)
        if "bufferView" in a:
            out = self.view(a["bufferView"], dtype).reshape(-1, width).copy()
        if "sparse" in a:
            s = a["sparse"]
            assert s["indices"]["componentType"] == 5125
            ids = self.view(s["indices"]["bufferView"], "<u4")
            assert len(ids) == s["count"] and (np.diff(ids.astype(int)) > 0).all()
            out[ids] = self.view(s["values"]["bufferView"], dtype).reshape(-1, width)
        if "min" in a:
            assert a["min"] == out.min(axis=0).tolist() and a["max"] == out.max(axis=0).tolist()
        return out


def exported(tmp_path, head: Head, pose=None) -> Decoded:
    (path,) = export_head(head, tmp_path / "h.glb", pose)
    return Decoded(path)


def test_every_number_of_every_part_is_there_in_metres(tmp_path):
    head = Head(small_head())
    file = exported(tmp_path, head)
    for mesh, wanted in zip(file.document["meshes"], export_parts(head), strict=True):
        (primitive,) = mesh["primitives"]
        got = {key: file.accessor(index) for key, index in primitive["attributes"].items()}
        np.testing.assert_allclose(got["POSITION"], 0.001 * wanted.vertices, atol=1e-8)
        np.testing.assert_allclose(got["NORMAL"], wanted.normals, atol=1e-6)
        np.testing.assert_allclose(got["TEXCOORD_0"], wanted.uv * [1, -1] + [0, 1], atol=1e-7)
        assert ("COLOR_0" in got) == (wanted.colours is not None)
        if wanted.colours is not None:
            np.testing.assert_array_equal(got["COLOR_0"], wanted.colours)
        assert file.accessor(primitive["indices"]).reshape(-1, 3).tolist() == wanted.triangles.tolist()
        assert primitive["mode"] == 4
        targets = {"POSITION": wanted.displacements, "NORMAL": wanted.normal_changes}
        names = mesh.get("extras", {}).get("targetNames", [])
        assert names == list(wanted.displacements)
        for name, target in zip(names, primitive.get("targets", []), strict=True):
            for key, scale in (("POSITION", 0.001), ("NORMAL", 1.0)):
                np.testing.assert_allclose(file.accessor(target[key]), scale * targets[key][name], atol=1e-7)


def test_targets_are_sparse_where_less_than_half_moves(tmp_path):
    head = Head(small_head())
    file = exported(tmp_path, head)
    for mesh, wanted in zip(file.document["meshes"], export_parts(head), strict=True):
        for name, target in zip(wanted.displacements, mesh["primitives"][0].get("targets", []), strict=True):
            share = wanted.displacements[name].any(axis=1).mean()
            entry = file.document["accessors"][target["POSITION"]]
            assert ("sparse" in entry) == (share < 0.5) and ("bufferView" in entry) == (share >= 0.5)
            assert {"min", "max"} <= set(entry)
            assert "min" not in file.document["accessors"][target["NORMAL"]]


@pytest.mark.parametrize(("first", "sparse"), [(15, True), (60, False)])
def test_a_small_share_of_the_vertices_is_stored_as_such(tmp_path, first, sparse):
    """A fine sheet of which the points before ``first`` of 100 move."""
    surface = hills(10, 60.0)
    ku, kv = surface.padded
    ids = np.arange(first, dtype=np.int32)
    moved = [Group("mouthPucker", ids, np.tile(np.float32([0, 0, 5]), (len(ids), 1)))]
    fields = {"points": surface.points.copy(), "weights": surface.weights.copy(), "knots_u": ku, "knots_v": kv}
    fields |= {"degrees": np.stack(surface.degrees, axis=1), "jaw": np.zeros(100), "lids": np.zeros(100)}
    head = Head(small_head(parts=[replace(part("a", -40, groups=moved), **fields)], seams=[], paint=[]))
    file, (wanted,) = exported(tmp_path, head), export_parts(head)
    (target,) = file.document["meshes"][0]["primitives"][0]["targets"]
    share = wanted.displacements["mouthPucker"].any(axis=1).mean()
    assert 0.1 < share < 0.9 and (share < 0.5) == sparse
    entry = file.document["accessors"][target["POSITION"]]
    assert ("sparse" in entry) == sparse and entry["count"] == len(wanted.vertices)
    np.testing.assert_allclose(
        file.accessor(target["POSITION"]), 0.001 * wanted.displacements["mouthPucker"], atol=1e-8
    )


def test_a_normal_that_never_changes_is_a_whole_accessor_of_zeros(tmp_path):
    moved = [all_points("mouthPucker", (0, 0, 5))]
    file = exported(tmp_path, Head(small_head(parts=[part("a", -40, groups=moved)], seams=[])))
    (target,) = file.document["meshes"][0]["primitives"][0]["targets"]
    assert not file.accessor(target["NORMAL"]).any()
    assert "bufferView" in file.document["accessors"][target["NORMAL"]]


def test_views_of_vertices_and_indices_say_so_and_begin_at_multiples_of_four(tmp_path):
    file = exported(tmp_path, Head(small_head()))
    views, accessors = file.document["bufferViews"], file.document["accessors"]
    primitive = file.document["meshes"][0]["primitives"][0]
    assert {views[accessors[i]["bufferView"]]["target"] for i in primitive["attributes"].values()} == {34962}
    assert views[accessors[primitive["indices"]]["bufferView"]]["target"] == 34963
    assert all(view["byteOffset"] % 4 == 0 for view in views)
    ends = [view["byteOffset"] + view["byteLength"] for view in views]
    assert all(0 <= view["byteOffset"] - end < 4 for view, end in zip(views[1:], ends, strict=False))
    assert file.document["buffers"] == [{"byteLength": len(file.data)}] and len(file.data) % 4 == 0


def test_materials_are_those_of_the_table_once_each(tmp_path):
    file = exported(tmp_path, Head(small_head()))
    by_name = {m["name"]: m for m in file.document["materials"]}
    assert list(by_name) == ["skin_painted", "skin"]
    painted, plain = (m["pbrMetallicRoughness"] for m in by_name.values())
    assert painted["baseColorFactor"] == [1, 1, 1, 1] and plain["baseColorFactor"] == [0.60, 0.37, 0.28, 1.0]
    assert painted["roughnessFactor"] == plain["roughnessFactor"] == 0.55
    assert painted["metallicFactor"] == 0.0 and not by_name["skin"]["doubleSided"]
    used = [m["primitives"][0]["material"] for m in file.document["meshes"]]
    assert used == [0, 1, 1]
    assert "images" not in file.document and "baseColorTexture" not in plain


def made_of(material: str, *names: str) -> Head:
    parts = [part(name, 50 * k - 40) for k, name in enumerate(names)]
    for one in parts:
        object.__setattr__(one, "material", material)
    return Head(small_head(parts=parts, seams=[], paint=[]))


def test_eyes_share_one_texture_with_pupil_iris_and_white(tmp_path):
    image = pytest.importorskip("PIL.Image", reason="needs Pillow (extra view)")
    file = exported(tmp_path, made_of("eye", "l", "r"))
    (texture,), (picture,), (sampler,) = (file.document[key] for key in ("textures", "images", "samplers"))
    assert texture == {"source": 0, "sampler": 0} and picture["mimeType"] == "image/png"
    assert sampler == {"magFilter": 9729, "minFilter": 9729, "wrapS": 10497, "wrapT": 33071}
    (material,) = file.document["materials"]
    assert material["pbrMetallicRoughness"]["baseColorTexture"] == {"index": 0}
    pixels = np.asarray(image.open(io.BytesIO(file.view(picture["bufferView"], "u1").tobytes())))
    assert pixels.shape == (256, 4, 3) and (pixels == pixels[:, :1]).all()
    stops = materials()["eye_texture"]
    for stop in stops:
        row = int(np.clip(round((1.0 - stop["v"]) * 256 - 0.5), 0, 255))
        inside = [s["colour"] for s in stops if abs(s["v"] - stop["v"]) < 1e-9]
        if len(inside) == 1 and 0.0 < stop["v"] < 1.0:
            near = pixels[max(row - 1, 0) : row + 2, 0].astype(int)
            assert (near.min(axis=0) - 40 <= 255 * np.array(stop["colour"])).all()
            assert (near.max(axis=0) + 40 >= 255 * np.array(stop["colour"])).all()
    first, last = (min if end == 0 else max for end in (0, 1))
    top, bottom = (pick(stops, key=lambda s: s["v"])["colour"] for pick in (last, first))
    np.testing.assert_allclose(pixels[0, 0], 255 * np.array(top), atol=3)
    np.testing.assert_allclose(pixels[-1, 0], 255 * np.array(bottom), atol=3)


@pytest.mark.parametrize(("material", "two_sided"), [("mouth", True), ("teeth", False), ("velvet", False)])
def test_back_faces_and_materials_that_are_unknown(tmp_path, material, two_sided):
    (made,) = exported(tmp_path, made_of(material, "a")).document["materials"]
    assert made["name"] == material and made["doubleSided"] == two_sided
    table = materials().get(material, materials()["skin"])
    assert made["pbrMetallicRoughness"]["baseColorFactor"] == [*table["colour"], 1.0]


def test_the_source_of_the_head_is_named(tmp_path):
    plain = exported(tmp_path, Head(small_head())).document["asset"]
    assert plain == {"version": "2.0", "generator": "omote", "extras": {"made": "for tests"}}
    source = {"source_name": "CommandState", "year": 2020, "source_licence": "MIT"}
    asset = exported(tmp_path, Head(small_head(provenance=source))).document["asset"]
    assert asset["copyright"] == "CommandState; MIT" and asset["extras"]["year"] == "2020"


def test_the_document_is_a_scene_of_one_head_whose_parts_are_its_children(tmp_path):
    """glTF 2.0, 3.5: nodes by number; the head's own node is the first."""
    head = Head(small_head())
    document = exported(tmp_path, head).document
    names = [part.name for part in head.parts]
    assert document["asset"]["version"] == "2.0" and document["asset"]["generator"] == "omote"
    assert document["scene"] == 0 and document["scenes"] == [{"name": "small", "nodes": [0]}]
    assert document["nodes"][0] == {"name": "small", "children": [1, 2, 3]}
    assert [(node["name"], node["mesh"]) for node in document["nodes"][1:]] == list(zip(names, range(3), strict=True))
    assert [mesh["name"] for mesh in document["meshes"]] == names
    assert "images" not in document and "textures" not in document


def test_an_eye_stands_at_its_pivot_and_other_parts_at_none(tmp_path):
    parts = [part("a", -40), part("eye", 20, "left_eye")]
    head = Head(small_head(parts=parts, seams=[]))
    file = exported(tmp_path, head)
    skin, eye = file.document["nodes"][1:]
    assert "translation" not in skin
    np.testing.assert_allclose(eye["translation"], 0.001 * head.data.eyes[0], rtol=1e-6)
    local = file.accessor(file.document["meshes"][1]["primitives"][0]["attributes"]["POSITION"])
    np.testing.assert_allclose(1000 * local + head.data.eyes[0], head.parts[1].vertices, atol=1e-4)


@pytest.mark.parametrize(("extras", "more"), [({}, {}), ({"frame": "file"}, {"frame": "file"})])
def test_extras_are_the_provenance_and_what_is_added(extras, more):
    head = Head(small_head(provenance={"source_licence": "MIT"}))
    assert asset(head, extras)["extras"] == {"source_licence": "MIT", **more}
    assert asset(head, extras)["copyright"] == "MIT"
    assert "copyright" not in asset(Head(small_head()), extras)


def test_a_user_s_own_groups_have_the_weights_of_the_pose():
    group = OwnGroup("dimple", "a", np.array([3], np.int32), np.array([[0.0, 0.0, 2.0]], np.float32))
    head = Head(small_head())
    head.add_groups([group])
    for pose, weight in (({}, 0.0), ({"dimple": 0.75}, 0.75)):
        document = Document(head, export_parts(head), pose).content
        (mesh,) = [each for each in document["meshes"] if "dimple" in each.get("extras", {}).get("targetNames", ())]
        assert mesh["weights"][mesh["extras"]["targetNames"].index("dimple")] == pytest.approx(weight)


@pytest.mark.parametrize(("moved", "sparse"), [(0, False), (1, True), (4, True), (5, False), (10, False)])
def test_displacements_are_sparse_where_less_than_half_of_the_vertices_move(moved, sparse):
    document = Document(Head(small_head()), [], {})
    rows = np.zeros((10, 3), np.float32)
    rows[:moved] = [1.0, 2.0, 3.0]
    accessor = document.accessors[document._target(rows, bounds=True)]
    assert ("sparse" in accessor, "bufferView" in accessor) == (sparse, not sparse)
    assert accessor["count"] == 10 and accessor["max"] == rows.max(axis=0).tolist()
