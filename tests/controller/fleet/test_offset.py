"""controller.fleet.offset: the offset of a clock is found through a network that delays unevenly."""

from __future__ import annotations

import random

from controller.fleet.offset import ClockOffset, Clocks

MS = 10**6


def test_the_offset_is_within_half_of_the_shortest_round_trip() -> None:
    rng, clock, ahead = random.Random(3), ClockOffset(), 123_456_789_000
    assert clock.error_ns is None
    now = 0
    for _ in range(50):
        now += 10**9
        there, back = (round(rng.uniform(30, 70) * MS) for _ in range(2))
        clock.add(now, now + there + ahead, now + there + ahead + MS, now + there + back + MS)
    assert clock.error_ns is not None and abs(clock.offset_ns - ahead) <= clock.error_ns
    clock.add(now, now + MS // 2 + ahead, now + MS // 2 + ahead, now + MS)  # one quick answer
    assert abs(clock.offset_ns - ahead) <= MS and clock.error_ns <= MS


def test_an_impossible_answer_is_left_out() -> None:
    clock = ClockOffset()
    clock.add(0, 100, 900, 500)
    assert clock.error_ns is None
    clock.add(0, 100, 200, 500)
    assert clock.offset_ns == -100


def test_each_conductor_has_a_clock_of_its_own() -> None:
    clocks, day = Clocks(), 86_400 * 10**9
    assert clocks.offset_ns(1) == 0 and clocks.answers(1) == 0
    clocks.add(1, 0, day + 5 * MS, day + 5 * MS, 10 * MS)
    clocks.add(2, 0, 5 * MS - day, 5 * MS - day, 10 * MS)
    assert (clocks.offset_ns(1), clocks.offset_ns(2), clocks.answers(1)) == (day, -day, 1)


def test_before_it_has_answered_what_arrives_first_says_how_a_clock_is() -> None:
    clocks, ahead = Clocks(), 10**15
    for late in (9, 2, 7):
        clocks.hear(1, ahead, late * MS)
    assert clocks.offset_ns(1) == ahead - 2 * MS
    clocks.add(1, 0, ahead + MS, ahead + MS, 2 * MS)
    assert clocks.offset_ns(1) == ahead


def test_clocks_that_were_long_not_heard_are_forgotten() -> None:
    clocks = Clocks()
    for holder in range(1, 100):
        clocks.hear(holder, 10**15 + holder, 0)
    assert clocks.offset_ns(1) == 0 and clocks.offset_ns(99) == 10**15 + 99
