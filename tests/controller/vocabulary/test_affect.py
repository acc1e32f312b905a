"""Moods as points."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS as P
from controller.vocabulary.affect import Affect
from controller.vocabulary.facs import Facs
from controller.vocabulary.vocabulary import Vocabulary

VOCABULARY = Vocabulary.load(P)
AFFECT = Affect.load(VOCABULARY)
UNIT = st.floats(-1, 1)


def test_an_anchor_is_met_exactly() -> None:
    for name, point in zip(AFFECT.names, AFFECT.points, strict=True):
        np.testing.assert_array_equal(AFFECT.expand(*point), VOCABULARY[name].weights)


@settings(deadline=None)
@given(UNIT, UNIT, st.none() | UNIT)
def test_every_mood_is_a_blend_in_range(valence: float, arousal: float, dominance: float | None) -> None:
    weights = AFFECT.weights(valence, arousal, dominance)
    assert weights.sum() == pytest.approx(1.0) and np.all(weights >= 0)
    face = AFFECT.expand(valence, arousal, dominance)
    assert np.all(face >= P.low) and np.all(face <= P.high)


@settings(deadline=None)
@given(UNIT, UNIT, UNIT)
def test_neighbouring_moods_look_alike(valence: float, arousal: float, dominance: float) -> None:
    one, other = AFFECT.expand(valence, arousal, dominance), AFFECT.expand(valence + 1e-4, arousal, dominance)
    assert np.abs(one - other).max() < 0.02


def test_the_plane_without_dominance_looks_right() -> None:
    smile, frown = P.index("mouthSmileLeft"), P.index("mouthFrownLeft")
    assert AFFECT.expand(0.8, 0.4)[smile] > 0.7 > 0.2 > AFFECT.expand(-0.6, -0.3)[smile]
    assert AFFECT.expand(-0.6, -0.3)[frown] > 0.6
    assert not AFFECT.expand(0.0, 0.0).any()


def test_dominance_tells_anger_from_fear() -> None:
    facs = Facs.load(P)
    assert facs.read_emotion(AFFECT.expand(-0.55, 0.6, 0.4))[0] == "anger"
    assert facs.read_emotion(AFFECT.expand(-0.6, 0.6, -0.5))[0] == "fear"


def test_reading_a_face_gives_its_point() -> None:
    point = AFFECT.points[AFFECT.names.index("anger")]
    np.testing.assert_allclose(AFFECT.read({"anger": 1.0}), point)
    np.testing.assert_allclose(AFFECT.read({"anger": 0.5}), point / 2)
    np.testing.assert_array_equal(AFFECT.read({}), np.zeros(3))


def test_a_wrong_file_lists_every_fault(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text("extra = 1\n[anchors.angr]\nat = [0, 0, 0]\n[anchors.fear]\nat = [0, 2, 0]\n[anchors.sadness]\n")
    with pytest.raises(ConfigError) as caught:
        Affect.load(VOCABULARY, path)
    for part in (
        "extra",
        "anchors.angr: unknown expression, did you mean 'anger'",
        "anchors.fear.at",
        "anchors.sadness.at",
    ):
        assert part in str(caught.value)
    path.write_text("")
    with pytest.raises(ConfigError, match="anchors: missing"):
        Affect.load(VOCABULARY, path)
