"""surface.export.glb_web: decoded by the letter of the specification, without omote's reader."""

from __future__ import annotations

import gzip
import json
import shutil
import struct
import subprocess
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from small_head import all_points, part, small_head
from textured_head import textured

from surface.base.errors import ExportError
from surface.export import export_head, glb_web
from surface.export.glb_buffers import GlbBuffers
from surface.export.glb_web import lip_gaps, lips_open_at_rest, web_glb
from surface.export.shapes import export_parts
from surface.export.textures import eye_picture, png_bytes, strand_picture, strip_picture
from surface.export.web_parts import BREATH, BREATH_MM, MIN_MOVE_MM, web_parts
from surface.head import Head
from surface.head.model.data import Neck
from surface.head.model.own_groups import OwnGroup

TYPES = {5126: "<f4", 5125: "<u4", 5123: "<u2", 5122: "<i2", 5121: "u1", 5120: "i1"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Decoded:
    """A .glb with strides, sparse accessors and whole steps."""

    def __init__(self, raw: bytes) -> None:
        size = struct.unpack_from("<I", raw, 12)[0]
        self.document, self.data = json.loads(raw[20 : 20 + size]), raw[28 + size :]

    def accessor(self, index: int) -> np.ndarray:
        a = self.document["accessors"][index]
        dtype, width = np.dtype(TYPES[a["componentType"]]), WIDTHS[a["type"]]
        out = np.zeros((a["count"], width), dtype)
        if "bufferView" in a:
            out = self._rows(a["bufferView"], dtype, width, a["count"])
        if "sparse" in a:
            s = a["sparse"]
            ids = self._rows(s["indices"]["bufferView"], np.dtype(TYPES[s["indices"]["componentType"]]), 1, s["count"])
            out[ids[:, 0]] = self._rows(s["values"]["bufferView"], dtype, width, s["count"])
        if "min" in a:
            assert a["min"] == out.min(axis=0).tolist() and a["max"] == out.max(axis=0).tolist()
        return out

    def _rows(self, view: int, dtype: np.dtype, width: int, count: int) -> np.ndarray:
        entry = self.document["bufferViews"][view]
        stride = entry.get("byteStride", width * dtype.itemsize)
        data = self.data[entry["byteOffset"] :][: entry["byteLength"]]
        rows = [np.frombuffer(data, dtype, width, k * stride) for k in range(count)]
        return np.array(rows)


@pytest.fixture
def head() -> Head:
    eye = part("eye", 20, "left_eye")
    object.__setattr__(eye, "material", "eye")
    return Head(small_head(parts=[part("a", -40, groups=[all_points("mouthPucker", (0, 0, 5))]), eye], seams=[]))


def test_positions_and_moves_are_within_a_step_of_the_head(head):
    file = Decoded(web_glb(head))
    (skin,) = file.document["skins"]
    bind = file.accessor(skin["inverseBindMatrices"])[0].reshape(4, 4)
    own, eye = export_parts(head)
    assert [mesh["name"] for mesh in file.document["meshes"]] == [own.name, eye.name]
    (primitive,) = file.document["meshes"][0]["primitives"]
    steps = file.accessor(primitive["attributes"]["POSITION"]).astype(float)
    places = 1000.0 * (steps @ bind[:3, :3] + bind[3, :3])
    np.testing.assert_allclose(places, web_parts(head)[0].part.vertices, atol=1000 * bind[0, 0])
    (target,) = primitive["targets"]
    moves = 1000.0 * file.accessor(target["POSITION"]).astype(float) * bind[0, 0]
    np.testing.assert_allclose(moves, web_parts(head)[0].part.displacements["mouthPucker"], atol=MIN_MOVE_MM)
    normals = file.accessor(primitive["attributes"]["NORMAL"]) / 32767.0
    np.testing.assert_allclose(normals, web_parts(head)[0].part.normals, atol=3e-4)


def test_joints_follow_the_neck_and_weights_are_whole(head):
    file = Decoded(web_glb(head))
    attributes = file.document["meshes"][0]["primitives"][0]["attributes"]
    weights, joints = file.accessor(attributes["WEIGHTS_0"]), file.accessor(attributes["JOINTS_0"])
    assert (weights.astype(int).sum(axis=1) == 255).all()
    share = np.where(joints[:, 0] == 1, weights[:, 0], 0) / 255.0
    np.testing.assert_allclose(share, head.data.neck.share(web_parts(head)[0].part.vertices.astype(float)), atol=0.003)


def test_eyes_are_nodes_below_the_head_about_their_centres(head):
    nodes = {node["name"]: node for node in Decoded(web_glb(head)).document["nodes"]}
    assert len(nodes["head"]["children"]) == 1
    at = np.add(nodes["head"]["translation"], nodes["eye"]["translation"])
    np.testing.assert_allclose(at, 0.001 * head.data.eyes[0], atol=1e-9)


def test_an_iris_has_the_colour_that_is_painted_and_else_omotes_blue(head):
    eye = export_parts(head)[1]
    blue = eye_picture(eye)
    ring = blue[128, 128 + int(256 * 0.47 * 0.36)].astype(int)
    assert ring[2] > ring[0]
    eye.painted["iris"] = np.array([0.4, 0.1, 0.02], np.float32)
    brown = eye_picture(eye)[128, 128 + int(256 * 0.47 * 0.36)].astype(int)
    assert brown[0] > brown[2]
    assert eye_picture(eye)[128, 128].max() < 40, "the pupil"


def test_the_document_says_how_eyes_are_drawn_that_have_no_picture_of_their_own(tmp_path, head) -> None:
    omote = Decoded(web_glb(head)).document["extras"]["omote"]
    iris, pupil = omote["eyes"]["eye"]
    picture = eye_picture(export_parts(head)[1]).astype(int).sum(axis=2)
    row = picture[128, 128:] / picture[128, 128:].max()
    assert row[round(256 * pupil) - 3] < 0.1 < 0.2 < row[round(256 * pupil) + 6]
    assert row[round(256 * 0.95 * iris) - 2] < 0.5 < 0.8 < row[round(256 * 1.06 * iris) + 2]
    assert Decoded(web_glb(textured(tmp_path))).document["extras"]["omote"]["eyes"] == {}


def test_a_breath_is_a_target_where_the_head_breathes(head) -> None:
    assert Decoded(web_glb(head)).document["extras"]["omote"]["breath"] == {}
    low = Head(small_head(neck=Neck((0.0, 20.0, 0.0), still=-30.0, whole=25.0)))
    document = Decoded(web_glb(low)).document
    assert document["extras"]["omote"]["breath"] == {BREATH: BREATH_MM}
    assert BREATH in document["meshes"][0]["extras"]["targetNames"]


def test_pictures_of_hair_are_png_with_alpha():
    image = pytest.importorskip("PIL.Image", reason="needs Pillow (extra view)")
    import io

    for picture in (strand_picture(), strip_picture((0.8, 0.1, 0.2, 1.0), True)):
        assert image.open(io.BytesIO(png_bytes(picture))).mode == "RGBA"
        assert picture[..., 3].min() < picture[..., 3].max()


def test_what_a_file_for_the_web_cannot_hold_is_refused(tmp_path, head):
    with pytest.raises(ExportError, match="at rest"):
        export_head(head, tmp_path / "h.glb", {"mouthPucker": 1.0}, web=True)
    with pytest.raises(ExportError, match=r"--web writes a \.glb"):
        export_head(head, tmp_path / "h.obj", web=True)
    assert export_head(head, tmp_path / "h.glb", web=True) == [tmp_path / "h.glb"]
    assert len(gzip.compress((tmp_path / "h.glb").read_bytes())) > 100


def test_the_validator_of_khronos_finds_no_fault_in_it(tmp_path, head):
    node = shutil.which("node")
    if node is None or subprocess.run([node, "-e", "require('gltf-validator')"], capture_output=True).returncode:
        pytest.skip("needs node and its package gltf-validator (npm install gltf-validator, NODE_PATH)")
    path = tmp_path / "h.glb"
    path.write_bytes(web_glb(head))
    program = (
        "const b = new Uint8Array(require('fs').readFileSync(process.argv[1]));"
        "require('gltf-validator').validateBytes(b).then(r => console.log(r.issues.numErrors, r.issues.numWarnings));"
    )
    said = subprocess.run([node, "-e", program, str(path)], capture_output=True, text=True, check=True)
    assert said.stdout.split() == ["0", "0"]


def test_the_document_says_whether_one_sees_into_the_mouth_at_rest() -> None:
    head = Head.load(Path(__file__).parents[3] / "configs/heads/ict")
    assert not lips_open_at_rest(head)
    (lips,) = (contact for contact in head.contacts if contact.eye < 0)
    apart = lips.places + np.array([[[[0.0, 0.02]]], [[[0.0, -0.02]]]])  # upper further up, lower further down
    others = [contact for contact in head.contacts if contact.eye >= 0]
    assert lips_open_at_rest(Head(replace(head.data, contacts=[*others, replace(lips, places=apart)])))
    assert lips_open_at_rest(Head(replace(head.data, contacts=others)))


def test_steps_reach_all_vertices_and_a_quarter_beyond() -> None:
    rows = [np.array([[0.0, 0, 0], [10, 0, 0]], np.float32), np.array([[4.0, -6.0, 2.0]], np.float32)]
    middle, step = glb_web._grid(rows)
    assert middle.tolist() == [5.0, -3.0, 1.0] and step == pytest.approx(1.25 * 5.0 / 32_700)
    middle, step = glb_web._grid(rows, np.array([0.0, 1.0, 0.0]))
    assert middle.tolist() == [0.0, 1.0, 0.0] and step == pytest.approx(1.25 * 10.0 / 32_700)
    assert glb_web._grid([np.zeros((2, 3), np.float32)])[1] == pytest.approx(1.25 / 32_700)  # 1 mm at least
    middle, step = glb_web._grid([])
    assert middle.tolist() == [0.0] * 3 and step == 1.0


def test_normals_and_colours_are_coarse_enough_to_compress() -> None:
    normals = glb_web._normal_steps(np.array([[0.0, 1.0, -1.0], [1e-4, 1.3e-4, -0.5]], np.float32))
    assert normals.dtype == np.int16 and normals.tolist() == [[0, 32_767, -32_767], [0, 8, -16_384]]
    colours = glb_web._colour_steps(np.array([[0.0, 1.0, 0.25], [0.25 + 2e-3, 1e-5, 1e-6]], np.float32))
    half = round((128 / 255) ** 2 * 65_535)
    assert colours.dtype == np.uint16 and colours.tolist() == [[0, 65_535, half], [half, 1, 0]]


@pytest.mark.parametrize(("apart", "sees"), [(1.19, False), (1.21, True)])
def test_lips_further_than_1_2_mm_apart_in_any_column_are_open(apart: float, sees: bool) -> None:
    above, beyond = np.array([[0.0, 0.0], [0.0, 9.0]]), np.array([[5.0, 0.0], [5.0, apart]])

    def evaluate(side: np.ndarray) -> np.ndarray:
        return np.column_stack([side, np.zeros(len(side))])

    places = np.stack([np.stack([above, above]), np.stack([np.add(above, [0.0, 0.5]), np.add(above, [0.0, apart])])])
    surface = SimpleNamespace(surface=SimpleNamespace(evaluate=evaluate))
    lids, lips = (SimpleNamespace(eye=eye, part="face", places=places) for eye in (0, -1))
    asked = SimpleNamespace(contacts=[lids, lips], part=lambda name: surface)
    assert lips_open_at_rest(asked) == sees  # type: ignore[arg-type]
    assert lips_open_at_rest(SimpleNamespace(contacts=[lids]))  # type: ignore[arg-type]
    assert glb_web._nearest_mm(np.zeros((1, 3)), np.column_stack([beyond, [1.0, 2.0]])) == pytest.approx(np.sqrt(26.0))


def test_what_is_drawn_as_strips_or_strands_says_so() -> None:
    assert glb_web._blending("skin", {}) == {"doubleSided": False}
    assert glb_web._blending("brow", {"two_sided": True}) == {"doubleSided": True, "alphaMode": "BLEND"}
    assert glb_web._blending("lash", {})["alphaMode"] == "BLEND"
    for kind in ("strand", "tress"):
        assert glb_web._blending(kind, {}) == {"doubleSided": False, "alphaMode": "MASK", "alphaCutoff": 0.3}


def test_moves_are_whole_coarse_steps_and_turns_of_normals_at_most_one(monkeypatch: pytest.MonkeyPatch) -> None:
    document, kept = object.__new__(glb_web._WebDocument), []
    GlbBuffers.__init__(document)
    monkeypatch.setattr(document, "_sparse", lambda rows, ids, *_, **more: kept.append((rows, ids)), raising=False)
    moves = np.array([[0.0, 0, 0], [0, 4.4, 0], [1.4, 0, -7.0], [0, 0, 0]])
    turns = np.array([[0.0, 0, 0], [0, 0, 0], [-1.7, 1.6, 0.5], [0, 0, 0.003]])
    document._target(moves, turns, 3)
    (steps, ids), (bent, same) = kept
    assert steps.tolist() == [[0, 0, 0], [0, 3, 0], [0, 0, -6], [0, 0, 0]] and ids.tolist() == same.tolist() == [1, 2]
    assert bent.dtype == np.int8 and bent.tolist() == [[0, 0, 0], [0, 0, 0], [-127, 127, 64], [0, 0, 0]]
    document._target(0.0 * moves, 0.0 * turns, 3)
    assert kept[2][1].tolist() == [0]  # an empty list would be no list


def test_how_far_shapes_part_the_lips_is_measured_on_them() -> None:
    gaps = lip_gaps(Head.load(Path(__file__).parents[3] / "configs/heads/ict"))
    assert max(gaps["jawOpen"]) > 25.0
    np.testing.assert_allclose(np.add(gaps["mouthClose"], gaps["jawOpen"]), 0.0, atol=2.0)
    assert max(gaps["mouthUpperUpLeft"]) > 2.0
    assert max(gaps.get("mouthSmileLeft", [0.0])) < 1.5 and max(gaps.get("jawForward", [0.0])) < 1.5
    assert not {"eyeBlinkLeft", "browInnerUp"} & set(gaps)


def test_groups_of_the_user_that_part_the_lips_are_among_them() -> None:
    head = Head.load(Path(__file__).parents[3] / "configs/heads/ict")
    down = head.group("mouthLowerDownLeft")["face"]
    moves = down.moves.astype(float)
    groups = [
        OwnGroup("gape", "face", down.ids, moves), OwnGroup("shut", "face", down.ids, -moves),
        OwnGroup("wider", "face", down.ids, moves, ("jawOpen",)),
    ]  # fmt: skip
    head.add_groups(groups)
    sealed = lip_gaps(head)
    assert max(sealed["wider"]) > 2.0, "it adds to what the jaw opens"
    assert max(sealed["gape"]) > 2.0 and max(sealed["-shut"]) > 2.0, "a group of one's own opens lips that are sealed"
    free = Head(replace(head.data, contacts=[replace(contact, seal=None) for contact in head.contacts]))
    free.add_groups(groups)
    gaps = lip_gaps(free)
    assert max(gaps["gape"]) > 2.0 and max(gaps["-shut"]) > 2.0, "one opens them up to 1, the other down to -1"
    assert max(gaps.get("shut", [0.0])) < 1.0
    assert Decoded(web_glb(free)).document["extras"]["omote"]["lips"] == gaps
