"""surface.head.model.sidecar"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from surface.base.errors import HeadFileError
from surface.head.model.sidecar import FORMAT, VERSION, read_sidecar, sidecar_path, write_sidecar


def test_arrays_come_back_and_nothing_else_is_left(tmp_path: Path) -> None:
    path = sidecar_path(tmp_path / "head.toml", "more.npz")
    assert path == sidecar_path(tmp_path, "more.npz") == tmp_path / "more.npz"
    assert read_sidecar(path, lambda kept: kept, "") is None
    write_sidecar(path, {"a/b": np.arange(3), "c": np.ones((2, 2))})
    found = read_sidecar(path, lambda kept: kept, "")
    assert found is not None and found.arrays.keys() == {"a/b", "c"} and found.checks == {}
    assert np.array_equal(found.arrays["a/b"], np.arange(3))
    assert [entry.name for entry in tmp_path.iterdir()] == ["more.npz"]


@pytest.mark.parametrize("at", [10, 60, -30])
def test_a_damaged_file_is_named_with_what_to_do(tmp_path: Path, at: int) -> None:
    path = write_sidecar(tmp_path / "more.npz", {"a": np.random.default_rng(1).integers(0, 99, 999)})
    damaged = bytearray(path.read_bytes())
    damaged[at : at + 8] = b"\xff" * 8
    path.write_bytes(damaged[: len(damaged) // 2] if at == 10 else damaged)
    with pytest.raises(HeadFileError, match=r"more\.npz") as caught:
        read_sidecar(path, lambda kept: kept.arrays["a"], "make it again")
    assert caught.value.hint == "make it again"


def test_what_is_missing_in_it_is_named(tmp_path: Path) -> None:
    path = write_sidecar(tmp_path / "more.npz", {"a": np.arange(3)})
    with pytest.raises(HeadFileError, match="'b'"):
        read_sidecar(path, lambda kept: kept.arrays["b"], "")


def test_checksums_come_back_by_part(tmp_path: Path) -> None:
    path = write_sidecar(tmp_path / "more.npz", {"a": np.arange(3)}, {"a": 7, "b/c": (1 << 32) - 1})
    found = read_sidecar(path, lambda kept: kept.checks, "")
    assert found == {"a": 7, "b/c": (1 << 32) - 1}


def test_a_file_without_a_version_is_read_and_one_of_a_newer_version_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "more.npz"
    np.savez_compressed(path, a=np.arange(3))
    found = read_sidecar(path, lambda kept: kept, "")
    assert found is not None and found.arrays.keys() == {"a"}
    np.savez_compressed(path, **{"a": np.arange(3), FORMAT: np.array([VERSION + 1])})
    with pytest.raises(HeadFileError, match=rf"more\.npz: is of version {VERSION + 1}, this") as caught:
        read_sidecar(path, lambda kept: kept, "make it again")
    assert caught.value.hint == "update omote"


def test_a_full_disk_leaves_the_old_file(tmp_path: Path, full_disk: Callable[[int], None]) -> None:
    path = write_sidecar(tmp_path / "more.npz", {"a": np.arange(3)})
    full_disk(2000)
    with pytest.raises(HeadFileError, match=r"more\.npz: cannot be written \(.*File too large"):
        write_sidecar(path, {"a": np.random.default_rng(1).random(9999)})
    assert [entry.name for entry in tmp_path.iterdir()] == ["more.npz"] and path.stat().st_size < 2000


def test_the_version_and_checksums_are_kept_apart_from_the_arrays(tmp_path: Path) -> None:
    path = write_sidecar(tmp_path / "more.npz", {"a": np.arange(3)}, {"p": 7})
    with np.load(path) as stored:
        assert {k: stored[k].tolist() for k in stored.files} == {
            "a": [0, 1, 2], "omote/format": [1], "omote/checksum/p": [7],
        }  # fmt: skip
