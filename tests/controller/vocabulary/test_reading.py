"""Faces read back in other vocabularies."""

from __future__ import annotations

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.vocabulary.affect import Affect
from controller.vocabulary.facs import Facs
from controller.vocabulary.reading import Readings, _LevelSolver
from controller.vocabulary.visemes import Visemes
from controller.vocabulary.vocabulary import Vocabulary

VOCABULARY = Vocabulary.load(P)
EMOTIONS = ("happiness", "sadness", "surprise", "fear", "anger", "disgust", "contempt")


@pytest.fixture(scope="module")
def readings() -> Readings:
    return Readings(P, VOCABULARY)


@pytest.mark.parametrize("intensity", np.linspace(0.3, 1.0, 8))
@pytest.mark.parametrize("emotion", EMOTIONS)
def test_emotions_to_units_to_parameters_and_back(readings: Readings, emotion: str, intensity: float) -> None:
    facs = Facs.load(P)
    face = facs.expand(facs.emotions[emotion], intensity)
    ((name, level),) = readings.read("EMOTION", face)
    assert name == emotion and level == pytest.approx(intensity, abs=0.2)
    shown = VOCABULARY[emotion].weights * intensity
    assert readings.read("EMOTION", shown)[0][0] == emotion


def test_a_smile_is_not_read_as_a_viseme(readings: Readings) -> None:
    for intensity in (0.2, 0.6, 1.0):
        assert readings.read("VISEMES", VOCABULARY["smile"].weights * intensity) == []


@pytest.mark.parametrize("viseme", ["PP", "aa", "I", "O", "U", "SS"])
def test_visemes_are_read_through_a_smile(readings: Readings, viseme: str) -> None:
    visemes, smile = Visemes.load(P), VOCABULARY["smile"].weights
    face = np.maximum(visemes.matrix @ visemes.weights(viseme), smile * visemes.through * visemes.mask)
    found = dict(readings.read("VISEMES", face))
    assert max(found, key=lambda name: found[name]) == viseme and found[viseme] > 0.6


def test_units(readings: Readings) -> None:
    face = Facs.load(P).expand("12+26B+L2")
    found = dict(readings.read("UNITS", face))
    assert set(found) == {"L12", "R12", "26", "L2"}
    assert found["26"] == pytest.approx(0.4, abs=0.1)
    assert readings.read("UNITS", P.neutral()) == []


def test_visemes(readings: Readings) -> None:
    visemes = Visemes.load(P)
    for name in visemes.names[1:]:
        face = visemes.matrix @ visemes.weights(name)
        shown = readings.read("VISEMES", face)
        best = max(shown, key=lambda each: each[1])[0]
        alike = np.abs(visemes.matrix - face[:, None]).max(axis=0) < 1e-9  # some visemes have one mouth
        assert best in {visemes.names[i] for i in np.flatnonzero(alike)}, name


def test_levels_stay_between_nothing_and_everything() -> None:
    levels = _LevelSolver(np.diag([1.0, 2.0, 0.5, 1.0])).solve(np.array([-1.0, 3.0, 0.25, 0.0]))
    assert levels == pytest.approx([0.0, 1.0, 0.5, 0.0], abs=0.01)
    assert (levels[0], levels[1], levels[3]) == (0.0, 1.0, 0.0) and levels[2] < 0.5  # few and small ones are preferred


def test_only_what_shows_is_told(readings: Readings) -> None:
    face = Facs.load(P)
    for intensity, shown in ((0.03, set()), (0.2, {"26"})):
        assert {name for name, _ in readings.read("UNITS", face.expand("26", intensity))} == shown
    with pytest.raises(KeyError):
        readings.read("WEATHER", P.neutral())


def test_moods(readings: Readings) -> None:
    affect = Affect.load(VOCABULARY)
    at = dict(zip(affect.names, affect.points, strict=True))
    for name in ("happiness", "sadness", "anger"):
        mood = np.array([value for _, value in readings.read("MOOD", VOCABULARY[name].weights)])
        assert mood == pytest.approx(at[name], abs=0.2)
    assert [name for name, _ in readings.read("MOOD", P.neutral())] == ["valence", "arousal", "dominance"]
