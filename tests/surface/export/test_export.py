"""Heads for other programs: structure of the GLB, names, shapes, the way back, OBJ, and what is refused."""

import json
import os
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from small_head import part, small_head

import surface
from surface.base.errors import ExportError
from surface.export import API, SUFFIXES, Exporter, export_head, exporters
from surface.fit.source.load import load_mesh
from surface.head import Head
from surface.readers.gltf.mesh import read_gltf
from surface.readers.obj import read_obj

WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}
SIZES = {5121: 1, 5125: 4, 5126: 4}


@pytest.fixture
def head() -> Head:
    return Head(small_head())


def chunks(path) -> tuple[dict, bytes]:
    raw = path.read_bytes()
    magic, version, length = struct.unpack_from("<III", raw)
    assert (magic, version, length) == (0x46546C67, 2, len(raw))
    size, kind = struct.unpack_from("<II", raw, 12)
    assert kind == 0x4E4F534A and size % 4 == 0
    size2, kind2 = struct.unpack_from("<II", raw, 20 + size)
    assert kind2 == 0x004E4942 and 28 + size + size2 == len(raw)
    return json.loads(raw[20 : 20 + size]), raw[28 + size :]


def test_the_container_is_whole_and_every_accessor_stays_inside(tmp_path, head):
    (path,) = export_head(head, tmp_path / "h.glb")
    document, data = chunks(path)
    assert document["buffers"] == [{"byteLength": len(data)}]
    for view in document["bufferViews"]:
        assert view["byteOffset"] % 4 == 0 and view["byteOffset"] + view["byteLength"] <= len(data)
    for a in document["accessors"]:
        each = WIDTHS[a["type"]] * SIZES[a["componentType"]]
        if "bufferView" in a:
            assert a["count"] * each == document["bufferViews"][a["bufferView"]]["byteLength"]
        if "sparse" in a:
            values = document["bufferViews"][a["sparse"]["values"]["bufferView"]]
            assert a["sparse"]["count"] * each == values["byteLength"] and "target" not in values
    for mesh in document["meshes"]:
        (primitive,) = mesh["primitives"]
        for attributes in (primitive["attributes"], *primitive.get("targets", [])):
            assert {"min", "max"} <= set(document["accessors"][attributes["POSITION"]])
        names = mesh.get("extras", {}).get("targetNames", [])
        assert len(names) == len(primitive.get("targets", [])) == len(mesh.get("weights", []))


def test_parts_materials_and_names_are_kept(tmp_path, head):
    (path,) = export_head(head, tmp_path / "h.glb")
    document, _ = chunks(path)
    assert [m["name"] for m in document["meshes"]] == ["a", "b", "tooth"]
    assert document["nodes"][0]["children"] == [1, 2, 3]
    targets = {m["name"]: m.get("extras", {}).get("targetNames") for m in document["meshes"]}
    assert targets["a"] == ["mouthPucker"] and targets["tooth"] == ["jawForward", "jawOpen"]
    assert {m["name"] for m in document["materials"]} == {"skin", "skin_painted"}
    assert "COLOR_0" in document["meshes"][0]["primitives"][0]["attributes"]


def test_what_is_read_back_is_what_the_head_shows(tmp_path, head):
    (path,) = export_head(head, tmp_path / "h.glb")
    back = read_gltf(path)
    rest = np.concatenate([p.vertices for p in head.parts])
    np.testing.assert_allclose(1000 * back.vertices.min(axis=0), rest.min(axis=0), atol=1e-3)
    for name in ("mouthPucker", "jawOpen"):
        head.pose(head.values({name: 1.0}))
        moved = np.concatenate([p.vertices for p in head.parts])
        got = 1000 * (back.vertices + back.deltas[back.names.index(name)])
        distance = np.linalg.norm(got[:, None] - moved[None], axis=2).min(axis=1)
        assert distance.max() < 0.005
    assert load_mesh(path).named.left_out == ()


def test_eyeballs_turn_about_their_own_node(tmp_path):
    ball = part("eye_left", 20, "left_eye")
    (path,) = export_head(Head(small_head(parts=[part("a", -40), ball], seams=[])), tmp_path / "h.glb")
    document, _ = chunks(path)
    node = document["nodes"][2]
    np.testing.assert_allclose(node["translation"], [0.03, 0.03, 0.0], atol=1e-7)
    names = document["meshes"][1]["extras"]["targetNames"]
    assert set(names) == {f"eyeLook{d}Left" for d in ("Up", "Down", "In", "Out")}
    np.testing.assert_allclose(1000 * read_gltf(path).vertices[:, 0].max(), 60, atol=1e-3)


def test_a_pose_becomes_weights(tmp_path, head):
    (path,) = export_head(head, tmp_path / "h.glb", {"mouthPucker": 0.5})
    assert chunks(path)[0]["meshes"][0]["weights"] == [0.5]
    with pytest.raises(ExportError, match="headYaw: angles are no morph targets"):
        export_head(head, tmp_path / "i.glb", {"headYaw": 0.5})
    assert not (tmp_path / "i.glb").exists()


def test_the_head_rests_afterwards(tmp_path, head):
    before = [p.vertices.copy() for p in head.parts]
    export_head(head, tmp_path / "h.glb", {"jawOpen": 1.0})
    for p, rest in zip(head.parts, before, strict=True):
        np.testing.assert_allclose(p.vertices, rest, atol=1e-5)


