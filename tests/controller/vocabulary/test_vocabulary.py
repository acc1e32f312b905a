"""Expressions by name or formula."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ConfigError, ParameterError
from controller.base.parameters import PARAMETERS as P
from controller.vocabulary.affect import Affect
from controller.vocabulary.facs import Facs
from controller.vocabulary.vocabulary import Vocabulary


@pytest.fixture(scope="module")
def vocabulary() -> Vocabulary:
    return Vocabulary.load(P)


def test_the_basic_emotions_are_there_and_differ(vocabulary: Vocabulary) -> None:
    basic = ["happiness", "sadness", "surprise", "fear", "anger", "disgust", "contempt"]
    assert {*basic, "neutral", "smile", "wink"} <= set(vocabulary.names)
    weights = np.array([vocabulary[name].weights for name in basic])
    unit = weights / np.linalg.norm(weights, axis=1, keepdims=True)
    alike = unit @ unit.T - np.eye(len(basic))
    assert alike.max() < 0.75  # cosine; the read-out by template needs them apart


@pytest.mark.parametrize(
    ("name", "shown", "hidden"),
    [
        ("sadness", (1, 4, 15, 17), (2, 5, 10, 12, 20)),
        ("fear", (1, 4, 5, 20, 16), (9, 12, 15, 17)),
        ("anger", (4, 5, 7, 17, 24), (1, 2, 10, 12, 15)),
        ("disgust", (9, 10, 15, 17), (1, 2, 5, 12)),
    ],
)
def test_emotions_show_the_units_of_their_prototype(
    vocabulary: Vocabulary, name: str, shown: tuple[int, ...], hidden: tuple[int, ...]
) -> None:
    """Prototypes of EMFACS; hidden units are those of the emotions that each is taken for."""
    facs, weights = Facs.load(P), vocabulary[name].weights
    main = {unit: facs.matrix[:, facs.columns_of(str(unit))[0]].argmax() for unit in (*shown, *hidden)}
    assert [unit for unit in shown if weights[main[unit]] < 0.5] == []
    assert [unit for unit in hidden if weights[main[unit]] > 0.2] == []


def test_disgust_lowers_the_brows_a_little_and_anger_as_they_go(vocabulary: Vocabulary) -> None:
    """Levator labii alaeque nasi, unit 9, draws them down, too; as low as in anger, disgust would be taken for it."""
    disgust, anger = (vocabulary[name].weights[P.names.index("browDownLeft")] for name in ("disgust", "anger"))
    assert 0.2 < disgust < 0.5 * anger


def test_brows_of_fear_are_drawn_together_more_than_arched(vocabulary: Vocabulary) -> None:
    """Arched brows over a hanging jaw are surprise."""
    fear = vocabulary["fear"].weights
    assert fear[P.index("browDownLeft")] > 2 * fear[P.index("browOuterUpLeft")] > 0.0
    assert fear[P.index("jawOpen")] < 0.5 * vocabulary["surprise"].weights[P.index("jawOpen")]


def test_neutral_is_all_zero(vocabulary: Vocabulary) -> None:
    assert not vocabulary["neutral"].weights.any()
    assert vocabulary.expand("neutral") == {}


def test_expand_scales_with_intensity(vocabulary: Vocabulary) -> None:
    full, half = vocabulary.expand("interest", 1.0), vocabulary.expand("interest", 0.5)
    assert full.keys() == half.keys()
    assert full[P.index("browOuterUpLeft")] == full[P.index("browOuterUpRight")] > 0.3
    assert all(half[i] == pytest.approx(full[i] / 2) for i in full)


def test_a_response_below_1_shows_weak_intensities_more(vocabulary: Vocabulary) -> None:
    full, half = vocabulary.expand("sadness", 1.0), vocabulary.expand("sadness", 0.5)
    assert vocabulary["sadness"].response == 0.7
    assert all(half[i] == pytest.approx(full[i] * 0.5**0.7) for i in full)
    assert vocabulary.expand("sadness", 0.0) == dict.fromkeys(full, 0.0)


def test_names_in_any_case_and_aliases(vocabulary: Vocabulary) -> None:
    assert vocabulary["Happy"] is vocabulary["happiness"] is vocabulary["JOY"]
    assert vocabulary["Wink-Left"] is vocabulary["wink"]


def test_unknown_name_suggests_the_nearest(vocabulary: Vocabulary) -> None:
    with pytest.raises(ParameterError, match="unknown expression 'hapiness', did you mean 'happiness'"):
        vocabulary["hapiness"]
    with pytest.raises(ParameterError, match=r"intensity must be 0 to 1, not 1\.5"):
        vocabulary.expand("anger", 1.5)


def test_weights_stay_in_range_and_cannot_be_changed(vocabulary: Vocabulary) -> None:
    for name in vocabulary.names:
        weights = vocabulary[name].weights
        assert np.all(weights >= P.low) and np.all(weights <= P.high)
        assert not weights.flags.writeable


def test_every_expression_says_where_it_comes_from(vocabulary: Vocabulary) -> None:
    assert all(vocabulary[name].source for name in vocabulary.names)


def test_a_wrong_file_lists_every_fault(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(
        """
        plain = 1
        [grin]
        kind = "mood"
        aliases = ["frown"]
        onset_s = -1
        blnk = "keep"
        [grin.weights]
        mouthSmil = 0.5
        jawOpen = 1.5
        [sneer]
        aliases = 3
        [frown]
        weights = {}
        """
    )
    with pytest.raises(ConfigError) as caught:
        Vocabulary.load(P, path)
    text = str(caught.value)
    for part in (
        "plain: must be a table", "grin.kind", "grin.aliases: 'frown' is already a name of 'frown'", "grin.onset_s",
        "grin.blnk: unknown key, did you mean 'blink'", "grin.weights.mouthSmil: unknown parameter, did you mean",
        "grin.weights.jawOpen: must be a number from 0 to 1 (is 1.5)", "sneer.weights: missing", "sneer.aliases",
    ):  # fmt: skip
        assert part in text


def own(tmp_path: Path, text: str, name: str = "own.toml") -> Path:
    path = tmp_path / name
    path.write_text(text)
    return path


def test_own_files_add_expressions_and_mix_those_before_them(tmp_path: Path) -> None:
    path = own(
        tmp_path,
        """
        [smirk]
        aliases = ["half_smile"]
        weights = { mouthSmileLeft = 0.7 }
        [glee]
        of = { happiness = 0.5, smirk = 1.0 }
        weights = { jawOpen = 0.3 }
        mouth = "blend"
        """,
    )
    vocabulary = Vocabulary.load(P, more=[path])
    happy, glee = Vocabulary.load(P)["happiness"].weights, vocabulary["glee"]
    left = P.index("mouthSmileLeft")
    assert vocabulary["Half-Smile"].name == "smirk" and vocabulary["smile"].name == "smile"
    assert glee.weights[left] == pytest.approx(min(1.0, 0.5 * happy[left] + 0.7)) and glee.mouth == "blend"
    assert glee.weights[P.index("jawOpen")] == 0.3
    more = own(tmp_path, "[joyful]\nof = { glee = 0.5 }", "more.toml")
    assert Vocabulary.load(P, more=[path, more])["joyful"].weights[left] == pytest.approx(glee.weights[left] / 2)


def test_faults_of_all_files_come_together_circles_too(tmp_path: Path) -> None:
    first = own(
        tmp_path,
        """
        smile = { weights = {} }
        [a]
        of = { b = 1.0 }
        [b]
        of = { c = 0.5, a = 1.0 }
        [c]
        of = { happines = 1.0, sadness = 2.0 }
        aliases = ["joy"]
        """,
    )
    second = own(tmp_path, "[d]\nof = 3\n[e]\nof = { e = 1, x = 1 }", "second.toml")
    with pytest.raises(ConfigError) as caught:
        Vocabulary.load(P, more=[first, second])
    text = str(caught.value)
    for part in (
        "own.toml: 5 faults",
        "smile: is already in an earlier file; choose another name",
        "a.of.b: goes in a circle: a -> b -> a",
        "c.of.happines: unknown expression 'happines', did you mean 'happiness'",
        "c.of.sadness: input should be less than or equal to 1 (is 2.0)",
        "c.aliases: 'joy' is already a name of 'happiness'",
        "second.toml: 2 faults",
        "d.of: must be a table (is 3)",
        "e.of.e: goes in a circle: e -> e",
    ):
        assert part in text


def test_formulas_of_action_units(vocabulary: Vocabulary) -> None:
    made = vocabulary["au6+12"]
    assert (made.name, made.source, made.kind) == ("AU6+12", "FACS", "user")
    np.testing.assert_array_equal(made.weights, Facs.load(P).expand("6+12"))
    one_sided = vocabulary["AUR12C+R14D"]
    np.testing.assert_array_equal(one_sided.weights, Facs.load(P).expand("R12C+R14D"))
    assert vocabulary[one_sided.name].name == "AUR12C+R14D"
    assert vocabulary.expand("AU26", 0.5) == {P.index("jawOpen"): 0.25}


def test_formulas_of_moods(vocabulary: Vocabulary) -> None:
    affect = Affect.load(vocabulary)
    for text, point in (
        ("va:0.5,-.25", (0.5, -0.25)),
        ("VAD:-0.5,0.6,0.3", (-0.5, 0.6, 0.3)),
        ("VA:1,-1", (1.0, -1.0)),
    ):
        made = vocabulary[text]
        np.testing.assert_allclose(made.weights, affect.expand(*point))
        assert vocabulary[made.name].name == made.name  # its name is a formula, too
    assert vocabulary["VA:0.80,0.4"].name == "VA:0.8,0.4"


@pytest.mark.parametrize("text", ["AUTUMN", "VALUE", "", "VA", "XAU1"])
def test_anything_else_is_a_name(vocabulary: Vocabulary, text: str) -> None:
    with pytest.raises(ParameterError, match="unknown expression"):
        vocabulary[text]


@pytest.mark.parametrize(
    ("text", "hint"),
    [("AU99", "facs.toml"), ("AU1-2", "12B"), ("VA:1", "VA:0.5,-0.2"), ("VA:1,2", "VA:0.5,-0.2"), ("VA:a,b", "VA:"),
     ("VA:nan,0", "VA:"), ("VA:-1.01,0", "VA:"), ("VAD:0,0", "VAD:0.5,-0.2,0.1"),
     ("VA:0_1,0", "VA:"), ("VA: 0,0", "VA:"), ("VA:,0", "VA:")],
)  # fmt: skip
def test_wrong_formulas_are_refused(vocabulary: Vocabulary, text: str, hint: str) -> None:
    with pytest.raises(ParameterError) as caught:
        vocabulary[text]
    assert hint in caught.value.hint


def test_a_name_that_looks_like_a_formula_is_found_before_the_formula() -> None:
    vocabulary = Vocabulary.load(P)
    own = replace(vocabulary["happiness"], name="AU2mine")
    vocabulary.add(own)
    assert vocabulary["au2MINE"] is own
    assert vocabulary["AU2"].source == "FACS"
