"""surface.readers.gltf.container: containers and accessors, every number checked against what was packed by hand."""

import base64
import json
import struct

import numpy as np
import pytest
from meshfiles import FLOAT, GlbBuilder

from surface.base.errors import FitError
from surface.readers.gltf.container import MAX_ELEMENTS, Gltf


def opened(tmp_path, builder: GlbBuilder) -> Gltf:
    path = tmp_path / "m.glb"
    path.write_bytes(builder.bytes())
    return Gltf(path)


def text_file(tmp_path, **document) -> Gltf:
    path = tmp_path / "m.gltf"
    path.write_text(json.dumps({"asset": {"version": "2.0"}, **document}))
    return Gltf(path)


def chunk(kind: int, data: bytes) -> bytes:
    return struct.pack("<II", len(data), kind) + data


def glb(*chunks: bytes, version: int = 2, length: int | None = None) -> bytes:
    body = b"".join(chunks)
    return struct.pack("<4sII", b"glTF", version, 12 + len(body) if length is None else length) + body


JSON = chunk(0x4E4F534A, b'{"asset": {"version": "2.0"}, "buffers": [{"byteLength": 4}]}   ')


@pytest.mark.parametrize(
    ("raw", "why"),
    [
        (b"", "is empty"),
        (b"PK\x03\x04", "is no glTF file"),
        (glb(JSON, version=1), "header: is glTF version 1"),
        (glb(JSON, length=10**6), "header: the file is cut short: .* of 1000000 bytes"),
        (glb(JSON)[:19], "header: the file is cut short$"),
        (glb(chunk(0x004E4942, b"abcdefgh")), "there is no JSON chunk"),
        (glb(JSON, struct.pack("<II", 9, 0x004E4942) + b"abcd"), r"chunk at byte 84: says 9 bytes, 4 are left"),
        (glb(chunk(0x4E4F534A, b"[1]     ")), "JSON: is no object"),
        (glb(chunk(0x4E4F534A, b'{"a": \xff}  ')), "JSON: not UTF-8"),
        (b'{"asset": {}}', "asset.version: is missing"),
        (b'{"asset": []}', r"JSON.asset: '\[\]' is no object"),
        (b'{"asset": {"version": "3.0"}}', "asset.version: is '3.0'"),
        (b'{"asset": {"version": "2.1"}, "extensionsRequired": ["X_y", "KHR_draco_mesh_compression"]}', "Draco"),
    ],
)
def test_damaged_containers_are_refused(tmp_path, raw, why):
    path = tmp_path / "m.glb"
    path.write_bytes(raw)
    with pytest.raises(FitError, match=why) as caught:
        Gltf(path)
    assert str(path) in str(caught.value) and caught.value.hint


def test_unknown_extensions_are_no_reason_to_refuse_a_mesh(tmp_path):
    required = ["EXT_texture_webp", "KHR_materials_unlit", "VRMC_vrm", "X_of_tomorrow"]
    assert text_file(tmp_path, extensionsRequired=required).items("nodes") == []


def test_the_first_chunk_of_a_kind_counts_and_unknown_ones_are_skipped(tmp_path):
    path = tmp_path / "m.glb"
    path.write_bytes(glb(JSON, chunk(7, b"what"), chunk(0x004E4942, b"1234"), chunk(0x004E4942, b"5678")))
    assert Gltf(path)._buffer(0, "x") == b"1234"
    path.write_bytes(glb(JSON) + b"trailing bytes")
    with pytest.raises(FitError, match=r"buffers\[0\]: has neither a uri nor a binary chunk"):
        Gltf(path)._buffer(0, "x")


@pytest.mark.parametrize(
    ("code", "format_"), [(5120, "b"), (5121, "B"), (5122, "h"), (5123, "H"), (5125, "I"), (5126, "f")]
)
def test_every_component_type_is_little_endian(tmp_path, code, format_):
    numbers = [1, 0, 100, 7]
    builder = GlbBuilder()
    packed = np.frombuffer(struct.pack(f"<4{format_}", *numbers), np.uint8)
    at = builder.accessor(packed, code, "SCALAR")
    builder.document["accessors"][at]["count"] = 4
    assert opened(tmp_path, builder).floats(at, 1, "x").ravel().tolist() == numbers


