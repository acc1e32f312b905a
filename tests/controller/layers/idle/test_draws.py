"""Distributions of a file, and sums of steps."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from controller.layers.idle.draws import Spread, Steps, draw, generator, mean_of


def test_evenly_drawn_times() -> None:
    numbers = generator(1, "x")
    times = [draw((2.0, 6.0), numbers) for _ in range(4000)]
    assert 2.0 <= min(times) < 2.01 and 5.99 < max(times) <= 6.0
    assert np.mean(times) == pytest.approx(mean_of((2.0, 6.0)), abs=0.06) and np.std(times) == pytest.approx(
        1.155, 0.03
    )


def test_times_of_a_gamma_distribution_have_its_mean_spread_and_least() -> None:
    spread, numbers = Spread(mean=4.0, sd=2.0, least=1.0), generator(1, "x")
    times = np.array([draw(spread, numbers) for _ in range(20000)])
    assert mean_of(spread) == 4.0 and times.mean() == pytest.approx(4.0, abs=0.05)
    assert times.std() == pytest.approx(2.0, abs=0.06) and times.min() >= 1.0
    skew = np.mean((times - times.mean()) ** 3) / times.std() ** 3
    assert skew == pytest.approx(2 * 2.0 / 3.0, abs=0.15)  # of a gamma distribution, twice sd over mean


def test_a_spread_whose_least_is_not_least_is_refused() -> None:
    with pytest.raises(ValidationError, match=r"least must be smaller than mean, 2 \(is 2\)"):
        Spread(mean=2.0, sd=1.0, least=2.0)


def test_numbers_of_a_behaviour_depend_on_seed_and_name_only() -> None:
    first, other, named = generator(1, "blinks"), generator(2, "blinks"), generator(1, "eyes")
    value = first.random()
    assert generator(1, "blinks").random() == value and value not in (other.random(), named.random())


def test_steps_add_up_where_they_overlap_and_arrive() -> None:
    alone, late, both = Steps(2), Steps(2), Steps(2)
    alone.move_to([1.0, -2.0], 0.0, 1.0)
    both.move_to([1.0, -2.0], 0.0, 1.0)
    late.move_to([2.0, 0.0], 0.5, 1.0)
    both.move_to([3.0, -2.0], 0.5, 1.0)
    for t in (-1.0, 0.0, 0.3, 0.7, 1.2, 1.5, 9.0):
        np.testing.assert_allclose(both.at(t), np.add(alone.at(t), late.at(t)), atol=1e-12)
    assert alone.at(0.5) == pytest.approx([0.5, -1.0]) and alone.at(0.1)[0] == pytest.approx(0.00856)  # minimum jerk
    before = both.at(1.2)
    both.drop_finished(1.2)
    assert both.at(1.2) == pytest.approx(before) and both.at(2.0) == pytest.approx([3.0, -2.0])
    both.reset()
    assert both.at(1.2) == [0.0, 0.0] and both.goal == [0.0, 0.0]
