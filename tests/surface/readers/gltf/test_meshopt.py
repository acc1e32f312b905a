"""surface.readers.gltf.meshopt against streams that the meshoptimizer library wrote, and the extension's own text.

The streams are those of meshoptimizer 0.2.30a0 for the numbers that are made here (codec version 0 for attributes).
"""

from __future__ import annotations

import numpy as np
import pytest
from meshfiles import GlbBuilder, glb, meshopt_compressed, meshopt_stream
from slit_sheet import slit_sheet

from surface.base.errors import FitError
from surface.readers.gltf.container import MAX_ELEMENTS, Gltf
from surface.readers.gltf.mesh import read_gltf
from surface.readers.gltf.meshopt import decode_view

WAVE = bytes.fromhex(
    "a01f0058585858585858585858585858585858585858585858585858585858585858ffff00005858585858585858152aaeaaea0404aeaaea"
    "ae040404abaa0000041f009e349352f95d44ed2079a9732add5849e764853ca29a2ca342f27132fd147dffff0000ab6b36cd6a35d3762a04"
    "44200113353311002446444200113533311004000000001f0002060a0e12161a1e22262a2e32363a3e42464a4e52565a5e62666a6e72767a"
    "ffff00007e82868a8e92969a14800200808080000000000000000000000000000000000000000000000000000000000000000000000700"
)
TRIANGLES = bytes.fromhex(
    "e1fe1e001e001e001ede0e061e051e041ede0e041e041e041ede0e041e041e041efffff00af800297f010e007687566778a9866589689801690000"
)
INDICES = bytes.fromhex("d1140404a11f0504049dec10841fbf8b1100000000")


def wave() -> np.ndarray:
    """(40, 4) numbers that rise, swing, curve and stay."""
    k = np.arange(40)
    return np.column_stack([300 * k, (2000 * np.sin(0.3 * k)).round(), k * k, 7 * np.ones(40)]).astype("<i2")


def grid() -> np.ndarray:
    """(34, 3) the triangles of a grid of five by five vertices, and two anywhere."""
    i = np.arange(25).reshape(5, 5)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[:-1, 1:].ravel(), i[1:, 1:].ravel()
    return np.concatenate([np.stack([a, b, c, c, b, d], axis=1).reshape(-1, 3), [[24, 3, 17], [2, 20, 9]]])


def same_triangles(found: np.ndarray, wanted: np.ndarray) -> bool:
    """Equal but for the corner that each begins with, which the codec does not keep."""
    return bool(np.any([(np.roll(found, k, axis=1) == wanted).all(axis=1) for k in range(3)], axis=0).all())


def test_attributes_are_those_that_were_compressed() -> None:
    assert decode_view(WAVE, "ATTRIBUTES", "NONE", 40, 8) == wave().tobytes()


@pytest.mark.parametrize(("stride", "kind"), [(2, "<u2"), (4, "<u4")])
def test_triangles_are_those_that_were_compressed(stride: int, kind: str) -> None:
    found = np.frombuffer(decode_view(TRIANGLES, "TRIANGLES", "NONE", 102, stride), kind)
    assert same_triangles(found.reshape(-1, 3).astype(int), grid())


def test_indices_are_those_that_were_compressed() -> None:
    found = np.frombuffer(decode_view(INDICES, "INDICES", "NONE", 10, 4), "<u4")
    assert found.tolist() == [5, 6, 7, 1000, 1001, 8, 9, 70000, 1002, 0]
    with pytest.raises(ValueError, match="holds the number 70000"):
        decode_view(INDICES, "INDICES", "NONE", 10, 2)


def test_the_example_of_the_extension_gives_its_differences() -> None:
    """Appendix A: sixteen differences, the first of four bits each and two of them as bytes of their own."""
    example = bytes.fromhex("17 5f f0 bc 77 a9 21 00 34 b5")
    stream = b"\xa0" + b"\x02" + example + 3 * b"\x00" + bytes(32)
    first = np.frombuffer(decode_view(stream, "ATTRIBUTES", "NONE", 16, 4), np.int8).reshape(16, 4)
    steps = [-1, -4, -3, 26, -91, 0, -6, 6, -4, -4, 5, -5, 1, -1, 0, 0]
    assert first[:, 0].tolist() == np.cumsum(steps).astype(np.int8).tolist() and not first[:, 1:].any()


def test_unit_vectors_of_an_octahedron() -> None:
    corners = np.array([[127, 0, 127, 5], [0, -127, 127, 6], [0, 0, 127, 7], [127, 127, 127, 8]], np.int8)
    found = np.frombuffer(
        decode_view(meshopt_stream(corners.tobytes(), 4), "ATTRIBUTES", "OCTAHEDRAL", 4, 4), np.int8
    ).reshape(4, 4)
    assert found.tolist() == [[127, 0, 0, 5], [0, -127, 0, 6], [0, 0, 127, 7], [0, 0, -127, 8]]
    middle = np.array([[5461, 5461, 16383, 0]], np.int16)  # a third of each, with fifteen bits
    found = np.frombuffer(decode_view(meshopt_stream(middle.tobytes(), 8), "ATTRIBUTES", "OCTAHEDRAL", 1, 8), "<i2")
    assert np.abs(found[:3] - 32767 / np.sqrt(3)).max() < 2


