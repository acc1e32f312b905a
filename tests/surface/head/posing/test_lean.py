"""surface.head.posing.lean"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_head import small_head

from surface.base.errors import HeadFileError
from surface.head import Head
from surface.head.posing.lean import FILE, apply_lean, read_lean, write_lean


@pytest.fixture(scope="module")
def head() -> Head:
    return Head(small_head())


def test_triangles_survive_the_file(head: Head, tmp_path: Path) -> None:
    few = head.part("a").triangles[::2]
    assert write_lean(tmp_path, head.parts, {"a/fast": few}) == tmp_path / FILE
    apply_lean(head.parts, read_lean(tmp_path / "head.toml"))
    assert head.part("a").lean.keys() == {"fast"}
    assert np.array_equal(head.part("a").lean["fast"], few)
    assert head.part("b").lean == {}
    assert [entry.name for entry in tmp_path.iterdir()] == [FILE]


def test_another_tessellation_or_an_index_out_of_range_is_passed_over(head: Head, tmp_path: Path) -> None:
    other = Head(small_head())
    triangles = other.part("a").triangles
    write_lean(tmp_path, head.parts, {"a/fast": triangles, "b/fast": triangles + len(head.part("b").vertices)})
    lean = read_lean(tmp_path)
    other.part("a").triangles = triangles[::-1].copy()
    apply_lean(other.parts, lean)
    assert all(part.lean == {} for part in other.parts)


def test_a_head_without_the_file(tmp_path: Path) -> None:
    assert read_lean(tmp_path) == {}


def test_a_damaged_file_is_named(head: Head, tmp_path: Path) -> None:
    path = write_lean(tmp_path, head.parts, {"a/full": head.part("a").triangles})
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(HeadFileError, match=FILE) as caught:
        read_lean(tmp_path)
    assert "delete" in caught.value.hint
