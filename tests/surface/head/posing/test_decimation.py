"""surface.head.posing.decimation"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_head import small_head

from surface.base.errors import HeadFileError
from surface.head import Head
from surface.head.posing.decimation import FILE, apply_decimated, read_decimated, write_decimated


@pytest.fixture(scope="module")
def head() -> Head:
    return Head(small_head())


def test_triangles_survive_the_file(head: Head, tmp_path: Path) -> None:
    few = head.part("a").triangles[::2]
    assert write_decimated(tmp_path, head.parts, {"a/fast": few}) == tmp_path / FILE
    apply_decimated(head.parts, read_decimated(tmp_path / "head.toml"))
    assert head.part("a").decimated.keys() == {"fast"}
    assert np.array_equal(head.part("a").decimated["fast"], few)
    assert head.part("b").decimated == {}
    assert [entry.name for entry in tmp_path.iterdir()] == [FILE]


def test_another_tessellation_or_an_index_out_of_range_is_passed_over(head: Head, tmp_path: Path) -> None:
    other = Head(small_head())
    triangles = other.part("a").triangles
    write_decimated(tmp_path, head.parts, {"a/fast": triangles, "b/fast": triangles + len(head.part("b").vertices)})
    decimated = read_decimated(tmp_path)
    other.part("a").triangles = triangles[::-1].copy()
    apply_decimated(other.parts, decimated)
    assert all(part.decimated == {} for part in other.parts)


def test_a_head_without_the_file(tmp_path: Path) -> None:
    assert read_decimated(tmp_path) == {}


def test_a_damaged_file_is_named(head: Head, tmp_path: Path) -> None:
    path = write_decimated(tmp_path, head.parts, {"a/full": head.part("a").triangles})
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(HeadFileError, match=FILE) as caught:
        read_decimated(tmp_path)
    assert "delete" in caught.value.hint
