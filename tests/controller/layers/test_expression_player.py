"""Acting expressions over time."""

from __future__ import annotations

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.layers.expression_player import ExpressionPlayer
from controller.vocabulary.expression import Expression
from controller.vocabulary.vocabulary import Vocabulary

VOCABULARY = Vocabulary.load(P)
SMILE = P.index("mouthSmileLeft")


@pytest.fixture
def actor() -> ExpressionPlayer:
    return ExpressionPlayer(VOCABULARY["neutral"])


def plain(name: str, index: int, **more: object) -> Expression:
    weights = P.neutral()
    weights[index] = 1.0
    return Expression(name, weights, onset_s=0.4, offset_s=0.4, **more)  # type: ignore[arg-type]


def test_a_mood_rises_along_minimum_jerk_and_stays(actor: ExpressionPlayer) -> None:
    actor.play(plain("a", SMILE), 0.8, None, 10.0)
    levels = [float(actor.update(t)[SMILE]) for t in (10.0, 10.1, 10.2, 10.4, 100.0)]
    assert levels == pytest.approx([0, 0.8 * 0.103515625, 0.4, 0.8, 0.8])
    assert (actor.name, actor.intensity) == ("a", 0.8)


def test_a_timed_expression_falls_back_to_the_mood(actor: ExpressionPlayer) -> None:
    actor.play(plain("mood", SMILE), 0.5, None, 0.0)
    actor.play(plain("flash", SMILE + 2), 1.0, 1.0, 1.0)
    face = actor.update(1.9)
    assert (face[SMILE], face[SMILE + 2]) == pytest.approx((0.0, 1.0))
    face = actor.update(2.2)
    assert (face[SMILE], face[SMILE + 2]) == pytest.approx((0.25, 0.5))
    face = actor.update(9.0)
    assert (face[SMILE], face[SMILE + 2], actor.name) == (0.5, 0.0, "mood")


def test_a_timed_gesture_keeps_the_mood_where_it_is_stronger(actor: ExpressionPlayer) -> None:
    weights = P.neutral()
    weights[[SMILE, SMILE + 2]] = 0.3, 0.9
    actor.play(plain("mood", SMILE), 0.8, None, 0.0)
    actor.play(Expression("wink", weights, kind="gesture"), 1.0, 2.0, 1.0)
    face = actor.update(2.5)
    assert (face[SMILE], face[SMILE + 2]) == pytest.approx((0.8, 0.9))


def test_a_shorter_time_than_the_onset_still_reaches_the_peak(actor: ExpressionPlayer) -> None:
    actor.play(plain("a", SMILE), 1.0, 0.1, 0.0)
    assert actor.update(0.0999)[SMILE] == pytest.approx(1.0, abs=1e-3)


def test_interrupting_does_not_jump(actor: ExpressionPlayer) -> None:
    random = np.random.default_rng(1)
    names = VOCABULARY.names
    before, now = actor.update(0.0).copy(), 0.0
    for _ in range(2000):
        now += 0.01
        if random.random() < 0.1:
            duration = None if random.random() < 0.5 else random.uniform(0.05, 0.6)
            actor.play(VOCABULARY[names[random.integers(len(names))]], random.random(), duration, now)
        after = actor.update(now)
        assert np.abs(after - before).max() < 0.4  # 10 ms of the fastest onset, 0.05 s, at its peak speed 1.875
        before = after.copy()


def test_rest_returns_to_neutral(actor: ExpressionPlayer) -> None:
    actor.play(plain("a", SMILE), 1.0, None, 0.0)
    actor.update(1.0)
    actor.rest(0.5, 1.0)
    assert actor.update(1.25)[SMILE] == pytest.approx(0.5)
    assert not actor.update(1.5).any() and actor.name == "neutral"
    actor.rest(0.0, 2.0)
    assert not actor.update(2.0).any()


def test_overrides_of_blink_and_gaze(actor: ExpressionPlayer) -> None:
    actor.play(plain("a", SMILE, blink="block", gaze="blend"), 0.3, None, 0.0)
    actor.update(1.0)
    assert (actor.blink_block, actor.gaze_block) == pytest.approx((1.0, 0.3))
    actor.rest(0.0, 1.0)
    actor.update(1.0)
    assert (actor.blink_block, actor.gaze_block) == (0.0, 0.0)
