"""surface.base.files: files of strangers are read within limits, and what is no file is refused at once."""

from __future__ import annotations

import io
import json
import os
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from surface.base import files


def test_a_file_is_read_whole(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(bytes(range(256)))
    assert files.read_file(tmp_path / "a") == bytes(range(256))


def test_a_file_of_exactly_the_limit_is_read_and_one_byte_more_is_not(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"x" * 100)
    assert len(files.read_file(tmp_path / "a", 100)) == 100
    with pytest.raises(OSError, match="is larger than") as raised:
        files.read_file(tmp_path / "a", 99)
    assert raised.value.filename == str(tmp_path / "a")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_named_pipe_that_nobody_writes_to_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="named pipe") as raised:
        files.read_file(tmp_path / "pipe")
    assert "named pipe" in raised.value.strerror


def test_folders_and_devices_are_no_files(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="folder"):
        files.read_file(tmp_path)
    with pytest.raises(OSError, match="device"):
        files.read_file("/dev/zero")


def test_a_file_that_does_not_say_its_size_is_bounded_too() -> None:
    assert Path("/proc/self/maps").stat().st_size == 0
    with pytest.raises(OSError, match="is larger than"):
        files.read_file("/proc/self/maps", 10)


@pytest.mark.parametrize(
    ("data", "told"),
    [("é".encode("latin-1"), "Latin-1"), ("name = 'x'".encode("utf-16"), "UTF-16"), (b"a\nb\n\xff", "line 3")],
)
def test_other_encodings_are_named(tmp_path: Path, data: bytes, told: str) -> None:
    (tmp_path / "a").write_bytes(data)
    with pytest.raises(ValueError, match=told):
        files.read_text(tmp_path / "a")


@pytest.mark.parametrize(
    ("data", "told"),
    [
        ("\ufeffé".encode("utf-16-be"), "UTF-16"),
        (b"\xe9" + b"\0" * 20, "Latin-1"),
        (b"\xe9" + b"\0" * 21, "UTF-16"),
        (b"\xe9" * 179 + b"\0" * 30, "UTF-16"),  # 21 zeros among the first 200 bytes
        (b"\xe9" * 180 + b"\0" * 30, "Latin-1"),
        (b"\nb\xff\n", "line 2"),
    ],
)
def test_many_zeros_near_the_start_mean_two_bytes_a_letter(data: bytes, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        files.decode(data)


def sparse(path: Path, size: int) -> Path:
    path.touch()
    os.truncate(path, size)
    return path


def test_limits_are_one_megabyte_of_settings_sixty_four_of_text_and_a_gigabyte_of_data(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="not valid TOML"):
        files.read_toml(sparse(tmp_path / "a.toml", 1 << 20))
    with pytest.raises(OSError, match=r"is larger than 1 MB \(1 MB\)"):
        files.read_toml(sparse(tmp_path / "a.toml", (1 << 20) + 1))
    assert len(files.read_text(sparse(tmp_path / "a.txt", 64 << 20))) == 64 << 20
    for read in (files.read_text, files.read_json):
        with pytest.raises(OSError, match=r"is larger than 64 MB \(70 MB\)"):
            read(sparse(tmp_path / "a.txt", 70 << 20))  # type: ignore[operator]
    files.open_file(sparse(tmp_path / "a.bin", 1 << 30)).close()
    for read in (files.open_file, files.read_file, files.read_npz):
        with pytest.raises(OSError, match=r"is larger than 1024 MB \(1024 MB\)"):
            read(sparse(tmp_path / "a.bin", (1 << 30) + 1))  # type: ignore[operator]


@pytest.mark.skipif(not Path("/proc/version").exists(), reason="needs /proc")
def test_a_file_that_does_not_say_its_size_is_read_whole() -> None:
    assert files.read_file("/proc/version", 4096) == Path("/proc/version").read_bytes()


def test_what_is_no_array_in_an_archive_is_named(tmp_path: Path) -> None:
    path = archive(tmp_path / "a.npz", one=npy(np.arange(3)))
    with zipfile.ZipFile(path, "a") as file:
        for name in ("first.txt", "other.txt", "third.txt"):
            file.writestr(name, "no array")
    with pytest.raises(ValueError, match=r"^first\.txt is no array"):
        files.read_npz(path)


def test_a_byte_order_mark_is_no_text(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"\xef\xbb\xbf[a]\nb = 1")
    assert files.parse_toml(files.read_text(tmp_path / "a")) == {"a": {"b": 1}}


@pytest.mark.parametrize("parse", [files.parse_toml, files.parse_json])
@pytest.mark.parametrize("text", ["[" * 100_000, "a = " + "[" * 5000 + "]" * 5000, "a={b=" * 5000 + "1" + "}" * 5000])
def test_nesting_is_a_fault_of_the_file(parse: object, text: str) -> None:
    with pytest.raises(ValueError):
        parse(text)  # type: ignore[operator]


@pytest.mark.parametrize("wrap", [lambda inner: {"a": inner}, lambda inner: [inner], lambda inner: {"a": [0, inner]}])
def test_nesting_is_counted_through_tables_and_lists(wrap: Callable[[object], object]) -> None:
    value: object = 1
    depth = 1 if wrap(0) != {"a": [0, 0]} else 2
    for _ in range(files.MAX_DEPTH // depth - 1):
        value = wrap(value)
    assert files.parse_json(json.dumps(value)) == value
    for _ in range(2):
        value = wrap(value)
    with pytest.raises(ValueError, match="nested"):
        files.parse_json(json.dumps(value))


def archive(path: Path, **members: bytes) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, data in members.items():
            file.writestr(f"{name}.npy", data)
    return path


def npy(array: np.ndarray) -> bytes:
    data = io.BytesIO()
    np.save(data, array, allow_pickle=True)
    return data.getvalue()


def test_arrays_come_back_as_they_were(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "a.npz", one=np.arange(5), two=np.eye(3))
    found = files.read_npz(tmp_path / "a.npz")
    assert sorted(found) == ["one", "two"] and np.array_equal(found["two"], np.eye(3))


def test_an_archive_that_unpacks_to_more_than_the_limit_is_refused_before_it_is(tmp_path: Path) -> None:
    path = archive(tmp_path / "a.npz", bomb=npy(np.zeros(4_000_000)))
    assert path.stat().st_size < 100_000
    with pytest.raises(ValueError, match="unpacks to 30 MB, more than 10 MB"):
        files.read_npz(path, 10 << 20)


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"PK\3\4",
        b"no archive",
        npy(np.arange(3))[:-1],
        b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999999,), }",
    ],
)
def test_what_is_no_sound_archive_is_a_fault_of_the_file(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "a.npz").write_bytes(data)
    with pytest.raises(ValueError):
        files.read_npz(tmp_path / "a.npz")
    with pytest.raises(ValueError):
        files.read_npz(archive(tmp_path / "b.npz", a=data))