def test_numbers_with_exponents() -> None:
    packed = np.array([[(-3 << 24) | 5, (2 << 24) | (-7 & 0xFFFFFF), 0]], np.int64).astype(np.int32)
    found = np.frombuffer(decode_view(meshopt_stream(packed.tobytes(), 12), "ATTRIBUTES", "EXPONENTIAL", 1, 12), "<f4")
    assert found.tolist() == [0.625, -28.0, 0.0]
    great = np.array([[(127 << 24) | 0x7FFFFF]], np.int32)
    stream = meshopt_stream(great.tobytes(), 4)
    assert np.frombuffer(decode_view(stream, "ATTRIBUTES", "EXPONENTIAL", 1, 4), "<f4").tolist() == [np.inf]


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ((WAVE, "VERTICES", "NONE", 40, 8), "mode 'VERTICES' is unknown"),
        ((b"", "ATTRIBUTES", "NONE", 40, 8), "is no stream of attributes"),
        ((b"\xa1" + WAVE[1:], "ATTRIBUTES", "NONE", 40, 8), "is no stream of attributes that this version"),
        ((WAVE, "TRIANGLES", "NONE", 42, 4), "is no stream of triangles"),
        ((WAVE, "ATTRIBUTES", "NONE", 40, 6), "elements of 6 bytes are not allowed"),
        ((WAVE, "ATTRIBUTES", "QUATERNION", 40, 8), "filter 'QUATERNION' of elements of 8 bytes is not read"),
        ((WAVE, "ATTRIBUTES", "NONE", 400, 8), "is damaged or cut short"),
        ((WAVE[:20], "ATTRIBUTES", "NONE", 40, 8), "is damaged or cut short"),
        ((WAVE, "ATTRIBUTES", "NONE", 20, 8), "is damaged or cut short"),
        ((INDICES, "INDICES", "NONE", 9, 4), "is damaged or cut short"),
        ((TRIANGLES, "TRIANGLES", "NONE", 101, 4), "101 numbers of 4 bytes"),
        ((TRIANGLES, "TRIANGLES", "NONE", 99, 4), "is damaged or cut short"),
        ((INDICES, "INDICES", "NONE", 11, 4), "is damaged or cut short"),
    ],
)
def test_what_the_extension_does_not_allow_is_refused(given: tuple[bytes, str, str, int, int], why: str) -> None:
    with pytest.raises(ValueError, match=why):
        decode_view(*given)


@pytest.mark.parametrize(
    ("stream", "mode", "count", "stride"),
    [(WAVE, "ATTRIBUTES", 40, 8), (TRIANGLES, "TRIANGLES", 102, 4), (INDICES, "INDICES", 10, 4)],
)
def test_damaged_streams_are_refused_or_give_as_many_numbers(stream: bytes, mode: str, count: int, stride: int) -> None:
    rng = np.random.default_rng(4)
    refused = 0
    for k in range(400):
        damaged = bytearray(stream[: rng.integers(1, len(stream) + 1)] if k % 2 else stream)
        for at in rng.integers(0, len(damaged), 2):
            damaged[at] = rng.integers(256)
        try:
            assert len(decode_view(bytes(damaged), mode, "NONE", count, stride)) == count * stride
        except ValueError:
            refused += 1
    assert refused > 100


def compressed(tmp_path, **changed: object) -> Gltf:
    """A file with the wave in a compressed view, its place in the buffer of plain bytes empty."""
    out = GlbBuilder()
    at = out.view(np.frombuffer(WAVE, np.uint8))
    packed = {**out.document["bufferViews"][at], "mode": "ATTRIBUTES", "byteStride": 8, "count": 40, **changed}
    out.document["bufferViews"][at] = {
        "buffer": 1, "byteLength": 320, "byteStride": 8, "extensions": {"EXT_meshopt_compression": packed}
    }  # fmt: skip
    out.document["accessors"] = [
        {"bufferView": at, "componentType": 5122, "normalized": True, "count": 40, "type": "VEC3"},
        {"bufferView": at, "byteOffset": 6, "componentType": 5122, "count": 40, "type": "SCALAR"},
    ]
    out.document["extensionsRequired"] = ["EXT_meshopt_compression", "KHR_mesh_quantization"]
    path = tmp_path / "m.glb"
    path.write_bytes(out.bytes())
    return Gltf(path)


def test_accessors_of_a_compressed_view_are_read_as_of_any_other(tmp_path) -> None:
    file = compressed(tmp_path)
    assert np.array_equal(file.floats(0, 3, "x"), wave()[:, :3] / 32767.0)
    assert np.array_equal(file.floats(1, 1, "x")[:, 0], np.full(40, 7.0))
    assert file.view_bytes(0, "x") == wave().tobytes()


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"count": 400}, "is damaged or cut short"),
        ({"count": 20}, "is damaged or cut short"),
        ({"count": MAX_ELEMENTS + 1}, "too many"),
        ({"byteStride": -8}, "byteStride: is -8"),
        ({"byteLength": 10**6}, "it is cut short"),
        ({"mode": 3}, "'3' is no text"),
        ({"count": 39}, "40 elements do not fit into the 312 bytes"),
    ],
)
def test_damaged_views_are_refused_with_their_place(tmp_path, changed: dict[str, object], why: str) -> None:
    with pytest.raises(FitError, match=why) as caught:
        compressed(tmp_path, **changed).floats(0, 3, "x")
    assert "bufferViews[0]" in str(caught.value)


@pytest.mark.parametrize("sparse", [False, True])
def test_a_compressed_file_holds_the_same_mesh(tmp_path, sparse: bool) -> None:
    plain = glb(slit_sheet(), sparse=sparse)
    meshes = []
    for name, builder in (("plain", plain), ("packed", meshopt_compressed(plain))):
        (tmp_path / f"{name}.glb").write_bytes(builder.bytes())
        meshes.append(read_gltf(tmp_path / f"{name}.glb"))
    assert len(meshes[0].vertices) > 100 and meshes[0].names == meshes[1].names
    for one in ("vertices", "faces", "uv", "deltas"):
        assert np.array_equal(getattr(meshes[0], one), getattr(meshes[1], one))
