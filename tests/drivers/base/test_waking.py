"""How late the system wakes a thread, learned from its waits."""

import random

import pytest

from drivers.base.waking import MAX_DELAY_S, WakeDelay


@pytest.mark.parametrize("share", [0.1, 0.5, 0.8])
def test_so_large_a_share_of_all_waits_ends_no_later(share: float) -> None:
    rng, delay = random.Random(1), WakeDelay(share, 50e-6)
    found = []
    for _ in range(20_000):
        delay.note(rng.uniform(0.0, 80e-6))
        found.append(delay.late_s)
    assert sum(found[1000:]) / len(found[1000:]) == pytest.approx(share * 80e-6, abs=4e-6)


def test_it_stays_between_none_and_the_longest() -> None:
    delay = WakeDelay(0.5, 50e-6)
    for _ in range(1000):
        delay.note(1.0)
    assert delay.late_s == MAX_DELAY_S
    for _ in range(1000):
        delay.note(-1.0)
    assert delay.late_s == 0.0