def test_a_damaged_name_in_an_archive_is_told_without_the_words_of_the_interpreter(tmp_path: Path) -> None:
    path = archive(tmp_path / "a.npz", ä=npy(np.zeros(1)))
    path.write_bytes(path.read_bytes().replace("ä".encode(), b"\xff\xff", 1))
    with pytest.raises(ValueError, match="not a sound archive of arrays: it is damaged"):
        files.read_npz(path)


@pytest.mark.parametrize("kind", ["<f8", "<f4", ">f8", "<f2", "<i8", "<i4", "<u2", "|i1", "|u1", "|b1", "<c8", "<U3"])
@pytest.mark.parametrize("shape", [(), (3,), (1,), (0, 3), (4, 3), (2, 3, 4), (2, 0, 1)])
@pytest.mark.parametrize("order", "CF")
def test_arrays_are_those_that_numpy_reads(tmp_path: Path, kind: str, shape: tuple[int, ...], order: str) -> None:
    array = np.array(np.arange(24)[: int(np.prod(shape))].reshape(shape).astype(kind), order=order)
    path = archive(tmp_path / "a.npz", one=npy(array), two=npy(np.zeros(2)))
    with np.load(path) as stored:
        expected = stored["one"]
    found = files.read_npz(path)
    assert list(found) == ["one", "two"] and found["one"].flags.writeable
    assert (found["one"].dtype, found["one"].shape) == (expected.dtype, expected.shape)
    assert np.array_equal(found["one"], expected)


def test_an_array_that_is_cut_short_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="not a sound archive of arrays"):
        files.read_npz(archive(tmp_path / "a.npz", a=npy(np.arange(9.0))[:-1]))


def test_python_objects_are_not_loaded(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="Python objects"):
        files.read_npz(archive(tmp_path / "a.npz", a=npy(np.array([{}], dtype=object))))


@pytest.mark.parametrize("point", [0x110000, 0xFFFFFFFF, 0xD800, 0xDFFF])
@pytest.mark.parametrize("order", "<>")
def test_characters_that_do_not_exist_are_named(tmp_path: Path, point: int, order: str) -> None:
    text = np.array(["jaw", "\U0010ffff\ud7ff\ue000"], f"{order}U3")
    path = archive(tmp_path / "a.npz", names=npy(text))
    assert np.array_equal(files.read_npz(path)["names"], text)
    assert files.read_npz(archive(tmp_path / "none.npz", names=npy(np.zeros((2, 0), "U3"))))["names"].size == 0
    text.view(f"{order}u4")[1] = point
    with pytest.raises(ValueError, match=r"^names holds characters that do not exist"):
        files.read_npz(archive(tmp_path / "b.npz", names=npy(text)))
