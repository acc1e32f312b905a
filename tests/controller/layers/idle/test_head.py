"""Turns, posture, sway, breath and nods."""

from __future__ import annotations

import math

import numpy as np
import pytest

from controller.layers.idle.attention import Shift
from controller.layers.idle.draws import generator
from controller.layers.idle.head import Nod, Nods, Posture, Sway, Turn, lung_volume
from controller.layers.idle.settings import IdleSettings


def test_the_head_takes_its_share_of_what_the_eyes_do_not_reach_in_comfort(settings: IdleSettings) -> None:
    for yaw_deg, pitch_deg in ((3.9, 0.0), (12.0, 5.0), (-20.0, 0.0)):
        turn, size = Turn(settings.turn), math.hypot(yaw_deg, pitch_deg)
        turn.follow(Shift(1.0, yaw_deg, pitch_deg))
        beyond = max(0.0, size - 4.0) / size
        wanted = math.radians(0.55 * beyond * yaw_deg), math.radians(0.3 * beyond * pitch_deg), 0.0
        assert turn.at(9.0) == pytest.approx(wanted)
        assert turn.at(1.0 + settings.turn.delay_s) == (0.0, 0.0, 0.0)  # the eyes go first
    nowhere = Turn(settings.turn)
    nowhere.follow(Shift(0.0, 0.0, 0.0))
    assert nowhere.at(1.0) == (0.0, 0.0, 0.0)


def test_the_head_turns_in_its_own_time(settings: IdleSettings) -> None:
    turn = Turn(settings.turn)
    turn.follow(Shift(0.0, 22.0, 0.0))
    times = np.arange(0.0, 2.0, 0.001)
    yaw = np.degrees([turn.at(t)[0] for t in times])
    moving = times[(yaw > 0.0) & (yaw < yaw[-1] - 1e-9)]
    assert moving[-1] - moving[0] == pytest.approx(0.45 + 0.02 * yaw[-1], abs=0.02)
    turn.drop_finished(2.0)
    assert math.degrees(turn.at(1.9)[0]) == pytest.approx(yaw[-1])


def test_posture_changes_now_and_then_slowly_and_within_its_reach(settings: IdleSettings) -> None:
    posture, times = Posture(settings.posture, generator(1, "x")), np.arange(0.0, 900.0, 0.1)
    posture.begin(0.0)
    path = []
    for t in times:
        posture.advance(t)
        path.append(posture.at(t))
    degrees = np.degrees(path)
    assert np.all(np.abs(degrees).max(axis=0) < (4.001, 2.501, 4.001)) and np.all(
        np.ptp(degrees, axis=0) > (5.0, 3.0, 5.0)
    )
    assert np.abs(np.diff(degrees, axis=0)).max() / 0.1 < 14.0  # deg/s
    begun = np.count_nonzero(np.diff((np.abs(np.diff(degrees, axis=0)).sum(axis=1) > 0.01).astype(int)) > 0)
    assert begun / 900 == pytest.approx(1 / 9.0, rel=0.2)


def test_sway_is_three_waves_on_each_axis_and_grows_when_busy(settings: IdleSettings) -> None:
    head = settings.head.model_copy(update={"yaw_deg": 8.0, "pitch_deg": 4.0, "roll_deg": 2.0, "period_s": (3.0, 9.0)})
    breath = settings.breath.model_copy(update={"pitch_deg": 0.0})
    sway = Sway(head, breath, generator(5, "x"))
    assert sway.waves.shape == (3, 3, 2) and np.all((sway.waves[..., 0] >= 3.0) & (sway.waves[..., 0] <= 9.0))
    for now_s in (0.0, 1.7, 44.0):
        waves = [[math.sin(2 * math.pi * now_s / period + phase) for period, phase in axis] for axis in sway.waves]
        wanted = np.radians([8.0, 4.0, 2.0]) * np.mean(waves, axis=1)
        np.testing.assert_allclose(sway.at(now_s), wanted, atol=1e-12)
    before = np.array(sway.at(60.0))
    sway.set_gain(1.5, 50.0)
    np.testing.assert_allclose(sway.at(60.0), 1.5 * before)
    np.testing.assert_allclose(sway.at(50.0), Sway(head, breath, generator(5, "x")).at(50.0))  # not at once