@pytest.mark.parametrize(
    ("dtype", "code", "stored", "wanted"),
    [
        (np.int8, 5120, [-128, -127, 0, 127], [-1, -1, 0, 1]),
        (np.uint8, 5121, [0, 51, 255], [0, 0.2, 1]),
        (np.int16, 5122, [-32768, 32767], [-1, 1]),
        (np.uint16, 5123, [0, 13107, 65535], [0, 0.2, 1]),
    ],
)
def test_normalised_integers_follow_the_specification(tmp_path, dtype, code, stored, wanted):
    builder = GlbBuilder()
    plain = builder.accessor(np.array(stored, dtype), code, "SCALAR")
    scaled = builder.accessor(np.array(stored, dtype), code, "SCALAR", normalized=True)
    file = opened(tmp_path, builder)
    assert file.floats(plain, 1, "x").ravel().tolist() == stored
    np.testing.assert_allclose(file.floats(scaled, 1, "x").ravel(), wanted, atol=1e-12)


def test_interleaved_elements_are_found_by_stride_and_offset(tmp_path):
    builder = GlbBuilder()
    rows = np.arange(40, dtype=np.float32).reshape(5, 8)
    view = builder.view(rows)
    builder.document["bufferViews"][view]["byteStride"] = 32
    entry = {"bufferView": view, "componentType": FLOAT, "count": 5, "type": "VEC3"}
    builder.document["accessors"] = [
        {**entry, "byteOffset": 8},
        {**entry, "byteOffset": 20},
        {**entry, "byteOffset": 24},
    ]
    file = opened(tmp_path, builder)
    assert (file.floats(0, 3, "x") == rows[:, 2:5]).all()
    assert (file.floats(1, 3, "x") == rows[:, 5:8]).all(), "the last element ends with the view"
    with pytest.raises(FitError, match="5 elements do not fit into the 160 bytes"):
        file.floats(2, 3, "x")
    file.document["bufferViews"][view]["byteStride"] = 8
    with pytest.raises(FitError, match="do not fit"):
        file.floats(0, 3, "x")


def sparse(**change) -> GlbBuilder:
    builder = GlbBuilder()
    ids, values = builder.view(np.array([1, 3], np.uint16)), builder.view(np.float32([[1, 2, 3], [4, 5, 6]]))
    table = {
        "count": 2, "indices": {"bufferView": ids, "componentType": 5123}, "values": {"bufferView": values}, **change,
    }  # fmt: skip
    builder.document["accessors"] = [{"componentType": FLOAT, "count": 4, "type": "VEC3", "sparse": table}]
    return builder


def test_sparse_elements_replace_zeros_or_those_of_a_view(tmp_path):
    wanted = [[0, 0, 0], [1, 2, 3], [0, 0, 0], [4, 5, 6]]
    assert opened(tmp_path, sparse()).floats(0, 3, "x").tolist() == wanted
    builder = sparse()
    builder.document["accessors"][0]["bufferView"] = builder.view(np.full((4, 3), 9, np.float32))
    assert opened(tmp_path, builder).floats(0, 3, "x").tolist() == [[9] * 3, [1, 2, 3], [9] * 3, [4, 5, 6]]


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"count": 5}, "replaces 5 of 4 elements"),
        ({"count": -1}, "sparse.count: is -1"),
        ({"values": {}}, "sparse.values.bufferView: is missing"),
        ({"indices": {"componentType": 5123}}, "sparse.indices.bufferView: is missing"),
        ({"indices": {"bufferView": 1, "componentType": 5123}}, "replaces element .*, but there are 4"),
        ({"indices": 3}, "sparse.indices: '3' is no object"),
    ],
)
def test_wrong_sparse_accessors_are_refused(tmp_path, change, why):
    with pytest.raises(FitError, match=why):
        opened(tmp_path, sparse(**change)).floats(0, 3, "x")


