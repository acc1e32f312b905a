"""controller.fleet.lease: there is one conductor at a time, and its tokens only grow."""

from __future__ import annotations

import random

from controller.fleet.lease import NOBODY, Lease, Token

LEASE_S = 0.25


def conductors(*waits: float) -> list[Lease]:
    return [Lease(holder, LEASE_S, wait_s, 0.0) for holder, wait_s in enumerate(waits, 1)]


def run(leases: list[Lease], begin_s: float, seconds: float, asleep: Lease | None = None) -> float:
    """Tick every 10 ms and tell the others of every token; one may be asleep. Returns the time at the end."""
    now = begin_s
    while now < begin_s + seconds:
        now += 0.01
        awake = [lease for lease in leases if lease is not asleep]
        beats = [lease.token for lease in awake if lease.tick(now)]
        for token in beats:
            for lease in awake:
                lease.hear(token, now)
    return now


def test_one_conducts_and_another_follows_within_half_a_second() -> None:
    first, second = leases = conductors(0.0, 0.03)
    now = run(leases, 0.0, 1.0)
    assert [lease.active for lease in leases] == [True, False] and first.token == Token(1, 1)
    died_s = now
    while not second.active:
        now = run(leases, now, 0.01, asleep=first)
    assert now - died_s < 0.5 and second.token > first.token


def test_one_that_has_just_started_waits_longer_also_after_a_pause() -> None:
    for pause_s in (0.0, 0.5):
        lease = Lease(3, 0.2, 0.02, 10.0, first_s=1.0)
        times = [10.0 + pause_s + 0.01 * k for k in range(1, 200)]
        begins = next(at for at in times if lease.tick(at))
        assert 11.2 < begins < 11.25
    heard = Lease(3, 0.2, 0.02, 10.0, first_s=1.0)
    heard.hear(Token(1, 9), 11.5)
    assert not any(heard.tick(11.0 + 0.01 * k) for k in range(70)) and any(
        heard.tick(11.7 + 0.01 * k) for k in range(5)
    )


def test_one_that_was_stopped_and_continues_steps_down_before_it_says_anything() -> None:
    first, second = leases = conductors(0.0, 0.03)
    now = run(leases, run(leases, 0.0, 1.0), 1.0, asleep=first)
    assert first.active  # it does not know yet
    assert not first.tick(now)
    run(leases, now, 1.0)
    assert [lease.active for lease in leases] == [False, True]
    assert (first.terms, first.lost, second.terms) == (1, 1, 1)


def test_whoever_hears_of_a_higher_token_steps_down_also_from_a_head() -> None:
    (lease,) = conductors(0.0)
    now = run([lease], 0.0, 1.0)
    lease.hear(Token(9, 77), now, alive=False)
    assert not lease.tick(now)
    run([lease], now, 1.0)
    assert lease.active and lease.token == Token(10, 1)


def test_equal_fences_are_ordered_by_the_holder() -> None:
    low, high = leases = conductors(0.0, 0.0)
    for lease in leases:  # a partition: both take over at the same time
        run([lease], 0.0, 0.5)
    assert low.active and high.active and low.token.fence == high.token.fence
    run(leases, 0.5, 0.2)
    assert [lease.active for lease in leases] == [False, True]


def test_whatever_is_lost_or_asleep_tokens_of_conductors_never_fall_and_differ() -> None:
    rng, leases = random.Random(7), conductors(0.0, 0.02, 0.04)
    seen: dict[Token, int] = {}
    highest, now, asleep = NOBODY, 0.0, [0.0] * 3
    for _ in range(20_000):
        now += 0.01
        for k, lease in enumerate(leases):
            if rng.random() < 0.001:
                asleep[k] = now + rng.uniform(0.05, 1.5)
            if now < asleep[k] or not lease.tick(now):
                continue
            assert seen.setdefault(lease.token, k) == k
            for j, other in enumerate(leases):
                if now >= asleep[j] and rng.random() < 0.8:
                    other.hear(lease.token, now)
            highest = max(highest, lease.token)
    assert highest.fence > 5
