"""Utterances, stresses and what goes along with them."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.layers.idle.draws import generator
from controller.layers.idle.settings import IdleSettings
from controller.layers.idle.speech import Emphasis, SpeechDetector


def heard(
    settings: IdleSettings, loudness: Callable[[float], float], seconds: float, step_s: float = 0.01
) -> dict[str, list[float]]:
    """When utterances began and ended, and syllables were stressed."""
    hearing = SpeechDetector(settings.speech)
    found: dict[str, list[float]] = {"began": [], "ended": [], "stressed": []}
    for t in np.arange(0.0, seconds, step_s):
        now = hearing.update(loudness(float(t)), float(t))
        for what, times in found.items():
            if getattr(now, what):
                times.append(float(t))
    return found


def test_an_utterance_begins_with_sound_and_ends_after_a_pause(
    settings: IdleSettings, voice: Callable[[float], float]
) -> None:
    found = heard(settings, voice, 40.0)
    assert np.array(found["began"]) % 8.0 == pytest.approx([0.03] * 5, abs=0.1)
    assert np.array(found["ended"]) % 8.0 == pytest.approx([6.6] * 5, abs=0.15)


def test_stressed_syllables_are_the_loud_ones_and_not_too_many(
    settings: IdleSettings, voice: Callable[[float], float]
) -> None:
    found = heard(settings, voice, 400.0)
    times = np.array(found["stressed"])
    assert 0.8 < len(times) / 300.0 < 2.0  # a second of speech; people stress about every third syllable
    assert np.diff(times).min() >= settings.speech.stress_gap_s
    peak = [max(voice(int(t * 4.5) / 4.5 + k / 45) for k in range(10)) for t in times]
    assert np.percentile(peak, 8) > 0.25 and np.mean(peak) > 0.36  # of 0.15 to 0.5, mean 0.32


def test_a_murmur_and_a_steady_tone_have_no_stresses(settings: IdleSettings) -> None:
    assert not heard(settings, lambda t: 0.06 + 0.01 * math.sin(20 * t), 20.0)["stressed"]
    assert len(heard(settings, lambda t: 0.5, 20.0)["stressed"]) == 1
    silent = heard(settings, lambda t: 0.0, 20.0)
    assert silent == {"began": [], "ended": [], "stressed": []}


def test_a_slower_face_hears_the_same_utterances(settings: IdleSettings, voice: Callable[[float], float]) -> None:
    fine, coarse = (heard(settings, voice, 80.0, step_s) for step_s in (0.01, 0.03))
    assert coarse["ended"] == pytest.approx(fine["ended"], abs=0.2) and len(coarse["began"]) == len(fine["began"])
    assert len(coarse["stressed"]) == pytest.approx(len(fine["stressed"]), rel=0.15)


def test_syllables_are_underlined_in_their_shares(settings: IdleSettings) -> None:
    emphasis, speech = Emphasis(P, settings.speech, generator(1, "x")), settings.speech
    brows = P.region("brows")
    raised, beats = 0, []
    for i in range(2000):
        beats.append(emphasis.stress(i * 2.0))
        row = P.neutral()
        emphasis.add(row, i * 2.0 + speech.rise_s, 1.0)
        raised += row[brows].any()
        assert row.max() <= 0.36
        still = P.neutral()
        emphasis.add(still, i * 2.0 + 1.9, 1.0)
        assert not still.any()
    assert raised / 2000 == pytest.approx(speech.brow_share, abs=0.03)
    nods = np.degrees([beat.nod_rad for beat in beats if beat.nod_rad])
    assert len(nods) / 2000 == pytest.approx(speech.nod_share, abs=0.04)
    assert nods.min() >= speech.nod_deg[0] and nods.max() <= speech.nod_deg[1]
    assert np.mean([beat.blink for beat in beats]) == pytest.approx(speech.blink_share, abs=0.02)
    assert np.mean([emphasis.end().blink for _ in range(1000)]) == pytest.approx(speech.end_blink_share, abs=0.05)
    assert np.mean([emphasis.draw_look_away() for _ in range(1000)]) == pytest.approx(speech.away_share, abs=0.05)
