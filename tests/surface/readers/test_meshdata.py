"""surface.readers.meshdata"""

import os

import pytest

from surface.base.errors import FitError
from surface.base.files import DATA_LIMIT
from surface.readers.meshdata import MAX_MOVES, MAX_VERTICES, check_size, read_bytes


def test_limits_themselves_are_allowed():
    check_size("m", MAX_VERTICES, MAX_MOVES // MAX_VERTICES)
    check_size("m", 0, 10**9)


def test_one_more_is_refused():
    with pytest.raises(FitError, match="m: 400001 vertices; 400000 are the most") as caught:
        check_size("m", MAX_VERTICES + 1, 0)
    assert "decimate" in caught.value.hint
    with pytest.raises(FitError, match="m: 101 shapes of 400000 vertices are too many") as caught:
        check_size("m", MAX_VERTICES, MAX_MOVES // MAX_VERTICES + 1)
    assert "leave out shapes" in caught.value.hint


def test_a_file_is_read_whole(tmp_path):
    (tmp_path / "m.obj").write_bytes(b"\x00\xffabc")
    assert read_bytes(tmp_path / "m.obj") == b"\x00\xffabc"


def test_a_sparse_file_beyond_the_limit_is_not_read(tmp_path):
    path = tmp_path / "m.glb"
    path.touch()
    os.truncate(path, DATA_LIMIT + 1)  # takes no space on disk
    with pytest.raises(FitError, match=r"is larger than 1024 MB"):
        read_bytes(path)


def test_missing_files_and_folders_say_what_to_do(tmp_path):
    for path, why, hint in ((tmp_path / "no.glb", "no such mesh file", "give the path"),
                            (tmp_path, "cannot be read: is a folder", "ls -l"),
                            (tmp_path / "a\0b", "no such mesh file", "give the path")):  # fmt: skip
        with pytest.raises(FitError, match=why) as caught:
            read_bytes(path)
        assert hint in caught.value.hint
