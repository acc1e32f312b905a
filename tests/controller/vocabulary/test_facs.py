"""FACS action units, both ways."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.base.errors import ConfigError, ParameterError
from controller.base.parameters import PARAMETERS as P
from controller.vocabulary.facs import Facs
from controller.vocabulary.vocabulary import Vocabulary

FACS = Facs.load(P)
EMOTIONS = [name for name, formula in FACS.emotions.items() if formula]


def show(formula: str) -> dict[str, float]:
    values = FACS.expand(formula)
    return {P.names[i]: round(float(values[i]), 6) for i in np.flatnonzero(values)}


def test_formulas() -> None:
    assert show("1+2") == {"browInnerUp": 1.0, "browOuterUpLeft": 1.0, "browOuterUpRight": 1.0}
    assert show("AU12C") == {"mouthSmileLeft": 0.6, "mouthSmileRight": 0.6}
    assert show("L12B + R14a") == {"mouthSmileLeft": 0.4, "mouthDimpleRight": 0.2}
    assert show("12LB") == {"mouthSmileLeft": 0.4}
    assert show("AUR12C+R14D") == show("R12C+R14D") == show("AU12RC+ADR14D") == show("RAU12C+14RD")
    assert show("R30") == {"jawRight": 1.0}
    assert show("43") == show("45") and show("AD34") == show("33")
    assert show("26") == {"jawOpen": 0.5} and show("27") == {"jawOpen": 1.0}
    assert show("") == {}
    assert FACS.expand("16+25+27+26").max() == 1.0


def test_intensities_are_letters_or_numbers() -> None:
    assert show("AU12:0.35+AU1:.5") == {"mouthSmileLeft": 0.35, "mouthSmileRight": 0.35, "browInnerUp": 0.5}
    assert show("L12:1") == show("L12") and show("12R:0.4") == show("R12B") and show("12:0") == {}


def test_units_that_arkit_lacks_and_those_of_the_head() -> None:
    assert {"mouthUpperUpLeft", "noseSneerRight"} < set(show("11")) and set(show("L11")) == {
        "mouthUpperUpLeft",
        "noseSneerLeft",
    }
    assert show("38") == {"noseSneerLeft": 0.15, "noseSneerRight": 0.15} and "cheekPuff" in show("13")
    assert show("51") == {"headYaw": 1.0} and show("52:0.5") == {"headYaw": -0.5}
    assert show("53") == {"headPitch": -1.0} and show("54B") == {"headPitch": 0.4}
    assert show("55") == {"headRoll": -1.0} and show("56") == {"headRoll": 1.0}
    assert show("51+52") == {} and set(show("57+58:0.5")) <= {"headPitch", "jawForward"}


@pytest.mark.parametrize("turned", ["51", "52+53", "61+64", "56"])
def test_a_head_that_turns_shows_no_other_emotion(turned: str) -> None:
    face = FACS.expand(FACS.emotions["happiness"] + "+" + turned)
    assert FACS.read_emotion(face)[0] == "happiness"


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        ("12:1.1", "must be 0 to 1, not '1.1'"),
        ("12:", "must be 0 to 1, not ''"),
        ("12:nan", "must be 0 to 1"),
        ("12:-0.1", "must be 0 to 1"),
        ("12B:0.5", "not an action unit"),
        ("12:0.5:1", "must be 0 to 1"),
        ("99", "unknown action unit '99'"),
        ("12F", "not an action unit"),
        ("L1", "has no sides"),
        ("L12R", "'L12R' is not an action unit"),
        ("1+", "'' is not an action unit"),
        ("1++2", "not an action unit"),
        ("+", "not an action unit"),
        ("AU", "not an action unit"),
        ("123", "not an action unit"),
        ("\u0661", "not an action unit"),
    ],
)
def test_wrong_formulas(formula: str, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        FACS.levels(formula)


def test_every_unit_reads_back_as_itself() -> None:
    for i, name in enumerate(FACS.names):
        if name.strip("LR") in ("11", "13", "23", "27", "38", "57", "58"):
            continue  # these share all their shapes: 23 with 24 and 28, 27 with 26, the others with 6, 9, 10, 29 and 53
        levels = np.zeros(len(FACS.names))
        levels[i] = 0.8
        read = FACS.read(FACS.matrix @ levels)
        assert int(np.argmax(read)) == i and read[i] == pytest.approx(0.8, abs=0.05), name


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(EMOTIONS), st.floats(0.3, 1.0))
def test_emotions_survive_the_way_to_parameters_and_back(name: str, intensity: float) -> None:
    found, level = FACS.read_emotion(FACS.expand(FACS.emotions[name], intensity))
    assert found == name
    assert level == pytest.approx(intensity, abs=0.05)


@pytest.mark.parametrize("intensity", [0.3, 0.6, 1.0])
def test_the_named_expressions_read_as_what_they_are_called(intensity: float) -> None:
    vocabulary = Vocabulary.load(P)
    for name in EMOTIONS:
        assert FACS.read_emotion(vocabulary[name].weights * intensity)[0] == name


def test_faces_that_show_no_emotion_read_as_neutral() -> None:
    vocabulary = Vocabulary.load(P)
    for name in ("neutral", "blink", "sleep", "kiss", "puff", "tongue"):
        assert FACS.read_emotion(vocabulary[name].weights)[0] == "neutral", name


def test_a_wrong_file_lists_every_fault(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(
        """
        extra = 1
        [units.1]
        weights = { browInerUp = 1.0 }
        [units.2]
        weights = { browOuterUp = 2.0 }
        wieghts = 1
        [units.3]
        name = "x"
        [emotions]
        joy = "12"
        rage = 3
        """
    )
    with pytest.raises(ConfigError) as caught:
        Facs.load(P, path)
    text = str(caught.value)
    for part in (
        "extra: unknown key", "units.1.weights.browInerUp: unknown parameter, did you mean 'browInnerUp'",
        "units.2.weights.browOuterUp: input should be less than or equal to 1 (is 2.0)",
        "units.2.wieghts: unknown key, did you mean 'weights'",
        "units.3.weights: missing", "emotions.joy: unknown action unit '12'", "emotions.rage",
    ):  # fmt: skip
        assert part in text


@pytest.mark.parametrize("name", ["happiness", "surprise"])
def test_the_least_intensity_that_reads_as_an_emotion(name: str) -> None:
    assert FACS.read_emotion(FACS.expand(FACS.emotions[name], 0.125))[0] == name
    assert FACS.read_emotion(FACS.expand(FACS.emotions[name], 0.08)) == ("neutral", 1.0)


def own(tmp_path: Path, text: str) -> Facs:
    path = tmp_path / "own.toml"
    path.write_text(text)
    return Facs.load(P, path)


def test_units_of_ones_own(tmp_path: Path) -> None:
    facs = own(tmp_path, """
        units.1 = { weights = { mouthSmile = 0.5, mouthFrown = 1.0 }, aliases = ["7"] }
        units.2 = { weights = { mouthSmile = 0.5, jawOpen = 0.25 }, read = false }
        units.3 = { left = { jawLeft = 1.0 }, right = { jawRight = 0.5 } }
        units.4 = { right = { jawForward = 1.0 } }
    """)  # fmt: skip
    assert facs.names == ("L1", "R1", "2", "L3", "R3", "L4", "R4")
    left, frown = P.index("mouthSmileLeft"), P.index("mouthFrownRight")
    assert facs.matrix[left].tolist() == [0.5, 0.0, 0.5, 0, 0, 0, 0]
    assert facs.matrix[frown].tolist() == [0.0, 1.0, 0, 0, 0, 0, 0]
    assert facs.matrix[P.index("jawRight")].tolist() == [0, 0, 0, 0, 0.5, 0, 0]
    assert facs.matrix[P.index("jawForward")].tolist() == [0, 0, 0, 0, 0, 0, 1.0]
    assert facs.levels("7B+R1C+L3D+2A").tolist() == pytest.approx([0.4, 0.6, 0.2, 0.8, 0, 0, 0])
    assert facs.levels("1+1B", 0.5).tolist() == pytest.approx([0.5, 0.5, 0, 0, 0, 0, 0])
    assert facs.read(facs.expand("2"))[2] == 0.0  # not read back
    assert facs.read(facs.expand("L3"))[3] == pytest.approx(1.0, abs=0.01)


def test_what_shows_nothing_in_the_face_is_no_emotion(tmp_path: Path) -> None:
    """None at all, and one of the head alone; units of the head in an emotion do not lessen it."""
    unit = "units.26 = { weights = { jawOpen = 1.0 } }\nunits.51 = { weights = { headYaw = 1.0 } }\n"
    shown = np.zeros(len(P))
    shown[[P.index("jawOpen"), P.index("headYaw")]] = 1.0
    assert own(tmp_path, unit).read_emotion(shown) == ("neutral", 1.0)
    assert own(tmp_path, unit + "emotions.away = '51'").read_emotion(shown) == ("neutral", 1.0)
    assert own(tmp_path, unit + "emotions.awe = '26+51'").read_emotion(shown) == ("awe", pytest.approx(1.0, abs=0.02))


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("units.1 = { weights = { jawOpen = 0 } }", "units.1.weights.jawOpen: must not be 0"),
        ("units.1 = { left = { jawOpn = 1 } }", "units.1.left.jawOpn: unknown parameter, did you mean 'jawOpen'"),
        ("units.1 = { weights = {} }", "units.1.weights: missing"),
        (
            "units.1 = { weights = { jawOpen = 1 }, aliases = [3] }",
            "units.1.aliases[0]: input should be a valid str",
        ),
        ("units.1 = { weights = { jawOpen = 1 } }\nemotions.joy = '1F'", "emotions.joy: '1F' is not an action unit"),
        (
            "units.1 = { weights = { jawOpen = 1 }, left = { jawLeft = 1 } }",
            "units.1.weights: the unit has left or right, too",
        ),
        ("units.X1 = { weights = { jawOpen = 1 } }", "units.X1"),
        ("units = {}", "units: dictionary should have at least 1 item"),
        ("", "units: missing"),
    ],
)
def test_one_fault_is_named_with_its_place(tmp_path: Path, text: str, fault: str) -> None:
    with pytest.raises(ConfigError) as caught:
        own(tmp_path, text)
    assert fault in str(caught.value) and ": 1 fault" in str(caught.value)


@pytest.mark.parametrize(
    ("unit", "faults"),
    [
        ("weights = { jawOpen = 1 }", []),
        ("left = { jawLeft = 1 }", []),
        ("right = { jawRight = 1 }", []),
        ("", ["weights: missing"]),
        ("weights = { jawOpen = 1 }\nleft = { jawLeft = 1 }", ["weights: the unit has left or right, too"]),
        ("weights = { jawOpen = 1 }\nright = { jawRight = 1 }", ["weights: the unit has left or right, too"]),
        ("left = { jawLeft = 9 }", ["left.jawLeft"]),  # what is wrong with one side is no lack of weights
        ("right = { jawRight = 9 }", ["right.jawRight"]),
    ],
)
def test_a_unit_has_weights_or_sides(tmp_path: Path, unit: str, faults: list[str]) -> None:
    (tmp_path / "facs.toml").write_text(f"[units.1]\n{unit}\n")
    if not faults:
        assert Facs.load(P, tmp_path / "facs.toml").expand("1").any()
        return
    with pytest.raises(ConfigError) as caught:
        Facs.load(P, tmp_path / "facs.toml")
    lines = str(caught.value).splitlines()
    assert [fault in line for fault, line in zip(faults, lines[-len(faults) :], strict=True)] == [True] * len(faults)
    assert str(caught.value).count("units.") == len(faults)