def test_obj_and_its_shapes(tmp_path, head):
    written = export_head(head, tmp_path / "h.obj")
    assert [p.name for p in written] == ["h.obj", "h.mtl", "h_shapes"]
    back = read_obj(tmp_path / "h.obj")
    assert set(back.names) == {"mouthPucker", "jawForward", "jawOpen"}
    assert back.pieces == ("a/skin", "b/skin", "tooth/skin")
    np.testing.assert_allclose(back.vertices, np.concatenate([p.vertices for p in head.parts]), atol=1e-4)
    pucker = back.deltas[back.names.index("mouthPucker")]
    assert pucker[:, 2].max() > 2 and np.abs(pucker[:, :2]).max() < 0.2
    assert list(tmp_path.glob(".*")) == []


def test_a_posed_obj_has_no_shapes(tmp_path, head):
    export_head(head, tmp_path / "h.obj")
    written = export_head(head, tmp_path / "p.obj", {"headYaw": 0.5})
    assert [p.name for p in written] == ["p.obj", "p.mtl"]
    turned, rest = (read_obj(tmp_path / name).vertices for name in ("p.obj", "h.obj"))
    assert np.abs(turned - rest).max() > 1.0


def test_other_suffixes_and_places_are_refused(tmp_path, head):
    with pytest.raises(ExportError, match=r"h\.fbx: is neither"):
        export_head(head, tmp_path / "h.fbx")
    for name in ("h.glb", "h.obj"):
        with pytest.raises(ExportError, match=r"cannot be written \(No such file or directory\)$") as error:
            export_head(head, tmp_path / "none" / name)
        assert error.value.hint == f"mkdir -p {tmp_path / 'none'}"


MODULE = """
{needs}
from surface.export.exporter import Exporter


def write(head, path, pose):
    path.write_text(head.name)
    return [path]


EXPORTER = Exporter(api=1, kind="{kind}", title="a name", suffixes=(".{kind}",), write=write)
"""
USE = """
import sys
from pathlib import Path
from types import SimpleNamespace
from surface import export
from surface.base.errors import ExportError
print(export.SUFFIXES)
print(export.export_head(SimpleNamespace(name="small"), "h.txt")[0].read_text())
try:
    export.export_head(SimpleNamespace(name="small"), "h.fbx")
except ExportError as error:
    print(error)
"""


def test_a_module_dropped_into_the_folder_is_found_and_one_that_lacks_a_package_harms_nobody(tmp_path):
    source = Path(surface.__file__).parent
    shutil.copytree(source, tmp_path / "surface", ignore=shutil.ignore_patterns("__pycache__"))
    folder = tmp_path / "surface" / "export"
    (folder / "txt.py").write_text(MODULE.format(needs="", kind="txt"))
    (folder / "fbx.py").write_text(MODULE.format(needs="import no_such_package", kind="fbx"))
    env = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", USE], cwd=tmp_path, env=env, capture_output=True, text=True, check=True
    )
    suffixes, name, error = done.stdout.splitlines()
    assert suffixes == "('.glb', '.obj', '.txt', '.urdf')"
    assert name == "small"
    assert error == "h.fbx: is neither .glb, .obj, .txt nor .urdf; fbx needs no_such_package"


def test_exporters_from_outside_are_used_and_refused_where_they_cannot_be(tmp_path, head):
    def write(head, path, pose):
        path.write_text(str(dict(pose)))
        return [path]

    mine = Exporter(api=API, kind="txt", title="a pose", suffixes=(".txt", ".text"), write=write)
    (path,) = export_head(head, tmp_path / "h.TEXT", {"jawOpen": 0.5}, extra=[mine])
    assert path.read_text() == "{'jawOpen': 0.5}"
    assert exporters([mine])[-1] is mine
    assert len(exporters()) == len(SUFFIXES)
    with pytest.raises(ExportError, match="is neither"):
        export_head(head, tmp_path / "h.txt")
    with pytest.raises(ExportError, match=r"exporter 'other': \.glb is written by 'glb' already"):
        exporters([Exporter(api=API, kind="other", title="", suffixes=(".glb",), write=write)])
    with pytest.raises(ExportError, match=f"made for exporters of version {API + 1}, this omote has {API}") as caught:
        exporters([Exporter(api=API + 1, kind="other", title="", suffixes=(".x",), write=write)])
    assert caught.value.hint == "update omote"


VALIDATE = """
const bytes = new Uint8Array(require('fs').readFileSync(process.argv[1]));
require('gltf-validator').validateBytes(bytes).then(r => console.log(r.issues.numErrors, r.issues.numWarnings));
"""


def test_the_validator_of_khronos_finds_no_fault(tmp_path, head):
    node = shutil.which("node")
    if node is None or subprocess.run([node, "-e", "require('gltf-validator')"], capture_output=True).returncode:
        pytest.skip("needs node and its package gltf-validator (npm install gltf-validator, NODE_PATH)")
    (path,) = export_head(head, tmp_path / "h.glb")
    said = subprocess.run([node, "-e", VALIDATE, str(path)], capture_output=True, text=True, check=True)
    assert said.stdout.split() == ["0", "0"]


@pytest.mark.parametrize("name", ["h.glb", "h.obj"])
def test_a_full_disk_leaves_what_was_there(tmp_path, head, full_disk, name):
    (tmp_path / name).write_text("old")
    full_disk(2000)
    with pytest.raises(ExportError, match=r"cannot be written \(.*File too large"):
        export_head(head, tmp_path / name)
    full_disk(-1)
    assert [p.name for p in tmp_path.iterdir()] == [name] and (tmp_path / name).read_text() == "old"
