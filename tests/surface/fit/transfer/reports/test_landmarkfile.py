"""Files of picked landmarks."""

import re
from pathlib import Path

import numpy as np
import pytest

from surface.base.errors import FitError
from surface.fit.transfer.reports.landmarkfile import read_landmarks, swapped
from surface.fit.transfer.scan import make_scan
from surface.fit.transfer.template import NAMES

ROOT = Path(__file__).parents[5]

SCAN = make_scan(np.array([[0, 0, 0], [9, 0, 0], [9, 9, 0], [0, 9, 9]], float), np.array([[0, 1, 2], [0, 2, 3]]), "x")
PICKED = """<!DOCTYPE PickedPoints><PickedPoints><DocumentData/>
<point x="1" y="2" z="0.5" name="chin" active="1"/><point x="0" y="0" z="0" name="0" active="0"/></PickedPoints>"""


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.toml", "[landmarks]\nchin = [1, 2, 0.5]\nnose_tip = 2\n"),
        ("a.toml", "chin = [1.0, 2.0, 0.5]\nnose_tip = 2\n"),
        ("a.json", '{"landmarks": {"chin": [1, 2, 0.5], "nose_tip": {"vertex": 2}}}'),
    ],
)
def test_places_and_vertices_are_read(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    found = read_landmarks(tmp_path / name, SCAN)
    np.testing.assert_allclose(found["chin"], [1, 2, 0.5])
    np.testing.assert_allclose(found["nose_tip"], [9, 9, 0])


def test_active_points_picked_in_meshlab_are_read(tmp_path):
    (tmp_path / "a.pp").write_text(PICKED)
    found = read_landmarks(tmp_path / "a.pp", SCAN)
    assert list(found) == ["chin"] and found["chin"].tolist() == [1, 2, 0.5]


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.txt", "", "is none of .toml, .json, .pp"),
        ("a.toml", "", "holds no landmark"),
        ("a.toml", "chin = [1, 2", "a.toml"),
        ("a.toml", "nose = [1, 2, 0]", "nose: is no landmark"),
        ("a.toml", "chin = [1, 2]", "chin: .* neither a place nor a vertex"),
        ("a.toml", "chin = [1, 2, inf]", "neither a place"),
        ("a.toml", "chin = true", "neither a place"),
        ("a.toml", "chin = 4", "there is no vertex 4"),
        ("a.toml", "chin = [1000, 2000, 500]", r"outside the mesh.*\(0, 0, 0\)"),
        ("a.json", "[1, 2]", "no table of landmarks"),
        ("a.json", "{", "a.json"),
        ("a.pp", "<points", "no XML"),
        ("a.pp", PICKED.replace('"1" y', '"one" y'), "neither a place"),
        ("a.pp", PICKED.replace('name="0" active="0"', 'name="chin"'), "picked twice"),
    ],
)
def test_every_mistake_is_named(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    with pytest.raises(FitError, match=message) as caught:
        read_landmarks(tmp_path / name, SCAN)
    assert caught.value.hint or name in str(caught.value)


def test_sides_are_exchanged():
    assert set(swapped({"left_eye_inner": SCAN.vertices[0], "chin": SCAN.vertices[1]})) == {"right_eye_inner", "chin"}


VIEW = """
[picture]
turn = [1, 0, 0, 0, 1, 0, 0, 0, 1]
scale = 10.0
shift = [20.0, -100.0, 0.0]
"""


def test_a_pixel_is_the_foremost_place_of_the_scan_there(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text("[landmarks]\nchin = { pixel = [65, 55] }\n" + VIEW)  # x 4.5, y 4.5
    wall = np.array([[0, 0, -5], [9, 0, -5], [9, 9, -5], [0, 9, -5]], float)
    sheets = np.vstack([wall, wall + np.array([0, 0, 8.0])])
    both = make_scan(sheets, np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]), "x")
    np.testing.assert_allclose(read_landmarks(path, both)["chin"], [4.5, 4.5, 3.0], atol=1e-6)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[landmarks]\nchin = { pixel = [65, 55] }\n", "no table .picture"),
        ("[landmarks]\nchin = { pixel = [65] }\n" + VIEW, "is no pixel"),
        ("[landmarks]\nchin = { pixel = [650, 550] }\n" + VIEW, "shows nothing at pixel"),
        ("[landmarks]\nchin = 2\n" + VIEW.replace("10.0", "nan"), "no view that omote landmarks writes"),
        ("[landmarks]\nchin = 2\n" + VIEW.replace("[1, 0, 0, 0", "[1, 1, 0, 0"), "no view"),
        ("[landmarks]\nchin = 2\n" + VIEW.replace("scale", "size"), "no view"),
    ],
)
def test_pixels_and_views_that_are_none_are_named(tmp_path, text, message):
    (tmp_path / "a.toml").write_text(text)
    with pytest.raises(FitError, match=message) as caught:
        read_landmarks(tmp_path / "a.toml", SCAN)
    assert "a.toml" in str(caught.value) and caught.value.hint


def test_the_example_of_the_documentation_is_read(tmp_path):
    blocks = re.findall(r"```toml\n(.*?)```", (ROOT / "docs" / "heads.md").read_text(encoding="utf-8"), re.DOTALL)
    (example,) = (block for block in blocks if "[landmarks]" in block)
    (tmp_path / "a.toml").write_text(example)
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-8, 8, 70), np.linspace(-9, 14, 70)))
    at = np.arange(4900).reshape(70, 70)
    triangles = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, 1:]], axis=-1).reshape(-1, 3)
    scan = make_scan(np.column_stack([x, y, 14 - 0.1 * x**2]), triangles, "scan.obj")
    found = read_landmarks(tmp_path / "a.toml", scan)
    assert len(found) >= 8 and set(found) <= set(NAMES)
    np.testing.assert_array_equal(found["mouth_left"], scan.vertices[scan.original[3512]])
