"""The One Euro filter against its algorithm, step by step as the paper has it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from controller.links.net.one_euro import OneEuro


def by_the_paper(samples: list[float], rate_hz: float, min_cutoff: float, beta: float) -> list[float]:
    """Algorithm 1 of Casiez et al. 2012 for one number."""

    def alpha(cutoff: float) -> float:
        return 1.0 / (1.0 + rate_hz / (2 * math.pi * cutoff))

    x, dx, found = samples[0], 0.0, [samples[0]]
    for sample in samples[1:]:
        speed = (sample - x) * rate_hz
        dx = alpha(1.0) * speed + (1 - alpha(1.0)) * dx
        share = alpha(min_cutoff + beta * abs(dx))
        x = share * sample + (1 - share) * x
        found.append(x)
    return found


@pytest.mark.parametrize(("min_cutoff", "beta"), [(1.0, 0.0), (2.0, 1.0), (0.5, 5.0)])
def test_it_does_what_the_paper_says(min_cutoff: float, beta: float) -> None:
    samples = np.random.default_rng(2).normal(size=(50, 3)).cumsum(axis=0) * 0.1
    smooth = OneEuro(3, min_cutoff, beta)
    found = np.array([smooth(sample, n / 60) for n, sample in enumerate(samples)])
    expected = np.array([by_the_paper(list(column), 60.0, min_cutoff, beta) for column in samples.T]).T
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_after_a_reset_the_next_vector_passes_unchanged() -> None:
    smooth = OneEuro(1, 0.1, 0.0)
    smooth(np.array([0.0]), 0.0)
    assert smooth(np.array([1.0]), 0.01)[0] < 0.1
    smooth.reset()
    assert smooth(np.array([1.0]), 5.0)[0] == 1.0
