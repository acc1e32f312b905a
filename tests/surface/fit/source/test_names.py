"""Shape names of other heads."""

from dataclasses import replace

import numpy as np
import pytest
from slit_sheet import slit_sheet

from surface.base.errors import FitError
from surface.fit.source.names import Source, map_names, read_names, sources_of
from surface.fit.source.naming.namenotes import name_notes
from surface.fit.source.naming.shapes import empty_shapes, to_arkit
from surface.fit.source.naming.wordings import names_table, presets_table
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


@pytest.mark.parametrize("names", [("Mouth_Open", "Jaw_Open"), ("Jaw_Open", "Mouth_Open")])
def test_arkits_own_words_win_over_other_ways_to_say_the_same(names):
    found = map_names(names)
    assert found.sources["jawOpen"] == [Source(names.index("Jaw_Open"))] and found.spare == ("Mouth_Open",)
    two = map_names(("Mouth_Open", "open_mouth"))
    assert two.sources["jawOpen"] == [Source(0)]  # among other ways the file's order counts


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
    one = map_names(("Blink", "blink_l")).sources  # the other side is half of the shape for both
    assert one == {"eyeBlinkLeft": [Source(1)], "eyeBlinkRight": [Source(0, "Right")]}


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


@pytest.mark.parametrize(
    ("theirs", "ours"),
    [
        # Character Creator
        ("A14_Eye_Blink_Left", "eyeBlinkLeft"), ("Eye_L_Look_L", "eyeLookOutLeft"), ("Eye_R_Look_L", "eyeLookInRight"),
        ("Eye_L_Look_Up", "eyeLookUpLeft"), ("Mouth_Roll_In_Upper", "mouthRollUpper"), ("Jaw_Open", "jawOpen"),
        ("Nose_Flank_Raise_R", "noseSneerRight"), ("A01_Brow_Inner_Up", "browInnerUp"),
        # MetaHuman
        ("CTRL_expressions_jawOpen", "jawOpen"), ("CTRL_expressions_mouthCornerPullL", "mouthSmileLeft"),
        ("CTRL_expressions_eyeLookLeftL", "eyeLookOutLeft"), ("CTRL_expressions_eyeLookRightL", "eyeLookInLeft"),
        ("CTRL_expressions_eyeLookLeftR", "eyeLookInRight"), ("CTRL_expressions_eyeBlinkR", "eyeBlinkRight"),
        ("CTRL_expressions_browRaiseOuterL", "browOuterUpLeft"), ("CTRL_expressions_jawFwd", "jawForward"),
        # VRoid, VRM, VRChat, MikuMikuDance, faceshift, MakeHuman, copies
        ("Fcl_EYE_Close_L", "eyeBlinkLeft"), ("Face.M_F00_000_00_Fcl_EYE_Close_R", "eyeBlinkRight"),
        ("blink_r", "eyeBlinkRight"), ("vrc.blink_left", "eyeBlinkLeft"), ("\u30a6\u30a3\u30f3\u30af\u53f3", ""),
        ("EyeOpen_L", "eyeWideLeft"), ("BrowsU_C", "browInnerUp"), ("BrowsU_L", "browOuterUpLeft"),
        ("eye-left-closure", "eyeBlinkLeft"), ("eyebrows-right-extern-up", "browOuterUpRight"),
        ("jawOpen.001", "jawOpen"), ("blendShape1.jaw_Open", "jawOpen"), ("LipSuckUpper", "mouthRollUpper"),
    ],
)  # fmt: skip
def test_spellings_of_other_makers(theirs, ours):
    assert list(map_names((theirs,)).sources) == [ours] * bool(ours)


def test_shapes_that_make_one_together_are_all_needed():
    quarters = [f"Mouth_Funnel_{v}_{s}" for v in ("Up", "Down") for s in "LR"]
    found = map_names((*quarters, "Jaw_Open"))
    assert {s.index for s in found.sources["mouthFunnel"]} == {0, 1, 2, 3} and found.left_out == ()
    assert "mouthFunnel" not in map_names((*quarters[:3], "Jaw_Open")).sources
    curves = [f"CTRL_expressions_mouthLipsPurse{v}{s}" for v in "UD" for s in "LR"]
    assert {s.index for s in map_names(tuple(curves)).sources["mouthPucker"]} == {0, 1, 2, 3}
    assert {s.index for s in map_names(("jawChinRaiseDL", "jawChinRaiseDR")).sources["mouthShrugLower"]} == {0, 1}


