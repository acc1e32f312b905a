"""surface.readers.meshdata"""

import os

import numpy as np
import pytest

from surface.base.errors import FitError
from surface.base.files import DATA_LIMIT
from surface.readers.meshdata import (
    MAX_MOVES,
    MAX_VERTICES,
    Material,
    check_size,
    kind_of_picture,
    linear,
    read_bytes,
)


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


def test_shades_of_srgb_become_linear():
    srgb = np.array([0.0, 0.02, 0.04045, 0.0405, 0.5, 1.0])
    wanted = [0.0, 0.02 / 12.92, 0.04045 / 12.92, (0.0955 / 1.055) ** 2.4, (0.555 / 1.055) ** 2.4, 1.0]
    np.testing.assert_allclose(linear(srgb), wanted, rtol=1e-12)


@pytest.mark.parametrize(
    ("data", "kind"),
    [(b"\x89PNG\r\n", "image/png"), (b"\xff\xd8\xff\xe0", "image/jpeg"), (b"RIFF1234WEBP", "image/webp"),
     (b"GIF89", ""), (b"", ""), (b" \x89PNG", "")],
)  # fmt: skip
def test_pictures_are_told_by_their_first_bytes(data, kind):
    assert kind_of_picture(data) == kind


def test_places_in_a_picture_run_down():
    uv = np.array([[0.0, 0.0], [1.0, 1.0], [0.25, 0.75]])
    np.testing.assert_allclose(Material().in_picture(uv), [[0, 1], [1, 0], [0.25, 0.25]])
    turned = Material(image_of_uv=((0.0, 2.0, 3.0), (-4.0, 0.0, 5.0)))
    np.testing.assert_allclose(turned.in_picture(uv), [[3, 5], [5, 1], [4.5, 4]])
    assert (Material().alpha, Material().cutoff, Material().colour) == ("OPAQUE", 0.5, (1.0, 1.0, 1.0, 1.0))
