"""surface.head.model.beside"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from surface.base.errors import HeadFileError
from surface.head.model.beside import beside, read_beside, write_beside


def test_arrays_come_back_and_nothing_else_is_left(tmp_path: Path) -> None:
    path = beside(tmp_path / "head.toml", "more.npz")
    assert path == beside(tmp_path, "more.npz") == tmp_path / "more.npz"
    assert read_beside(path, dict, "") is None
    write_beside(path, {"a/b": np.arange(3), "c": np.ones((2, 2))})
    found = read_beside(path, lambda z: {name: z[name] for name in z.files}, "")
    assert found is not None and found.keys() == {"a/b", "c"}
    assert np.array_equal(found["a/b"], np.arange(3))
    assert [entry.name for entry in tmp_path.iterdir()] == ["more.npz"]


@pytest.mark.parametrize("at", [10, 60, -30])
def test_a_damaged_file_is_named_with_what_to_do(tmp_path: Path, at: int) -> None:
    path = write_beside(tmp_path / "more.npz", {"a": np.random.default_rng(1).integers(0, 99, 999)})
    damaged = bytearray(path.read_bytes())
    damaged[at : at + 8] = b"\xff" * 8
    path.write_bytes(damaged[: len(damaged) // 2] if at == 10 else damaged)
    with pytest.raises(HeadFileError, match=r"more\.npz") as caught:
        read_beside(path, lambda z: z["a"], "make it again")
    assert caught.value.hint == "make it again"


def test_what_is_missing_in_it_is_named(tmp_path: Path) -> None:
    path = write_beside(tmp_path / "more.npz", {"a": np.arange(3)})
    with pytest.raises(HeadFileError, match="b is not a file"):
        read_beside(path, lambda z: z["b"], "")


def test_a_full_disk_leaves_the_old_file(tmp_path: Path, full_disk: Callable[[int], None]) -> None:
    path = write_beside(tmp_path / "more.npz", {"a": np.arange(3)})
    full_disk(2000)
    with pytest.raises(HeadFileError, match=r"more\.npz: cannot be written \(.*File too large"):
        write_beside(path, {"a": np.random.default_rng(1).random(9999)})
    assert [entry.name for entry in tmp_path.iterdir()] == ["more.npz"] and path.stat().st_size < 2000
