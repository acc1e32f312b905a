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
def player() -> ExpressionPlayer:
    return ExpressionPlayer(VOCABULARY["neutral"])


def plain(name: str, index: int, **more: object) -> Expression:
    weights = P.neutral()
    weights[index] = 1.0
    return Expression(name, weights, onset_s=0.4, offset_s=0.4, **more)  # type: ignore[arg-type]


def test_a_mood_rises_along_minimum_jerk_and_stays(player: ExpressionPlayer) -> None:
    player.play(plain("a", SMILE), 0.8, None, 10.0)
    levels = [float(player.update(t)[SMILE]) for t in (10.0, 10.1, 10.2, 10.4, 100.0)]
    assert levels == pytest.approx([0, 0.8 * 0.103515625, 0.4, 0.8, 0.8])
    assert (player.name, player.intensity) == ("a", 0.8)


def test_a_timed_expression_falls_back_to_the_mood(player: ExpressionPlayer) -> None:
    player.play(plain("mood", SMILE), 0.5, None, 0.0)
    player.play(plain("flash", SMILE + 2), 1.0, 1.0, 1.0)
    face = player.update(1.9)
    assert (face[SMILE], face[SMILE + 2]) == pytest.approx((0.0, 1.0))
    face = player.update(2.2)
    assert (face[SMILE], face[SMILE + 2]) == pytest.approx((0.25, 0.5))
    face = player.update(9.0)
    assert (face[SMILE], face[SMILE + 2], player.name) == (0.5, 0.0, "mood")


def test_a_timed_gesture_keeps_the_mood_where_it_is_stronger(player: ExpressionPlayer) -> None:
    weights = P.neutral()
    weights[[SMILE, SMILE + 2]] = 0.3, 0.9
    player.play(plain("mood", SMILE), 0.8, None, 0.0)
    player.play(Expression("wink", weights, kind="gesture"), 1.0, 2.0, 1.0)
    face = player.update(2.5)
    assert (face[SMILE], face[SMILE + 2]) == pytest.approx((0.8, 0.9))


def test_a_shorter_time_than_the_onset_still_reaches_the_peak(player: ExpressionPlayer) -> None:
    player.play(plain("a", SMILE), 1.0, 0.1, 0.0)
    assert player.update(0.0999)[SMILE] == pytest.approx(1.0, abs=1e-3)


def test_interrupting_does_not_jump(player: ExpressionPlayer) -> None:
    random = np.random.default_rng(1)
    names = VOCABULARY.names
    before, now = player.update(0.0).copy(), 0.0
    for _ in range(2000):
        now += 0.01
        if random.random() < 0.1:
            duration = None if random.random() < 0.5 else random.uniform(0.05, 0.6)
            player.play(VOCABULARY[names[random.integers(len(names))]], random.random(), duration, now)
        after = player.update(now)
        assert np.abs(after - before).max() < 0.4  # 10 ms of the fastest onset, 0.05 s, at its peak speed 1.875
        before = after.copy()


def test_rest_returns_to_neutral(player: ExpressionPlayer) -> None:
    player.play(plain("a", SMILE), 1.0, None, 0.0)
    player.update(1.0)
    player.rest(0.5, 1.0)
    assert player.update(1.25)[SMILE] == pytest.approx(0.5)
    assert not player.update(1.5).any() and player.name == "neutral"
    player.rest(0.0, 2.0)
    assert not player.update(2.0).any()


def test_overrides_of_blink_and_gaze(player: ExpressionPlayer) -> None:
    player.play(plain("a", SMILE, blink="block", gaze="blend"), 0.3, None, 0.0)
    player.update(1.0)
    assert player.blocks == pytest.approx((1.0, 0.3, 0.0))
    player.rest(0.0, 1.0)
    player.update(1.0)
    assert player.blocks == (0.0, 0.0, 0.0)
    player.play(plain("b", SMILE, mouth="blend"), 0.5, None, 2.0)
    player.update(9.0)
    assert player.blocks == (0.0, 0.0, 0.5)
    player.play(plain("c", SMILE, mouth="block"), 0.0, None, 9.0)
    player.update(19.0)
    assert player.blocks == (0.0, 0.0, 0.0)


def test_a_late_update_falls_from_where_the_expression_had_got_to(player: ExpressionPlayer) -> None:
    player.play(plain("mood", SMILE), 0.5, None, 0.0)
    player.play(plain("flash", SMILE + 2), 1.0, 1.0, 1.0)
    face = player.update(2.2)  # nothing asked for the second in between
    assert (face[SMILE], face[SMILE + 2]) == pytest.approx((0.25, 0.5))


def test_an_expression_with_its_own_times(player: ExpressionPlayer) -> None:
    weights = P.neutral()
    weights[SMILE] = 1.0
    slow = Expression("slow", weights, onset_s=2.0, offset_s=4.0)
    player.play(slow, 1.0, 5.0, 0.0)
    assert [float(player.update(t)[SMILE]) for t in (1.0, 2.0, 5.0, 7.0, 9.0)] == pytest.approx([0.5, 1, 1, 0.5, 0])
    player.play(slow, 1.0, 1.0, 10.0)  # shorter than its onset
    assert player.update(10.5)[SMILE] == pytest.approx(0.5)
    player.play(slow, 0.4, None, 20.0)
    assert player.update(22.0)[SMILE] == pytest.approx(0.4) and (player.name, player.intensity) == ("slow", 0.4)


def test_a_mood_ends_what_was_timed(player: ExpressionPlayer) -> None:
    player.play(plain("flash", SMILE), 1.0, 1.0, 0.0)
    player.play(plain("mood", SMILE + 2), 1.0, None, 0.5)
    assert player.update(50.0)[[SMILE, SMILE + 2]].tolist() == [0.0, 1.0]
    player.play(plain("flash", SMILE), 1.0, 1.0, 60.0)
    player.rest(0.1, 60.5)
    assert not player.update(70.0).any() and player.name == "neutral"