def test_breath_follows_its_four_parts_and_raises_the_head(settings: IdleSettings) -> None:
    parts = {"inhale_s": 2.0, "hold_s": 1.0, "exhale_s": 4.0, "pause_s": 3.0, "pitch_deg": 5.0}
    breath = settings.breath.model_copy(update=parts)
    still = settings.head.model_copy(update={"yaw_deg": 0.0, "pitch_deg": 0.0, "roll_deg": 0.0})
    sway = Sway(still, breath, generator(1, "x"))
    full = {0.0: 0.0, 1.0: 0.5, 2.0: 1.0, 2.9: 1.0, 3.0: 1.0, 5.0: 0.5, 7.0: 0.0, 9.9: 0.0, 10.0: 0.0, 11.0: 0.5}
    for now_s, share in full.items():
        assert lung_volume(breath, now_s) == pytest.approx(share)
        assert sway.at(now_s) == pytest.approx((0.0, -math.radians(5.0) * share, 0.0)), now_s
    natural = settings.breath
    length_s = natural.inhale_s + natural.hold_s + natural.exhale_s + natural.pause_s
    assert 12 <= 60 / length_s <= 18  # breaths a minute at rest


def test_a_nod_goes_down_and_comes_back_and_fades() -> None:
    nod = Nod(2.0, 0.1, 0.4, cycles=2, fade=0.5)
    assert [nod.at(t) for t in (1.9, 2.0, 2.2, 2.4, 2.6, 2.8, 3.0)] == pytest.approx([0, 0, 0.1, 0, 0.05, 0, 0])
    assert nod.end_s == pytest.approx(2.8)


def test_only_a_listener_nods_by_itself(settings: IdleSettings) -> None:
    for listening, count in ((True, 3600 / 8.9), (False, 0)):
        nods, found = Nods(settings.nod, generator(1, "x")), {}
        nods.begin(0.0)
        for t in np.arange(0.0, 3600.0, 0.5):
            nods.advance(t, listening=listening)
            found |= {id(nod): nod for nod in nods.nods}
        assert len(found) == pytest.approx(count, rel=0.1)
        assert {nod.cycles for nod in found.values()} <= {1, 2, 3}
        assert all(
            1.8 <= 1 / nod.cycle_s <= 3.7 and 1.8 <= math.degrees(nod.depth_rad) <= 4.0 for nod in found.values()
        )
    nods.nod(3600.0, 0.05, 0.4)
    assert nods.at(3600.2) == pytest.approx((0.0, 0.05, 0.0))


def test_the_last_half_second_can_still_be_asked_for_and_what_ended_before_is_dropped(settings: IdleSettings) -> None:
    turn, sway, nods = (
        Turn(settings.turn),
        Sway(settings.head, settings.breath, generator(1, "x")),
        Nods(settings.nod, generator(1, "x")),
    )
    posture = Posture(
        settings.posture.model_copy(update={"interval_s": (100.0, 100.0), "length_s": (1.0, 1.0)}), generator(1, "x")
    )
    posture.begin(0.0)  # the first change is after half an interval
    posture.advance(50.0)
    turn.follow(Shift(0.0, 22.0, 0.0))
    ((start_s, length_s, _),) = turn._steps._steps
    sway.set_gain(1.5, 10.0)
    nods.nod(0.0, 0.05, 0.4)
    for end_s, advance, kept, made in (
        (start_s + length_s, turn.drop_finished, lambda: turn._steps._steps, turn),
        (51.0, posture.advance, lambda: posture._steps._steps, posture),
        (10.8, lambda now_s: sway.set_gain(1.5, now_s), lambda: sway._gain._steps, sway),
        (0.4, lambda now_s: nods.advance(now_s, listening=False), lambda: nods.nods, nods),
    ):
        before = made.at(end_s - 0.1)
        advance(end_s + 0.49)
        assert len(kept()) == 1 and made.at(end_s - 0.1) == before
        advance(end_s + 0.51)
        assert not kept(), made


@pytest.mark.parametrize(("gain", "changes"), [(1.0, 0), (1.0 + 1e-10, 0), (1.0 + 1e-8, 1), (0.5, 1)])
def test_the_sway_changes_in_eight_tenths_of_a_second_where_its_gain_changes(
    settings: IdleSettings, gain: float, changes: int
) -> None:
    sway = Sway(settings.head, settings.breath, generator(1, "x"))
    for _ in range(2):
        sway.set_gain(gain, 10.0)
        assert [step[:2] for step in sway._gain._steps] == [(10.0, 0.8)] * changes
