"""Reading of single names: parameters with their sides, gaze told by two sides, presets, and names of nothing."""

import pytest

from surface.fit.source.naming.wordings import (
    COPY,
    Meaning,
    is_junk,
    names_table,
    presets_table,
    read_name,
    read_preset,
    sums,
)
from surface.head.model.parameters import SHAPES


@pytest.mark.parametrize(
    ("name", "meaning"),
    [
        ("eyeBlinkLeft", Meaning("eyeBlink", "Left", True)), ("EYE_BLINK_R", Meaning("eyeBlink", "Right", True)),
        ("jawOpen", Meaning("jawOpen", "", True)), ("browInnerUp_rgt", Meaning("browInnerUp", "Right", True)),
        ("mouthSmile_lft", Meaning("mouthSmile", "Left", True)), ("AU12", Meaning("mouthSmile")),
        ("lipCornerPuller.L", Meaning("mouthSmile", "Left")),
        ("blendShape2.lid_tightener_R", Meaning("eyeSquint", "Right")),
        ("Head|node:eyeWideLeft", Meaning("eyeWide", "Left", True)), ("jawOpen.001", Meaning("jawOpen", "", True)),
        ("jawOpen_copy", Meaning("jawOpen", "", True)), ("A06_Eye_Blink_Left", Meaning("eyeBlink", "Left", True)),
        ("shape 12 jawOpen", Meaning("jawOpen", "", True)), ("FACS.AU45_L", Meaning("eyeBlink", "Left")),
    ],
)  # fmt: skip
def test_a_name_means_a_parameter_and_a_side(name: str, meaning: Meaning) -> None:
    assert read_name(name) == meaning


def test_every_parameter_means_itself_however_it_is_written() -> None:
    for shape in SHAPES:
        found = read_name(shape)
        assert found is not None and found.plain and found.key + found.side == shape
        words = "".join(f"_{c}" if c.isupper() else c for c in shape)
        assert read_name(words) == read_name(words.upper()) == found


def test_gaze_by_two_sides_is_out_where_they_agree_and_belongs_to_the_eye() -> None:
    """The eye's side stands before the word look, or else last."""
    for eye, towards, key in (("L", "R", "In"), ("L", "L", "Out"), ("R", "L", "In"), ("R", "R", "Out")):
        side = {"L": "Left", "R": "Right"}[eye]
        wanted = Meaning(f"eyeLook{key}", side)
        word = {"L": "Left", "R": "Right"}[towards]
        assert read_name(f"Eye_{eye}_Look_{towards}") == wanted
        assert read_name(f"eyeLook{word}{eye}") == wanted
        assert read_name(f"eyesLook_{word}_{eye}") == wanted
        assert read_name(f"eyelook_{towards}_{eye}") == read_name(f"EYELOOK_{towards}_{eye}") == wanted
    assert read_name("Eye_L_Blink_R") is None and read_name("Eye_L_Look_R_L") is None


@pytest.mark.parametrize("name", ["", "eyeBlink_L_R", "PupilDilate", "AU26x", "L", "12"])
def test_what_means_nothing_or_several_things_is_none(name: str) -> None:
    assert read_name(name) is None


def test_one_word_for_a_part_and_a_side_is_two_words() -> None:
    split = {w: read_name(f"mouthUpper_{w}") for w in ("ul", "lu", "ur")}
    assert (split["ul"] == split["lu"] and split["ul"] != split["ur"]) or split["ul"] is None


def test_presets_are_read_in_every_vocabulary_and_after_beginnings() -> None:
    assert read_preset("Joy") == read_preset("happy") == "happy" and read_preset("Fcl_MTH_A") in (None, "vowel_a")
    assert read_preset("aa") == read_preset("A") == "vowel_a" and read_preset("Look Up") == "look_up"
    assert read_preset("expression.aa") == "vowel_a" and read_preset("blah") is None


def test_names_of_no_expression_are_junk() -> None:
    for name in ("Basis", "base", "Key 1", "shape key", "Neutral.001", "17", "_"):
        assert is_junk(name), name
    for name in ("jawOpen", "Basis smile", "ear"):
        assert not is_junk(name), name


def test_shapes_that_make_a_parameter_together_are_told_apart_by_their_own_ways() -> None:
    every = sums()
    assert every
    for key, groups in every.items():
        for group in groups:
            assert group and len(set(group)) == len(group) and all(w.startswith(f"{key}/") for w in group)
    vocabularies = [v for v in names_table().values() if isinstance(v, dict)]
    for table in vocabularies:
        for key, ways in table.get("sum", {}).items():
            for way in ways:
                found = read_name(way.replace(" ", "_"))
                assert found is not None and found.key in {key, f"{key}/{way.replace(' ', '').lower()}"}


def test_every_way_in_the_tables_is_read_as_what_it_is_a_way_for() -> None:
    for vocabulary in (v for v in names_table().values() if isinstance(v, dict)):
        for key, ways in vocabulary.items():
            for way in ways if isinstance(ways, list) else ():
                assert read_name(way) is not None, way
                assert isinstance(key, str)
    for vocabulary in (v for v in presets_table().values() if isinstance(v, dict)):
        for ways in vocabulary.values():
            for way in ways if isinstance(ways, list) else ():
                assert read_preset(way) is not None, way


@pytest.mark.parametrize(
    ("name", "copy"), [("a.001", True), ("a_012", True), ("a copy", True), ("a_1", False), ("a_123", False)]
)
def test_what_programs_add_to_copies_is_left_out(name: str, copy: bool) -> None:
    assert (COPY.sub("", name) == "a") == copy
