"""surface.readers.npzmesh"""

import zipfile

import numpy as np
import pytest
from slit_sheet import slit_sheet, write_npz

from surface.base.errors import FitError
from surface.readers.npzmesh import KEYS, read_npz


def arrays(**other) -> dict[str, np.ndarray]:
    return {
        "neutral": np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]]),
        "deltas": np.arange(24, dtype=np.float32).reshape(2, 4, 3),
        "names": np.array(["jawOpen", "smile"]),
        "faces": np.int32([[0, 1, 2, 3], [0, 1, 2, -1], [1, 2, 3, -1]]),
        "uv": np.float64([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]]),
        "face_uv": np.int16([[0, 1, 2, 3], [0, 1, 4, -1], [1, 2, 3, -1]]),
        **other,
    }


def saved(tmp_path, **other):
    np.savez(tmp_path / "m.npz", **arrays(**other))
    return tmp_path / "m.npz"


def test_every_array_comes_back_in_its_type(tmp_path):
    mesh, given = read_npz(saved(tmp_path)), arrays()
    for key, name in (("neutral", "vertices"), ("deltas", "deltas"), ("faces", "faces"), ("uv", "uv"),
                      ("face_uv", "face_uv")):  # fmt: skip
        got = getattr(mesh, name)
        assert np.array_equal(got, given[key])
        assert got.dtype == (np.int64 if "face" in key else np.float64)
    assert mesh.names == ("jawOpen", "smile")
    assert mesh.piece.tolist() == [0, 0, 0] and mesh.pieces == ("mesh",)


def test_a_mesh_may_have_no_texture_coordinates(tmp_path):
    np.savez(tmp_path / "m.npz", **{key: array for key, array in arrays().items() if "uv" not in key})
    mesh = read_npz(tmp_path / "m.npz")
    assert mesh.uv.shape == (0, 2) and mesh.face_uv.shape == (3, 4) and (mesh.face_uv == -1).all()


def test_names_may_be_bytes(tmp_path):
    assert read_npz(saved(tmp_path, names=np.array([b"jawOpen", b"a\xff"]))).names == ("jawOpen", "a\ufffd")


@pytest.mark.parametrize(
    ("other", "why"),
    [
        ({"neutral": np.zeros((4, 2))}, r"neutral has shape \(4, 2\), expected \(4, 3\)"),
        ({"deltas": np.zeros((2, 5, 3))}, r"deltas has shape \(2, 5, 3\), expected \(2, 4, 3\)"),
        ({"names": np.array([["a"], ["b"]])}, r"names has shape \(2, 1\), expected \(2,\)"),
        ({"faces": np.zeros((3, 3), int)}, r"faces has shape \(3, 3\), expected \(3, 4\)"),
        ({"face_uv": np.zeros((2, 4), int)}, r"face_uv has shape \(2, 4\), expected \(3, 4\)"),
        ({"uv": np.zeros((5, 3))}, r"uv has shape \(5, 3\), expected \(5, 2\)"),
        ({"uv": np.float64(3)}, r"uv has shape \(\), expected \(1, 2\)"),
        ({"faces": np.zeros((3, 4))}, "faces holds float64"),
        ({"face_uv": np.zeros((3, 4))}, "face_uv holds float64"),
        ({"neutral": np.zeros((4, 3), complex)}, "neutral holds complex128"),
        ({"names": np.arange(2)}, "names holds int64"),
    ],
)
def test_other_shapes_and_types_are_refused(tmp_path, other, why):
    with pytest.raises(FitError, match=rf"m\.npz: {why}") as caught:
        read_npz(saved(tmp_path, **other))
    assert caught.value.hint == "export all arrays from one mesh"


@pytest.mark.parametrize("key", KEYS)
def test_a_missing_key_is_named_with_those_found(tmp_path, key):
    given = arrays()
    del given[key]
    np.savez(tmp_path / "m.npz", **given)
    with pytest.raises(FitError, match=rf"key '{key}' is missing \(found: {', '.join(given)}\)"):
        read_npz(tmp_path / "m.npz")


def test_what_is_no_archive_is_refused(tmp_path):
    path = tmp_path / "m.npz"
    with pytest.raises(FitError, match="no such mesh file"):
        read_npz(path)
    path.write_bytes(b"\x93NUMPY")
    with pytest.raises(FitError, match="not a sound archive"):
        read_npz(path)
    path.write_bytes(b"PK\x03\x04 and nothing more")
    with pytest.raises(FitError, match="not a sound archive"):
        read_npz(path)


@pytest.mark.slow
def test_an_archive_that_unpacks_to_gigabytes_is_refused_before_it_does(tmp_path):
    path = write_npz(tmp_path / "m.npz", slit_sheet())
    with (
        zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        archive.open("more.npy", "w") as member,
    ):
        zeros = bytes(16 << 20)
        for _ in range(65):
            member.write(zeros)
    with pytest.raises(FitError, match=r"m\.npz: .*unpacks to 1040 MB, more than 1024 MB"):
        read_npz(path)
