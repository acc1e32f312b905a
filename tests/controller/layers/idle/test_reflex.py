"""Pupils as the light changes."""

from __future__ import annotations

import numpy as np
import pytest

from controller.layers.idle.reflex import LightReflex
from controller.layers.idle.settings import IdleSettings


def widths(settings: IdleSettings, first: float, then: float, rate_hz: float = 100.0) -> np.ndarray:
    """How wide pupils are in the 8 s after the light changes: it makes them ``first`` wide before, ``then`` after."""
    reflex = LightReflex(settings.pupil)
    assert [reflex.follow(first, t) for t in (0.0, 5.0)] == [first, first]
    return np.array([reflex.follow(then, 5.0 + k / rate_hz) for k in range(round(8 * rate_hz))])


def test_pupils_narrow_within_a_second_after_a_latency(settings: IdleSettings) -> None:
    wide = widths(settings, 1.77, 0.8)
    assert (np.diff(wide) <= 0.0).all() and wide.min() == 0.8
    assert (wide[:18] == 1.77).all() and wide[20] < 1.77
    share = (wide - 0.8) / 0.97
    assert share[48] == pytest.approx(0.42, abs=0.02)  # a latency and three lags of 0.1 s later: (1 + 3 + 4.5) / e^3
    assert share[100] < 0.02


def test_pupils_widen_over_seconds(settings: IdleSettings) -> None:
    wide = widths(settings, 0.8, 1.77)
    assert (np.diff(wide) >= 0.0).all() and wide.max() == 1.77
    share = (1.77 - wide) / 0.97
    assert share[100] > 0.4 and share[200] > 0.05 and share[350] < 0.01


def test_the_width_at_a_time_is_the_same_for_every_frame_rate(settings: IdleSettings) -> None:
    for first, then in ((1.77, 0.8), (0.8, 1.77)):
        fine = widths(settings, first, then, 200.0)
        np.testing.assert_allclose(widths(settings, first, then, 10.0), fine[::20], atol=2e-4)


def test_a_light_that_returns_within_the_latency_is_followed_both_times(settings: IdleSettings) -> None:
    reflex = LightReflex(settings.pupil)
    reflex.follow(1.0, 0.0)
    seen = [reflex.follow(0.5 if k < 10 else 1.0, k / 100) for k in range(600)]
    assert 0.7 < min(seen) < 0.995 and seen[-1] == 1.0
    assert 18 < int(np.argmin(seen)) < 100  # then they widen again


def test_nothing_changes_where_the_light_does_not(settings: IdleSettings) -> None:
    reflex = LightReflex(settings.pupil)
    assert {reflex.follow(1.3, 0.02 * k) for k in range(500)} == {1.3}
