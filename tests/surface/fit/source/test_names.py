"""Shape names of other heads."""

from dataclasses import replace

import numpy as np
import pytest
from slit_sheet import slit_sheet

from surface.base.errors import FitError
from surface.fit.source.names import Source, map_names, read_names, sources_of
from surface.fit.source.shapes import to_arkit
from surface.head.model.parameters import SHAPES


def test_sides_are_renamed_and_halves_are_joined():
    found = sources_of(("jawOpen", "eyeBlink_L", "eyeBlink_R", "browInnerUp_L", "browInnerUp_R", "PupilDilate_L"))
    assert found == {"eyeBlinkLeft": [1], "eyeBlinkRight": [2], "jawOpen": [0], "browInnerUp": [3, 4]}


def test_a_lone_half_is_left_out_and_own_names_pass():
    assert sources_of(("browInnerUp_L",)) == {}
    assert sources_of(SHAPES) == {name: [i] for i, name in enumerate(SHAPES)}


@pytest.mark.parametrize(
    ("theirs", "ours"),
    [
        ("Eye_Blink_L", "eyeBlinkLeft"), ("EyeBlinkRight", "eyeBlinkRight"), ("eyeblink.l", "eyeBlinkLeft"),
        ("Left_Mouth_Smile", "mouthSmileLeft"), ("blendShape1.mouthSmile_R", "mouthSmileRight"),
        ("Mouth_Up_Upper_L", "mouthUpperUpLeft"), ("Brow_Raise_Outer_R", "browOuterUpRight"), ("Jaw_L", "jawLeft"),
        ("mouth_right", "mouthRight"), ("AU12_L", "mouthSmileLeft"), ("AU09_R", "noseSneerRight"),
        ("AU17", "mouthShrugLower"), ("Nose_Wrinkler_Left", "noseSneerLeft"), ("tongue_out", "tongueOut"),
        ("mouthRollUpper", "mouthRollUpper"), ("JAW_OPEN", "jawOpen"), ("cheekRaiser_L", "cheekSquintLeft"),
    ],
)  # fmt: skip
def test_other_ways_to_say_it(theirs, ours):
    assert list(map_names((theirs,)).sources) == [ours]


@pytest.mark.parametrize("name", ["AU26", "AU28", "AU61", "smileBlinkLeft", "eyeBlink_L_R", "Left", "Blah"])
def test_what_could_mean_several_things_is_left_out(name):
    found = map_names((name,))
    assert found.sources == {} and found.left_out == (name,) and found.missing == SHAPES


def test_a_common_beginning_is_passed_over():
    names = tuple(f"CC_Base_Body_{n}" for n in ("Jaw_Open", "Eye_Blink_L", "Eye_Blink_R", "Mouth_Pucker", "Ear_Up_L"))
    found = map_names(names)
    assert set(found.sources) == {"jawOpen", "eyeBlinkLeft", "eyeBlinkRight", "mouthPucker"}
    assert found.left_out == ("CC_Base_Body_Ear_Up_L",)


def test_exact_names_win_over_others_and_sides_over_both():
    found = map_names(("cheekRaiser_L", "cheekSquintLeft", "mouthSmile", "mouthSmileLeft", "mouthSmile_R"))
    assert found.sources["cheekSquintLeft"] == [Source(1)]
    assert found.sources["mouthSmileLeft"] == [Source(3)] and found.sources["mouthSmileRight"] == [Source(4)]


def test_a_shape_for_both_sides_is_cut_down_the_middle():
    mesh = slit_sheet()
    field = np.ones_like(mesh.deltas[:1])
    mesh = replace(mesh, names=("eyeBlink",), deltas=field)
    found = map_names(mesh.names)
    assert found.sources["eyeBlinkLeft"] == [Source(0, "Left")]
    made = to_arkit(mesh, found)
    left, right = made.deltas[made.names.index("eyeBlinkLeft")], made.deltas[made.names.index("eyeBlinkRight")]
    np.testing.assert_allclose(left + right, field[0])
    assert (left[mesh.vertices[:, 0] > 15] == 1).all() and (left[mesh.vertices[:, 0] < -15] == 0).all()
    assert map_names(("jaw",)).sources == {}


def test_halves_add_up():
    mesh = replace(slit_sheet(), names=("cheekPuff_L", "cheekPuff_R"))
    np.testing.assert_allclose(to_arkit(mesh, map_names(mesh.names)).deltas[0], slit_sheet().deltas.sum(axis=0))


def test_a_table_of_ones_own_comes_first(tmp_path):
    table = tmp_path / "names.toml"
    table.write_text('[names]\n"Grinsen links" = "mouthSmileLeft"\nmouthSmile_L = "mouthDimpleLeft"\n')
    found = map_names(("mouthSmile_L", "Grinsen links"), read_names(table))
    assert found.sources == {"mouthSmileLeft": [Source(1)], "mouthDimpleLeft": [Source(0)]}


@pytest.mark.parametrize(("text", "message"), [
    ("[names", "not valid TOML"), ("a = 1", r"no table \[names\]"), ('[names]\na = "smile"', "'smile' is not one of"),
])  # fmt: skip
def test_a_wrong_table_is_refused(tmp_path, text, message):
    table = tmp_path / "names.toml"
    table.write_text(text)
    with pytest.raises(FitError, match=message):
        read_names(table)
