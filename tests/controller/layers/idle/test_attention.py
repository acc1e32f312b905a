"""What the gaze rests on."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from controller.layers.idle.attention import _VERTICAL_FACTOR, Attention, Shift
from controller.layers.idle.draws import generator, mean_of
from controller.layers.idle.settings import GazeSettings, IdleSettings, Manner, PointSettings


def watched(
    settings: IdleSettings,
    manner: Manner,
    seconds: float = 5000.0,
    *,
    step_s: float = 5.0,
    gaze: GazeSettings | None = None,
) -> list[tuple[Shift, bool]]:
    """Every shift, and whether it is to the listener."""
    attention, table, found = Attention(gaze or settings.gaze, generator(1, "x")), settings.manner(manner), []
    shifts = attention.begin(0.0, table)
    for t in np.arange(0.0, seconds, step_s):
        found += [(shift, attention.on_listener) for shift in shifts]
        shifts = attention.advance(t, table)
    return found


SHARES = {"alone": 0.61, "listen": 0.86, "speak": 0.53}
"""Of the time at the listener: Argyle and Cook 1976; Andrist et al. 2013; Kendon 1967."""


@pytest.mark.parametrize("manner", SHARES)
def test_the_share_of_gaze_on_the_listener_is_as_published(settings: IdleSettings, manner: Manner) -> None:
    seen = watched(settings, manner)
    lengths = np.array([after[0].time_s - before[0].time_s for before, after in pairwise(seen)])
    at = np.array([on for _, on in seen[:-1]])
    assert lengths[at].sum() / lengths.sum() == pytest.approx(SHARES[manner], abs=0.03)
    changes = np.flatnonzero(np.diff(at.astype(int)))
    glances = np.diff([seen[i + 1][0].time_s for i in changes])
    table = settings.manner(manner)
    means = [mean_of(table.look_s), mean_of(table.away_s)]
    assert sorted([glances[::2].mean(), glances[1::2].mean()]) == pytest.approx(sorted(means), rel=0.08)


def test_fixations_are_as_long_as_the_file_says_and_never_shorter(settings: IdleSettings) -> None:
    forever = settings.listen.model_copy(update={"look_s": (3000.0, 3000.0)})
    seen = watched(settings.model_copy(update={"listen": forever}), "listen", 2900.0)
    lengths = np.diff([shift.time_s for shift, _ in seen])
    assert lengths.mean() == pytest.approx(mean_of(settings.gaze.fixation_s), rel=0.04) and lengths.min() >= 0.15
    assert all(on and math.hypot(shift.yaw_deg, shift.pitch_deg) < 6.5 for shift, on in seen)
    parts = [(shift.pitch_deg > 1.8, shift.yaw_deg > 0) for shift, _ in seen]
    assert 0.15 < np.mean([mouth for mouth, _ in parts]) < 0.3  # the eyes are looked at more than the mouth


def test_glances_away_have_the_published_sizes_and_directions(settings: IdleSettings) -> None:
    away = [shift for shift, on in watched(settings, "alone", 9000.0) if not on]
    sizes = np.hypot([s.yaw_deg for s in away], [s.pitch_deg / 0.8 for s in away])
    assert sizes.min() >= 6.0 and sizes.max() == pytest.approx(settings.alone.farthest_deg)
    beyond = sizes[sizes < 21.9] - 6.0
    assert np.median(beyond) == pytest.approx(6.9 * math.log(2) * 0.88, rel=0.12)  # exponential, cut at the farthest
    eighths = np.round(np.arctan2([-s.pitch_deg / 0.8 for s in away], [s.yaw_deg for s in away]) / (np.pi / 4)) % 8
    shares = np.bincount(eighths.astype(int), minlength=8) / len(away)
    wanted = np.array(settings.gaze.wander.directions)
    np.testing.assert_allclose(shares, wanted / wanted.sum(), atol=0.03)


def test_points_of_interest_are_looked_at_by_their_weights(settings: IdleSettings) -> None:
    points = {"screen": PointSettings(yaw_deg=30.0, pitch_deg=10.0, weight=3.0)}
    gaze = settings.gaze.model_copy(update={"points": points})
    away = [shift for shift, on in watched(settings, "speak", 3000.0, gaze=gaze) if not on]
    at_screen = [(shift.yaw_deg, shift.pitch_deg) == (30.0, 10.0) for shift in away]
    assert np.mean(at_screen) == pytest.approx(0.75, abs=0.03)


def test_it_is_turned_away_and_back_at_once_and_only_once(settings: IdleSettings) -> None:
    attention, table = Attention(settings.gaze, generator(1, "x")), settings.speak
    list(attention.begin(0.0, table))
    assert not list(attention.turn(0.1, table, on_listener=True))
    (new,) = list(attention.turn(0.15, table.model_copy(update={"look_s": (50.0, 50.0)}), on_listener=True)) or [None]
    list(attention.advance(50.1, table))
    assert new is None and attention.on_listener  # for a whole glance
    list(attention.advance(50.2, table))
    assert not attention.on_listener
    list(attention.begin(0.0, table))
    (away,) = attention.turn(0.2, table, on_listener=False)
    assert away.time_s == 0.2 and math.hypot(away.yaw_deg, away.pitch_deg) >= 1.8 and not attention.on_listener
    (back,) = attention.turn(0.3, table, on_listener=True)
    assert math.hypot(back.yaw_deg, back.pitch_deg) < 6.5 and attention.on_listener


@pytest.mark.parametrize("manner", SHARES)
def test_the_step_of_time_changes_nothing(settings: IdleSettings, manner: Manner) -> None:
    fine, coarse = (watched(settings, manner, 300.0, step_s=step_s) for step_s in (0.01, 1.0))
    assert [s for s, _ in coarse] == [s for s, _ in fine][: len(coarse)] and len(coarse) > 200


@pytest.mark.parametrize(
    ("weights", "share"), [((0.1, 0.3), 0.75), ((0.0, 0.5), 1.0), ((0.0, 0.0), 0.5), ((3.0, 1.0), 0.25)]
)
def test_a_choice_follows_its_weights_however_small_and_is_even_without(
    settings: IdleSettings, weights: tuple[float, float], share: float
) -> None:
    attention = Attention(settings.gaze, generator(1, "x"))
    chosen = [attention._choose((0, 1), weights) for _ in range(2000)]
    assert np.mean(chosen) == pytest.approx(share, abs=0.05)


@pytest.mark.parametrize(("farthest_deg", "most_deg"), [(12.0, 12.0), (0.5, None)])
def test_a_glance_is_no_smaller_than_the_least_and_no_larger_than_the_farthest(
    settings: IdleSettings, farthest_deg: float, most_deg: float | None
) -> None:
    attention, least_deg = Attention(settings.gaze, generator(1, "x")), settings.gaze.wander.least_deg
    most_deg = least_deg if most_deg is None else most_deg  # where even the least is farther than allowed
    found = np.array([attention._wander(farthest_deg) for _ in range(2000)])
    size = np.hypot(found[:, 0], found[:, 1] / _VERTICAL_FACTOR)
    assert size.min() >= least_deg - 1e-9 and size.max() == pytest.approx(most_deg, abs=1e-9)
    sector = np.round(np.arctan2(-found[:, 1] / _VERTICAL_FACTOR, found[:, 0]) / (np.pi / 4)).astype(int) % 8
    directions = np.array(settings.gaze.wander.directions)
    np.testing.assert_allclose(np.bincount(sector, minlength=8) / 2000, directions / directions.sum(), atol=0.04)
