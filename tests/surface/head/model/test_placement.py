"""The placement of a head: there and back, in head.toml, absent from older ones."""

from dataclasses import replace

import numpy as np
import pytest
from small_head import small_head

from surface.base.errors import HeadFileError
from surface.head.model.file import load_data, save_data
from surface.head.model.placement import Placement

TURN = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])
PLACED = Placement(TURN, 10.0, np.array([1.0, -2.0, 3.5]), "cm")


def test_there_and_back():
    rows = np.random.default_rng(1).normal(size=(7, 3))
    np.testing.assert_allclose(PLACED.points(rows), 10.0 * rows[:, [1, 2, 0]] + [1.0, -2.0, 3.5])
    np.testing.assert_allclose(PLACED.file_points(PLACED.points(rows)), rows)
    np.testing.assert_allclose(PLACED.file_moves(PLACED.moves(rows)), rows)
    np.testing.assert_allclose(PLACED.file_directions(rows @ TURN.T), rows)
    np.testing.assert_allclose(PLACED.moved(np.ones(3)).points(rows), PLACED.points(rows) + 1.0)


def test_head_toml_keeps_it(tmp_path):
    save_data(tmp_path / "h", replace(small_head(), placement=PLACED))
    got = load_data(tmp_path / "h").placement
    np.testing.assert_allclose(got.turn, TURN)
    np.testing.assert_allclose(got.shift, PLACED.shift)
    assert (got.scale, got.unit) == (10.0, "cm")


@pytest.mark.parametrize(("off", "is_rotation"), [(5e-5, True), (2e-4, False)])
def test_a_rotation_may_be_rounded_to_four_decimals(tmp_path, off, is_rotation):
    turn = np.array([[np.cos(0.3), -np.sin(0.3), 0.0], [np.sin(0.3), np.cos(0.3), 0.0], [0.0, 0.0, 1.0 + 0.5 * off]])
    save_data(tmp_path / "h", replace(small_head(), placement=Placement(turn)))
    if is_rotation:
        np.testing.assert_allclose(load_data(tmp_path / "h").placement.turn, turn)
    else:
        with pytest.raises(HeadFileError, match=r"placement\.turn: is no rotation"):
            load_data(tmp_path / "h")


def test_an_older_folder_has_none(tmp_path):
    save_data(tmp_path / "h", small_head())
    assert "placement" not in (tmp_path / "h" / "head.toml").read_text()
    assert load_data(tmp_path / "h").placement is None


@pytest.mark.parametrize(("key", "value", "match"), [
    ("scale = 10.0", "scale = 0.0", r"placement\.scale: 0 is not greater"),
    ("scale = 10.0", "scale = 'x'", r"placement\.scale"),
    ('unit = "cm"', "unit = 3", r"placement\.unit"),
    ("3.5,", "3.5, 5.0,", r"placement\.shift"),
])  # fmt: skip
def test_damage_is_named(tmp_path, key, value, match):
    save_data(tmp_path / "h", replace(small_head(), placement=PLACED))
    file = tmp_path / "h" / "head.toml"
    text = file.read_text()
    assert key in text
    file.write_text(text.replace(key, value))
    with pytest.raises(HeadFileError, match=match):
        load_data(tmp_path / "h")


def test_a_mirror_is_no_rotation(tmp_path):
    save_data(tmp_path / "h", replace(small_head(), placement=Placement(np.diag([-1.0, 1, 1]))))
    with pytest.raises(HeadFileError, match=r"placement\.turn: is no rotation"):
        load_data(tmp_path / "h")
