"""Lips by the sound of a voice: vowels of published formants, friction and closures, by a synthesis of their own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.takes.voice import VoiceEnvelope
from controller.takes.voices import lips
from controller.takes.voices.lips import AHEAD, BANDS, BEFORE, INPUTS, band_levels, features, lip_model, loudness_db
from controller.vocabulary.visemes import Visemes
from tests.controller.takes.voices.synthesis import MEN, RATE, WOMEN, noise, resampled, resonate, vowel

MOUTHS = {"i": "E I", "ɪ": "E I", "ɛ": "E I aa", "æ": "E aa", "ɑ": "aa", "ɔ": "O", "ʊ": "O U RR", "u": "O U"}
JAW, PUCKER, PRESS = P.index("jawOpen"), P.index("mouthPucker"), P.index("mouthRollLower")
SILENCE = np.zeros(RATE // 10)


def faces(*sounds: np.ndarray, rate: int = RATE) -> np.ndarray:
    """(n, P) every 10 ms of a live voice."""
    ear, sound = VoiceEnvelope(P, rate), np.concatenate(sounds)
    hops = len(sound) // ear.hop
    return np.array([ear.process(hop) for hop in sound[: hops * ear.hop].reshape(hops, ear.hop)])


def nearest(face: np.ndarray) -> str:
    visemes = Visemes.load(P)
    return visemes.names[int(np.argmin(np.linalg.norm(visemes.matrix.T - face, axis=1)))]


@pytest.mark.parametrize("name", MEN)
@pytest.mark.parametrize(("table", "pitch_hz"), [(MEN, 120.0), (WOMEN, 215.0)])
def test_vowels_of_peterson_and_barney_have_their_mouths(
    table: dict[str, tuple[float, ...]], pitch_hz: float, name: str
) -> None:
    shown = faces(SILENCE, vowel(table[name], pitch_hz))[25:48].mean(axis=0)
    assert nearest(shown) in MOUTHS[name].split()


@pytest.mark.parametrize("rate", [8000, 11025, 22050, 44100, 48000])
def test_open_and_round_vowels_differ_at_every_rate(rate: int) -> None:
    quiet = np.zeros(rate // 10)
    sounds = (resampled(vowel(MEN[name], 120.0), rate) for name in "ɑɔ")
    wide, round_ = (faces(quiet, sound, rate=rate)[25:45].mean(axis=0) for sound in sounds)
    assert wide[JAW] > 0.3 and wide[PUCKER] < 0.3 < 0.5 < round_[PUCKER]


@pytest.mark.parametrize(
    ("low_hz", "high_hz", "loud", "viseme"),
    [(4500, 7800, 0.06, "SS"), (2000, 6000, 0.08, "CH"), (1200, 7800, 0.015, "FF")],
)
def test_friction_between_vowels_shows_where_it_hisses(low_hz: int, high_hz: int, loud: float, viseme: str) -> None:
    open_ = vowel(MEN["ɑ"], 120.0)
    shown = faces(SILENCE, open_, noise(low_hz, high_hz, 0.15, loud), open_)[58:66].mean(axis=0)
    assert nearest(shown) == viseme and shown[JAW] < 0.2


def test_lips_close_for_a_murmur_between_vowels() -> None:
    open_ = vowel(MEN["ɑ"], 120.0)
    hum = resonate(resonate(np.diff(np.floor(np.arange(1921) * 120 / RATE)), 250, 80, RATE), 1100, 300, RATE)
    shown = faces(SILENCE, open_, 0.1 * hum / np.abs(hum).max(), open_)
    assert shown[58:66, JAW].min() < 0.12 < 0.35 < shown[45, JAW] and shown[58:66, PRESS].max() > 0.2


@pytest.mark.parametrize("name", ["ɑ", "ɔ", "i"])
def test_the_mouth_is_there_80_ms_after_the_sound(name: str) -> None:
    shown = faces(SILENCE, SILENCE, vowel(MEN[name], 120.0, 0.5))
    final = shown[50:65].mean(axis=0)
    at = 20 + 8  # hops until the sound, and 80 ms
    assert np.linalg.norm(shown[at] - final) < 0.5 * np.linalg.norm(final)
    assert not shown[:20].any()


def test_levels_are_those_of_sines_and_nothing_is_above_half_the_rate() -> None:
    time = np.arange(400) / RATE
    for hz in (200.0, 1000.0, 3000.0, 6000.0):
        levels = band_levels(np.sin(2 * np.pi * hz * time), RATE)
        assert loudness_db(levels) == pytest.approx(0.0, abs=3.0) and levels.max() > -6.0
        softer, heard = band_levels(0.1 * np.sin(2 * np.pi * hz * time), RATE), levels > -80.0
        assert softer[heard] == pytest.approx(levels[heard] - 20.0, abs=0.1)
    low = band_levels(np.random.default_rng(0).normal(size=200), 8000)
    assert low.shape == (BANDS,) and low[-1] == -140.0 and low[0] > -40.0


def test_shares_sum_to_one_whatever_is_heard() -> None:
    random = np.random.default_rng(0)
    levels = random.uniform(-150, 30, (100, BANDS))
    found = features(levels, random.uniform(-60, 10, 100 - BEFORE - AHEAD))
    shares = lip_model().classify(found)
    assert found.shape == (100 - BEFORE - AHEAD, INPUTS) and found.min() >= 0.0 and found.max() <= 1.2
    np.testing.assert_allclose(shares.sum(axis=1), 1.0)
    assert shares.min() >= 0.0 and set(lip_model().visemes) == set(Visemes.load(P).names)


def test_stored_weights_are_256ths_and_are_read_once() -> None:
    stored, model = np.load(Path(lips.__file__).with_name("lips.npz")), lip_model()
    np.testing.assert_array_equal(256.0 * model.hidden, stored["hidden"])
    np.testing.assert_array_equal(256.0 * model.out, stored["out"])
    assert model.visemes == tuple(stored["visemes"]) and lip_model() is model


@pytest.mark.parametrize(("amplitude", "db"), [(1.0, 0.0), (0.1, -20.0), (0.0, -140.0)])
def test_a_sine_of_amplitude_one_has_no_db_in_its_band(amplitude: float, db: float) -> None:
    frame = amplitude * np.sin(2 * np.pi * 1000.0 * np.arange(round(0.025 * RATE)) / RATE)
    levels = band_levels(frame, RATE)
    assert levels.shape == (BANDS,) and levels.max() == pytest.approx(db, abs=1.5)
    assert band_levels(np.zeros((3, 200)), 8000).shape == (3, BANDS)
