"""Surface files come back bit for bit, and bad ones say what is wrong."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from surface import DCPSurface
from surface.errors import SurfaceFileError
from surface.jsonfile import read_json, write_json
from tests.surface import shapes

GOOD = {
    "format": "omote-surface",
    "version": 1,
    "points": [[0, 0, 0], [1, 0, 0]],
    "knots_u": [[0, 0, 1], [0, 1, 1]],
    "knots_v": [[0, 1], [0, 1]],
}


def saved(tmp_path: Path, **changes: object) -> Path:
    data = {key: value for key, value in (GOOD | changes).items() if value is not None}
    path = tmp_path / "surface.json"
    path.write_text(json.dumps(data))
    return path


@pytest.mark.parametrize("closed", [None, (0.0, 1.0)])
def test_round_trip(tmp_path: Path, closed: tuple[float, float] | None) -> None:
    one = shapes.scattered(20, 3, degrees=(0, 7))
    surface = DCPSurface(one.points, one.weights, one.knots_u, one.knots_v, closed_u=closed)
    write_json(surface, tmp_path / "a.json")
    again = read_json(tmp_path / "a.json")
    assert again.closed == surface.closed
    for mine, theirs in zip(again.arrays(), surface.arrays(), strict=True):
        assert np.array_equal(mine, theirs)


def test_weights_may_be_left_out(tmp_path: Path) -> None:
    assert read_json(saved(tmp_path)).weights.tolist() == [1.0, 1.0]


def test_a_nurbs_file(tmp_path: Path) -> None:
    net = {"degree_u": 1, "degree_v": 1, "knots_u": [0, 0, 1, 1], "knots_v": [0, 0, 1, 1], "points": None}
    path = saved(tmp_path, control_points=[[[0, 0, 0], [0, 2, 0]], [[2, 0, 0], [2, 2, 0]]], **net)
    assert np.allclose(read_json(path).evaluate([[0.5, 0.25]]), [[1, 0.5, 0]])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": "other"}, 'no "format"'),
        ({"version": 2}, "version 2"),
        ({"knots_u": None}, "missing knots_u"),
        ({"colour": 1}, "unknown colour"),
        ({"knots_u": [[0, 0, 1], [1, 0, 1]]}, r"knots_u\[1\]: knots decrease at knot 1"),
        ({"points": [[0, 0, 0], [1, 0]]}, r"points\[1\]: shape \(2,\)"),
        ({"points": [[0, 0, 0], ["a", 0, 1]]}, r"points\[1\]: must be numbers"),
        ({"weights": [1, -1]}, r"weights\[1\]"),
        ({"closed_u": [1, 0]}, "closed_u"),
    ],
)
def test_bad_files_are_named(tmp_path: Path, changes: dict, message: str) -> None:
    path = saved(tmp_path, **changes)
    with pytest.raises(SurfaceFileError, match=message) as caught:
        read_json(path)
    assert str(path) in str(caught.value)
    assert caught.value.hint


def test_broken_json_names_the_line(tmp_path: Path) -> None:
    path = tmp_path / "broken.json"
    path.write_text('{\n"format": "omote-surface",\n"points": [[0, 0 0]]}')
    with pytest.raises(SurfaceFileError, match="line 3"):
        read_json(path)
    path.write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(SurfaceFileError, match="not a text file"):
        read_json(path)
    with pytest.raises(SurfaceFileError, match="cannot be read"):
        read_json(tmp_path / "absent.json")
