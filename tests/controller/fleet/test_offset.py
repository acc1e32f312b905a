"""controller.fleet.offset: the offset of a clock is found through a network that delays unevenly."""

from __future__ import annotations

import random

from controller.fleet.offset import ClockOffset

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


def test_an_impossible_answer_is_left_out_and_another_clock_begins_anew() -> None:
    clock = ClockOffset()
    clock.add(0, 100, 900, 500)
    assert clock.error_ns is None
    clock.add(0, 100, 200, 500)
    assert clock.offset_ns == -100
    clock.forget()
    assert (clock.offset_ns, clock.error_ns) == (0, None)