@pytest.mark.parametrize(
    "names",
    [
        ("A", "I", "U", "E", "O", "Joy"), ("aa", "ih", "ou", "ee", "oh", "happy"),
        ("viseme_aa", "viseme_I", "viseme_U", "viseme_E", "viseme_O", "Joy"),
        ("viseme_2", "viseme_6", "viseme_7", "viseme_4", "viseme_8", "Joy"),
        ("v_aa", "v_ih", "v_ou", "v_e", "v_oh", "Joy"),
        ("Fcl_MTH_A", "Fcl_MTH_I", "Fcl_MTH_U", "Fcl_MTH_E", "Fcl_MTH_O", "Fcl_ALL_Joy"),
        ("V_Open", "V_Wide", "V_Tight", "", "V_Tight_O", "Joy"),
        ("\u3042", "\u3044", "\u3046", "\u3048", "\u304a", "Joy"),
    ],
)  # fmt: skip
def test_vowels_and_moods_stand_in_where_there_is_nothing_else(names):
    found = map_names(names)
    assert found.sources["jawOpen"] == [Source(0, "", "mouth")]
    assert found.sources["mouthStretchRight"] == [Source(1, "Right", "mouth", 0)]
    assert found.sources["mouthPucker"] == [Source(2, "", "mouth", 0)]
    assert found.sources["mouthFunnel"] == [Source(4, "", "mouth", 0)]
    assert found.sources["mouthSmileLeft"] == [Source(5, "Left", "mouth", 0)]
    assert found.left_out == () and "jawOpen" in found.stand_ins


def test_shapes_of_their_own_win_and_presets_are_said_to_be_understood():
    found = map_names(("viseme_aa", "jawOpen", "viseme_sil", "Fcl_ALL_Neutral", "Key 1", "Basis", "Angry"), empty={2})
    assert found.sources["jawOpen"] == [Source(1)] and found.presets == ("viseme_aa", "Fcl_ALL_Neutral")
    assert found.empty == ("viseme_sil",) and found.left_out == ()
    assert set(found.stand_ins) == {"browDownLeft", "browDownRight", "mouthFrownLeft", "mouthFrownRight"}


def test_a_mood_cut_by_its_maker_is_better_than_one_cut_here():
    found = map_names(("Fcl_ALL_Angry", "Fcl_BRW_Angry", "Fcl_MTH_Sorrow", "Fcl_ALL_Sorrow"))
    assert found.sources["browDownLeft"] == [Source(1, "Left")]
    assert found.sources["mouthFrownRight"] == [Source(2, "Right")]


def test_an_empty_shape_counts_for_nothing():
    mesh = slit_sheet()
    deltas = np.concatenate([mesh.deltas, np.full_like(mesh.deltas[:1], 1e-4)])
    mesh = replace(mesh, names=("jawOpen", "A", "mouthPucker"), deltas=deltas * np.array([0.0, 1, 1])[:, None, None])
    assert empty_shapes(mesh) == {0, 2}
    found = map_names(mesh.names, empty=empty_shapes(mesh))
    assert found.sources == {"jawOpen": [Source(1, "", "mouth")]} and found.empty == ("jawOpen", "mouthPucker")
    assert "mouthPucker" in found.missing


def test_other_names_of_a_shape_count_where_its_own_is_not_understood():
    found = map_names(("target0", "jawOpen", "target2"), other={0: ["joy"], 1: ["aa"], 2: ["My own"]})
    assert found.sources["jawOpen"] == [Source(1)] and found.sources["mouthSmileLeft"][0].index == 0
    assert found.left_out == ("target2",)


def test_moods_are_cut_into_regions_and_less_what_a_vowel_does():
    mesh = slit_sheet()
    up = mesh.vertices[:, 1]
    mouth, lids, brows = (np.exp(-(((up - y) / 8.0) ** 2))[:, None] * [0, 1.0, 0] for y in (-50, 40, 75))
    wide = np.exp(-(((up + 50) / 8.0) ** 2))[:, None] * [0, 0, 1.0]
    joy = 0.5 * mouth + 2.0 * wide + 3.0 * lids + 4.0 * brows
    mesh = replace(mesh, names=("A", "Blink", "Joy", "Angry"), deltas=np.stack([mouth, lids, joy, joy]))
    made = to_arkit(mesh, map_names(mesh.names))
    moves = dict(zip(made.names, made.deltas, strict=True))
    smile = moves["mouthSmileLeft"] + moves["mouthSmileRight"]
    np.testing.assert_allclose(smile, 2.0 * wide, atol=0.01)
    frown = moves["browDownLeft"] + moves["browDownRight"]
    np.testing.assert_allclose(frown[up > 72], 4.0 * brows[up > 72], atol=0.02)
    assert np.abs(frown[up < 50]).max() < 0.1 and np.abs(joy[up < 50]).max() > 2.5


