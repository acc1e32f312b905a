"""What safety rules share: ranges, counters, and the rule of temperature in closed form."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from controller.robot.rules import AllowedRange, HeatRules, RuleCounter, RuleInput

NAMES = ("jaw", "brow", "lid")


def test_ranges_are_only_narrowed_each_way_by_the_tightest() -> None:
    allowed = AllowedRange(np.full(3, -1.0), np.full(3, 1.0))
    at, sign = np.array([0, 0, 1, 2, 2]), np.array([1.0, 1.0, -1.0, 1.0, -1.0])
    bound = np.array([0.5, 0.25, -0.5, 2.0, -2.0])
    allowed.narrow(at, sign, bound, np.array([True] * 5))
    assert allowed.high.tolist() == [0.25, 1.0, 1.0] and allowed.low.tolist() == [-1.0, -0.5, -1.0]
    allowed.narrow(at, sign, np.zeros(5), np.array([False, False, False, True, False]))
    assert allowed.high.tolist() == [0.25, 1.0, 0.0] and allowed.low.tolist() == [-1.0, -0.5, -1.0]
    allowed.narrow(at, sign, np.zeros(5), np.zeros(5, bool))
    assert allowed.high.tolist() == [0.25, 1.0, 0.0]


def test_a_rule_counts_when_it_begins_and_while_it_acts() -> None:
    counter = RuleCounter(["a", "b", "c"])
    for a, b in ((1, 0), (1, 1), (0, 1), (1, 1)):
        counter.count(np.array([a, b, 0], bool), 0.25)
    assert counter.report() == [
        {"rule": "a", "times": 2, "seconds": 0.75}, {"rule": "b", "times": 1, "seconds": 0.75}
    ]  # fmt: skip


def heat(**given: float) -> HeatRules:
    numbers: dict[str, Any] = {"above_c": 50.0, "full_c": 70.0, "range": 0.5, "speed": 0.2, "channels": ["lid", "jaw"]}
    table: Any = SimpleNamespace(names=NAMES, low_rad=np.array([-1.0, -2, -3]), high_rad=np.array([1.0, 2, 3]))
    rule: Any = SimpleNamespace(**numbers | given)
    return HeatRules([rule], table, np.array([0.5, 0.0, -1.0]))


def cycle(rules: HeatRules, celsius: list[float] | None, dt: float = 10.0) -> AllowedRange:
    """Bounds of every servo after one cycle; 10 s are long enough for a reading to take effect."""
    allowed = AllowedRange(np.full(3, -9.0), np.full(3, 9.0))
    state: Any = None if celsius is None else SimpleNamespace(temperature_c=np.array(celsius))
    zero = np.zeros(3)
    rules.narrow(RuleInput(zero, zero, zero, state, dt), allowed)
    return allowed


@pytest.mark.parametrize(("celsius", "warmth"), [(50.0, 0.0), (55.0, 0.25), (60.0, 0.5), (70.0, 1.0), (99.0, 1.0)])
def test_a_warm_servo_moves_less_far_about_the_neutral_face_and_less_fast(celsius: float, warmth: float) -> None:
    rules = heat()
    allowed = cycle(rules, [celsius, 99.0, 20.0])  # the brow has no rule, the lid is cold
    kept = 1.0 - 0.5 * warmth
    if warmth:
        assert (allowed.low[0], allowed.high[0]) == pytest.approx((0.5 - 1.5 * kept, 0.5 + 0.5 * kept))
    else:
        assert (allowed.low[0], allowed.high[0]) == (-9.0, 9.0)
    assert allowed.high[1:].tolist() == [9, 9] and allowed.low[1:].tolist() == [-9, -9]
    assert rules.speed_fraction.tolist() == pytest.approx([1.0 - 0.8 * warmth, 1.0, 1.0])
    assert [row["rule"] for row in rules.counter.report()] == (["heat jaw"] if warmth else [])


def test_a_reading_takes_effect_over_two_seconds_both_ways() -> None:
    rules = heat()
    shares = []
    for celsius in [70.0] * 5 + [20.0] * 5:
        cycle(rules, [celsius, 0.0, 0.0], 0.5)
        shares.append(rules.speed_fraction[0])
    assert shares == pytest.approx([0.8, 0.6, 0.4, 0.2, 0.2, 0.4, 0.6, 0.8, 1.0, 1.0])
    assert rules.counter.report() == [{"rule": "heat jaw", "times": 1, "seconds": 4.0}]


def test_what_is_not_measured_changes_nothing() -> None:
    rules = heat()
    for celsius in (None, [np.nan] * 3):
        assert cycle(rules, celsius).high.tolist() == [9, 9, 9]
    cycle(rules, [60.0, 20.0, 70.0])
    for celsius in (None, [np.nan] * 3):  # it keeps the last one
        cycle(rules, celsius)
        assert rules.speed_fraction.tolist() == pytest.approx([0.6, 1.0, 0.2])


def test_of_two_rules_the_slower_counts() -> None:
    table: Any = SimpleNamespace(names=NAMES, low_rad=np.full(3, -1.0), high_rad=np.full(3, 1.0))
    each: Any = [
        SimpleNamespace(above_c=50.0, full_c=60.0, range=1.0, speed=speed, channels=["jaw"]) for speed in (0.5, 0.1)
    ]
    both = HeatRules(each, table, np.zeros(3))
    cycle(both, [60.0, 0, 0])
    assert both.speed_fraction[0] == pytest.approx(0.1)
