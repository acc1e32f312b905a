"""Pupils in time, and how pictures follow them and the breath."""

from __future__ import annotations

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.layers.idle.draws import generator
from controller.layers.idle.head import lung_volume
from controller.layers.idle.motion import IdleMotion
from controller.layers.idle.pupils import Follower, Pupils
from controller.layers.idle.settings import IdleSettings

TIMES = np.arange(0.0, 400.0, 0.05)


def path(settings: IdleSettings, seed: int = 1, **own: object) -> np.ndarray:
    pupils = Pupils(settings.pupil.model_copy(update=own), settings.breath, generator(seed, "pupils"))
    return np.array([pupils.at(t) for t in TIMES])


def test_pupils_are_never_still_and_stay_within_their_reach(settings: IdleSettings) -> None:
    pupil = settings.pupil
    for seed in range(5):
        wide = path(settings, seed)
        assert wide.std() > 0.015 and np.abs(wide).max() <= pupil.slow + pupil.fast + pupil.breath / 2
        assert abs(wide.mean()) < 0.01


@pytest.mark.parametrize(("kind", "other"), [("slow", "fast"), ("fast", "slow")])
def test_waves_keep_to_their_band(settings: IdleSettings, kind: str, other: str) -> None:
    wide = path(settings, breath=0.0, **{other: 0.0})
    power = np.abs(np.fft.rfft(wide * np.hanning(len(wide)))) ** 2
    hz = np.fft.rfftfreq(len(wide), 0.05)
    low, high = getattr(settings.pupil, f"{kind}_hz")
    assert power[(hz > low - 0.01) & (hz < high + 0.01)].sum() > 0.999 * power.sum()


def test_a_part_goes_with_the_breath(settings: IdleSettings) -> None:
    wide = path(settings, slow=0.0, fast=0.0, breath=0.04)
    lungs = np.array([lung_volume(settings.breath, t) for t in TIMES])
    np.testing.assert_allclose(wide, 0.04 * (lungs - 0.5), atol=1e-12)


def test_the_same_seed_gives_the_same_pupils(settings: IdleSettings) -> None:
    once = path(settings, 3)
    assert np.array_equal(path(settings, 3), once) and not np.allclose(path(settings, 4), once)


def beside(settings: IdleSettings, amount: float, rate_hz: float = 50.0, seconds: float = 12.0) -> np.ndarray:
    life = IdleMotion(P, settings, 2)
    life.liveliness, found = amount, []
    for k in range(round(seconds * rate_hz)):
        life.update(20.0 + k / rate_hz, looking=False)
        found.append(life.beside)
    return np.array(found)


def test_liveliness_scales_breath_and_pupils_and_0_is_rest(settings: IdleSettings) -> None:
    full = beside(settings, 1.0)
    assert full[:, 0].max() == pytest.approx(settings.breath.rise_mm, abs=0.01) and full[:, 0].min() == 0.0
    np.testing.assert_allclose(beside(settings, 0.4), 0.4 * full, atol=1e-12)
    assert not beside(settings, 0.0).any()
    np.testing.assert_allclose(beside(settings, 1.0, 100.0)[::2], full, atol=1e-9)  # whatever the rate


def test_what_follows_reaches_idle_motion_without_a_jump_and_is_then_where_it_is(settings: IdleSettings) -> None:
    follower, wanted = Follower(), beside(settings, 1.0, 100.0)
    assert follower.now == (0.0, 0.0)
    shown = []
    for k, now in enumerate(wanted):
        follower.follow((now[0], now[1]), 20.0 + k / 100)
        shown.append(follower.now)
    steps = np.abs(np.diff([(0.0, 0.0), *shown], axis=0)).max(axis=0)
    assert steps[0] <= 0.1201 and steps[1] <= 0.00601
    assert np.array_equal(np.array(shown)[50:], wanted[50:])
    follower.follow((0.0, 0.0), 32.01)
    for k in range(60):
        follower.follow((0.0, 0.0), 32.01 + k / 100)
    assert follower.now == (0.0, 0.0)