@pytest.mark.parametrize("last", [3, 4])
def test_a_sparse_index_must_be_one_of_the_elements(tmp_path, last):
    builder = sparse()
    builder.document["accessors"][0]["sparse"]["indices"]["bufferView"] = builder.view(np.array([0, last], np.uint16))
    file = opened(tmp_path, builder)
    if last < 4:
        assert file.floats(0, 3, "x")[3].tolist() == [4, 5, 6]
    else:
        with pytest.raises(FitError, match="replaces element 4, but there are 4"):
            file.floats(0, 3, "x")


def test_integers_must_be_unsigned_and_floats_finite(tmp_path):
    builder = GlbBuilder()
    builder.accessor(np.array([[1, 2], [3, 4]], np.uint16), 5123, "VEC2")
    builder.accessor(np.array([-1, 2], np.int16), 5122, "SCALAR")
    builder.accessor(np.float32([1, np.inf]), FLOAT, "SCALAR")
    file = opened(tmp_path, builder)
    assert file.integers(0, "x", 2).tolist() == [[1, 2], [3, 4]]
    with pytest.raises(FitError, match="x: holds int16, not unsigned numbers"):
        file.integers(1, "x")
    with pytest.raises(FitError, match="x, element 1: is not a finite number"):
        file.floats(2, 1, "x")
    with pytest.raises(FitError, match=r"accessors\[0\] \(x\): is of type 'VEC2', which has not 3 numbers"):
        file.floats(0, 3, "x")


@pytest.mark.parametrize("index", [-1, 1, True, "0", None])
def test_only_an_index_into_the_list_finds_an_item(tmp_path, index):
    file = text_file(tmp_path, nodes=[{"name": "a"}])
    assert file.item("nodes", 0, "scene") == {"name": "a"}
    with pytest.raises(FitError, match=r"scene: points at nodes\[.*\], but there are 1"):
        file.item("nodes", index, "scene")


def test_values_of_another_kind_and_missing_ones_are_named(tmp_path):
    file = text_file(tmp_path, nodes=[1])
    assert file.value({"n": 3}, "n", int, "here") == 3
    assert file.value({}, "n", int, "here", 5) == 5
    assert file.items("meshes") == []
    for table, why in (({"n": True}, "here.n: 'True' is no number"), ({"n": "x"}, "'x' is no number"),
                       ({}, "here.n: is missing")):  # fmt: skip
        with pytest.raises(FitError, match=why):
            file.value(table, "n", int, "here")
    with pytest.raises(FitError, match=r"nodes\[0\]: is no object"):
        file.item("nodes", 0, "scene")


def test_buffers_inside_and_beside_the_text(tmp_path):
    (tmp_path / "a b.bin").write_bytes(b"beside")
    uris = [
        "data:;base64," + base64.b64encode(b"inside").decode(),
        "a%20b.bin",
        "data:;base64,@@",
        7,
        "../x",
        "none.bin",
    ]
    file = text_file(tmp_path, buffers=[{"uri": uri} for uri in uris])
    assert [file._buffer(k, "x") for k in (0, 1, 0)] == [b"inside", b"beside", b"inside"]
    for k, why in ((2, "uri: is damaged"), (3, "uri: is no text"), (4, "is not beside the file"), (5, "no such mesh")):
        with pytest.raises(FitError, match=why):
            file._buffer(k, "x")


def test_the_number_of_elements_is_limited(tmp_path):
    entry = {"componentType": FLOAT, "type": "SCALAR"}
    file = text_file(tmp_path, accessors=[{**entry, "count": MAX_ELEMENTS + 1}, {**entry, "count": 0}])
    with pytest.raises(FitError, match="4000001 elements; 4000000 are the most"):
        file.floats(0, 1, "x")
    assert file.floats(1, 1, "x").shape == (0, 1)