def test_every_vocabulary_has_a_source_and_every_row_means_a_parameter():
    presets, names = presets_table(), names_table()
    for table in [v for t in (presets, names) for v in t.values() if isinstance(v, dict)]:
        assert len(table["source"]) > 20
    keys = {k for v in presets.values() if isinstance(v, dict) for k in v} - {"source"}
    for row in presets["stand_in"]:
        assert row["from"] in keys and row.get("less", "vowel_a") in keys and row.get("region", "mouth")
        assert any(s.startswith(row["parameter"]) for s in SHAPES)
    known = {*names["sided"], *names["sideways"], *names["whole"]}
    for vocabulary in [v for v in names.values() if isinstance(v, dict)]:
        assert {*vocabulary} - {"source", "sum"} <= known and {*vocabulary.get("sum", {})} <= known


def test_notes_say_what_was_made_of_what():
    names = ("A", "Blink", "O", "viseme_sil", "blink_l", "eyeBlinkLeft", "Joy")
    notes = name_notes(names, map_names(names, empty={3}))
    assert "jawOpen is made from 'A' about the mouth" in notes
    assert "mouthFunnel is made from 'O' about the mouth, less its share of 'A'" in notes
    assert "mouthSmileLeft and Right are made from the halves of 'Joy' about the mouth, less its share of 'A'" in notes
    assert (
        notes[0] == "7 shapes: 5 make 6 parameters, 1 doubled, 1 empty"
        and notes[-1] == "empty, they move nothing: viseme_sil"
    )
    counted = name_notes(("jawOpen", "A", "odd", "jaw_open"), map_names(("jawOpen", "A", "odd", "jaw_open")))
    assert counted[0] == "4 shapes: 1 make 1 parameters, 1 presets and visemes, 1 doubled, 1 not understood"
    only = map_names(("target0",), other={0: ["Joy"]})
    assert name_notes(("target0",), only, {0: ["Joy"]})[1:] == [
        "mouthSmileLeft and Right are made from the halves of 'Joy' (target0)"
    ]


def test_a_mood_that_opens_the_mouth_comes_after_one_that_does_not():
    names = ("A", "Joy", "Fun", "Sorrow", "Angry")
    plain = map_names(names)
    assert [plain.sources[p][0].index for p in ("mouthSmileLeft", "mouthFrownLeft")] == [1, 3]
    wide = map_names(names, share=lambda shape, of: 0.9 if of == 0 and shape in (1, 3) else 0.1)
    assert [wide.sources[p][0].index for p in ("mouthSmileLeft", "mouthFrownLeft")] == [2, 4]
    alone = map_names(names[:2], share=lambda shape, of: 0.9)
    assert alone.sources["mouthSmileRight"] == [Source(1, "Right", "mouth", 0)]


def test_brows_that_are_pieces_belong_to_the_brows():
    mesh = slit_sheet()
    up = mesh.vertices[:, 1]
    field = np.exp(-(((up - 40) / 20.0) ** 2))[:, None] * [0, 1.0, 0]
    mouth = np.exp(-(((up + 50) / 8.0) ** 2))[:, None] * [0, 1.0, 0]
    high = (up[mesh.faces].mean(axis=1) > 55).astype(int)
    mesh = replace(mesh, names=("A", "Blink", "Angry"), deltas=np.stack([mouth, field, 5 * field]),
                   piece=high, pieces=("Face", "FaceBrow"))  # fmt: skip
    made = to_arkit(mesh, map_names(mesh.names))
    frown = sum(d for n, d in zip(made.names, made.deltas, strict=True) if n.startswith("browDown"))
    brow = np.unique(mesh.faces[high == 1])
    np.testing.assert_allclose(frown[brow], 5 * field[brow])
    assert np.abs(frown[up < 30]).max() < 0.3
