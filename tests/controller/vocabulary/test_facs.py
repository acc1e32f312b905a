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
    assert show("R30") == {"jawRight": 1.0}
    assert show("43") == show("45") and show("AD34") == show("33")
    assert show("26") == {"jawOpen": 0.5} and show("27") == {"jawOpen": 1.0}
    assert show("") == {}
    assert FACS.expand("16+25+27+26").max() == 1.0


@pytest.mark.parametrize(
    ("formula", "message"), [("99", "unknown action unit '99'"), ("12F", "not an action unit"), ("L1", "has no sides")]
)
def test_wrong_formulas(formula: str, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        FACS.levels(formula)


def test_every_unit_reads_back_as_itself() -> None:
    for i, name in enumerate(FACS.names):
        if name in ("23", "27"):
            continue  # these share all their shapes: 23 with 24 and 28, 27 with 26
        levels = np.zeros(len(FACS.names))
        levels[i] = 0.8
        read = FACS.read(FACS.parameters_of(levels))
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
