"""drivers.core.presence: who is driven, by what was read."""

from __future__ import annotations

import numpy as np

from drivers.base.bus import BusState, make_state
from drivers.core.presence import AWAY_ROUNDS, AWAY_S, MAX_DISAGREEMENT_RAD, Presence


def state(fresh: list[int], silent: tuple[int, ...] = (0, 0, 0), age_s: float = 10.0, at_rad: float = 0.0) -> BusState:
    here, none = np.full(3, at_rad), np.zeros(3, np.uint8)
    ages = np.where(fresh, 0.0, age_s)
    slow = (none, here, here, none, np.ones(3, bool))
    return make_state(0.0, np.array([here, here, here, ages]), np.array(fresh, bool), np.array(silent, bool), slow)


def test_a_silent_servo_is_away_at_once_and_back_with_its_second_position() -> None:
    presence = Presence(3)
    before = presence.driven
    assert presence.note(state([1, 1, 1]), 1) == [] and presence.driven is before
    assert presence.note(state([1, 0, 1], (0, 1, 0)), 1) == []
    assert presence.driven.tolist() == [True, False, True] and not presence.driven.flags.writeable
    assert presence.note(state([1, 0, 1]), 1) == [], "it answers, but not with its position"
    assert presence.driven.tolist() == [True, False, True]
    assert presence.note(state([1, 1, 1]), 1) == [], "one position may be a wrong one"
    assert presence.note(state([1, 1, 1]), 1) == [1]
    assert presence.driven.all() and presence.note(state([1, 1, 1]), 1) == []


def test_positions_that_do_not_agree_bring_no_servo_back() -> None:
    presence = Presence(3)
    presence.note(state([1, 0, 1], (0, 1, 0)), 1)
    for at_rad in (0.0, 2 * MAX_DISAGREEMENT_RAD, 0.0):
        assert presence.note(state([1, 1, 1], at_rad=at_rad), 1) == []
    presence.note(state([1, 0, 1], (0, 1, 0)), 1)
    assert presence.note(state([1, 1, 1]), 1) == [], "the positions of before it went do not count"
    assert presence.note(state([1, 1, 1], at_rad=0.9 * MAX_DISAGREEMENT_RAD), 1) == [1]


def test_a_servo_is_away_that_was_asked_often_enough_for_long_enough() -> None:
    for turn in (1, 4):
        presence = Presence(3)
        for _ in range(AWAY_ROUNDS * turn):
            presence.note(state([1, 1, 0]), turn)
            assert presence.driven.all(), "a turn is not over"
        presence.note(state([1, 1, 0], age_s=AWAY_S), turn)
        assert presence.driven.all(), "not long enough"
        presence.note(state([1, 1, 0], age_s=1.1 * AWAY_S), turn)
        assert presence.driven.tolist() == [True, True, False]


def test_a_position_in_between_begins_the_count_again() -> None:
    presence = Presence(3)
    for fresh in ([1, 1, 0], [1, 1, 0], [1, 1, 1], [1, 1, 0], [1, 1, 0]):
        presence.note(state(fresh), 1)
    assert presence.driven.all()


def test_who_is_left_out_does_not_come_back_by_a_position_alone() -> None:
    presence = Presence(3)
    presence.reset(np.array([True, False, True]))
    assert presence.left_out.tolist() == [False, True, False]
    for _ in range(5):
        assert presence.note(state([1, 1, 1]), 1) == []
    assert presence.driven.tolist() == [True, False, True]
    presence.join(1)
    assert presence.driven.all() and not presence.left_out.any()


def test_silence_that_a_position_contradicts_is_none() -> None:
    presence = Presence(3)
    assert presence.note(state([1, 1, 1], (0, 1, 0)), 1) == []
    presence.note(state([1, 1, 0]), 1)
    assert presence.note(state([1, 1, 1], (0, 1, 0)), 1) == []
    assert presence.driven.all()


def test_who_is_held_back_is_driven_again_only_when_it_joins() -> None:
    presence = Presence(3)
    presence.hold_back(1)
    held = presence.driven
    presence.hold_back(1)
    assert presence.driven is held and held.tolist() == [True, False, True]
    for _ in range(3):
        assert presence.note(state([1, 1, 1]), 1) == []
    presence.join(1)
    assert presence.driven.all() and not presence.held_back.any()
    presence.hold_back(0)
    presence.reset(np.ones(3, bool))
    assert presence.driven.all(), "a start begins without it"
