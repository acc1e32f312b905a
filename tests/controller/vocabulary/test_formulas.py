"""Expressions that are written down."""

from __future__ import annotations

import numpy as np
import pytest

from controller.base.errors import ParameterError
from controller.base.parameters import PARAMETERS as P
from controller.vocabulary.affect import Affect
from controller.vocabulary.facs import Facs
from controller.vocabulary.formulas import Formulas
from controller.vocabulary.vocabulary import Vocabulary

VOCABULARY = Vocabulary.load(P)
FORMULAS = Formulas(P, VOCABULARY)


def test_action_units() -> None:
    made = FORMULAS("au6+12")
    assert made is not None and made.name == "AU6+12"
    np.testing.assert_array_equal(made.weights, Facs.load(P).expand("6+12"))


def test_moods() -> None:
    affect = Affect.load(VOCABULARY)
    for text, point in (("va:0.5,-.25", (0.5, -0.25)), ("VAD:-0.5,0.6,0.3", (-0.5, 0.6, 0.3))):
        made = FORMULAS(text)
        assert made is not None
        np.testing.assert_allclose(made.weights, affect.expand(*point))
        again = FORMULAS(made.name)  # its name is a formula, too
        assert again is not None and again.name == made.name


def test_anything_else_is_not_a_formula() -> None:
    for text in ("anger", "AUTUMN", "VALUE", "", "VA"):
        assert FORMULAS(text) is None


@pytest.mark.parametrize("text", ["AU99", "AU1-2", "VA:1", "VA:1,2", "VA:a,b", "VA:nan,0", "VAD:0,0"])
def test_wrong_formulas_are_refused(text: str) -> None:
    with pytest.raises(ParameterError) as caught:
        FORMULAS(text)
    assert caught.value.hint


def test_the_vocabulary_of_expressions_takes_formulas() -> None:
    assert VOCABULARY["AU6+12"].weights[P.index("mouthSmileLeft")] == 1.0
    assert VOCABULARY["VA:0.8,0.4"].name == "VA:0.8,0.4"
    assert VOCABULARY.expand("AU26", 0.5) == {P.index("jawOpen"): 0.25}
