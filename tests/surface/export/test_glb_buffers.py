"""Documents of glTF while they are written, read again by the letter of the specification."""

from __future__ import annotations

import json
import struct

import numpy as np

from surface.export.glb_buffers import ARRAY_BUFFER, BYTE, ELEMENT_BUFFER, FLOAT, SHORT, UBYTE, UINT, USHORT, GlbBuffers


def test_numbers_are_those_of_the_specification() -> None:
    assert (BYTE, UBYTE, SHORT, USHORT, UINT, FLOAT) == (5120, 5121, 5122, 5123, 5125, 5126)
    assert (ARRAY_BUFFER, ELEMENT_BUFFER) == (34962, 34963)


def test_views_begin_at_fours_and_hold_the_bytes_of_their_arrays() -> None:
    document, arrays = (
        GlbBuffers(),
        [np.arange(5, dtype=np.uint8), np.arange(6, dtype="<f4"), np.arange(3, dtype="<u2")],
    )
    assert document.view(arrays[0], ELEMENT_BUFFER) == 0
    assert document.view(arrays[1], ARRAY_BUFFER, byteStride=8) == 1
    assert document.view(arrays[2]) == 2
    assert document.views[0] == {"buffer": 0, "byteOffset": 0, "byteLength": 5, "target": ELEMENT_BUFFER}
    assert document.views[1] == {
        "buffer": 0, "byteOffset": 8, "byteLength": 24, "byteStride": 8, "target": ARRAY_BUFFER
    }  # fmt: skip
    assert document.views[2] == {"buffer": 0, "byteOffset": 32, "byteLength": 6}
    rows = arrays[1].reshape(2, 3)
    assert document.accessor(rows, FLOAT, "VEC3", bufferView=1, bounds=True) == 0
    assert document.accessor(arrays[2], USHORT, "SCALAR", bufferView=2, byteOffset=2) == 1
    assert document.accessors == [
        {"componentType": 5126, "count": 2, "type": "VEC3", "bufferView": 1, "min": [0, 1, 2], "max": [3, 4, 5]},
        {"componentType": 5123, "count": 3, "type": "SCALAR", "bufferView": 2, "byteOffset": 2},
    ]
    document.content = {"asset": {"version": "2.0"}, "name": "å", "views": document.views}
    raw = document.bytes()
    magic, version, length, text_length, text_kind = struct.unpack_from("<4sIII4s", raw)
    assert (magic, version, length, text_kind) == (b"glTF", 2, len(raw), b"JSON") and text_length % 4 == 0
    found = json.loads(raw[20 : 20 + text_length].decode("ascii"))
    assert found["name"] == "å" and found["buffers"] == [{"byteLength": 40}]
    size, kind = struct.unpack_from("<I4s", raw, 20 + text_length)
    data = raw[28 + text_length :]
    assert (size, kind, len(data)) == (40, b"BIN\0", 40)
    for view, array in zip(found["views"], arrays, strict=True):
        assert data[view["byteOffset"] :][: view["byteLength"]] == array.tobytes()
    assert data[5:8] == b"\0\0\0" and data[38:] == b"\0\0"
