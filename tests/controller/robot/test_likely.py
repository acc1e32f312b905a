"""Which of the faces with the measured angles the mirror of a servo head shows."""

from __future__ import annotations

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.base.paths import find_config
from controller.robot.channels import ChannelTable, build_table
from controller.robot.following import Mirror
from controller.robot.likely import LikelyFace
from controller.robot.robot import load_robot
from controller.vocabulary.vocabulary import Vocabulary

EMOTIONS = ("happiness", "sadness", "surprise", "fear", "anger", "disgust")
LINEAR = np.array([[1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 1.0]])  # two servos, each moved by two of four parameters
SHOWN = np.array([[0.0, 0.8, 0.9, 0.0]])


def likely(faces: np.ndarray, unit: float = 1.0) -> LikelyFace:
    matrix, n = unit * LINEAR, np.full(2, unit)
    return LikelyFace(lambda x: matrix @ x, matrix, faces, rest=np.zeros(4), bounds=(np.zeros(4), np.ones(4)),
                      ends=(-n, n))  # fmt: skip


@pytest.fixture(scope="module")
def table() -> ChannelTable:
    return build_table(load_robot(find_config("robots", "head24"), P).channels, P)


@pytest.mark.parametrize("unit", [1.0, 12.0])
@pytest.mark.parametrize("amount", [0.3, 1.0])
def test_angles_of_a_known_expression_are_that_expression(unit: float, amount: float) -> None:
    found = likely(SHOWN, unit).find(unit * amount * LINEAR @ SHOWN[0], np.ones(2, bool))
    assert found == pytest.approx(amount * SHOWN[0], abs=0.05)


def test_without_known_expressions_parameters_share_what_a_servo_shows() -> None:
    found = likely(np.zeros((0, 4))).find(np.array([0.8, 0.0]), np.ones(2, bool))
    assert found[0] == pytest.approx(found[1], abs=1e-3) and found[0] > 0.3
    assert not found[2:].any()


def test_channels_that_were_not_read_ask_for_nothing() -> None:
    found = likely(np.zeros((0, 4))).find(np.array([0.8, 0.7]), np.array([True, False]))
    assert found[:2].sum() > 0.7 and not found[2:].any()


def test_a_servo_at_the_end_of_its_curve_may_stand_for_more() -> None:
    faces = np.array([[0.6, 0.6, 0.45, 0.45]])  # its first mix is 1.2; the curve ends at 1
    atop = likely(faces).find(np.array([1.0, 0.9]), np.ones(2, bool))
    below = likely(faces).find(np.array([0.99, 0.9]), np.ones(2, bool))  # not at the end: nothing is hidden there
    assert atop[:2].sum() > 1.15 and below[:2].sum() == pytest.approx(1.0, abs=0.05)


def test_the_same_angles_are_the_same_face_whatever_came_before(table: ChannelTable) -> None:
    vocabulary = Vocabulary.load(P)
    mirror = Mirror(table, P, vocabulary.faces())
    asked = table.angles(vocabulary["disgust"].weights)[0]
    first = mirror.read(asked)
    for name in ("anger", "happiness"):
        mirror.read(table.angles(vocabulary[name].weights)[0])
    assert mirror.read(asked) == pytest.approx(first, abs=0.02)


def test_servos_that_make_an_emotion_are_read_as_that_emotion(table: ChannelTable) -> None:
    vocabulary = Vocabulary.load(P)
    mirror, plain = Mirror(table, P, vocabulary.faces()), Mirror(table, P)
    served = table.reached
    for name in EMOTIONS:
        for amount in (0.5, 1.0):
            sent = amount * vocabulary[name].weights
            angles = table.angles(sent)[0]
            away = np.linalg.norm((mirror.read(angles) - sent)[served])
            assert away < 0.25 * np.linalg.norm(sent), (name, amount)
            assert away <= np.linalg.norm((plain.read(angles) - sent)[served])
            assert np.degrees(np.abs(table.angles(mirror.read(angles))[0] - angles)).max() < 1.0


def test_speech_does_not_become_an_emotion(table: ChannelTable) -> None:
    vocabulary = Vocabulary.load(P)
    mirror = Mirror(table, P, vocabulary.faces())
    upper = np.concatenate([P.region("brows"), P.region("lids"), P.region("tongue")])
    for viseme in ("aa", "O", "PP", "SS", "E", "U", "FF", "kk", "CH"):
        read = mirror.read(table.angles(vocabulary[f"VISEME:{viseme}"].weights)[0])
        assert np.abs(read[upper]).max() < 0.12, viseme  # and no tongue, which has no servo
