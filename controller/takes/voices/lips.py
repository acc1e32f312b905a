"""Estimates from the sound of a voice which viseme the lips show, every 10 ms.

A frame of 25 ms is reduced to the energies of 24 bands that are equally wide in mel, relative to the voice's loudness.
A small network with one hidden layer estimates the viseme from these bands, which show formants and frication, and from
the bands shortly before and after, which show closures and bursts. Its weights are in ``lips.npz``. They were trained
on speech of flite and espeak-ng; ``benchmarks/voice_shapes.py`` measures its accuracy.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from controller.base.parameters import Floats
from surface.base import files

HOP_S = 0.01
"""Time from one frame to the next."""
WINDOW_S = 0.025
"""Length of a frame."""
BANDS = 24
OFFSETS = (-10, -5, -2, 2, 4)
"""Positions of the context frames relative to the classified frame; their bands are averaged in pairs."""
BEFORE, AHEAD = -OFFSETS[0], OFFSETS[-1]
"""How many frames before and after a frame are needed to classify it."""
INPUTS = BANDS + len(OFFSETS) * BANDS // 2

_MIN_BAND_HZ, _MAX_BAND_HZ = 80.0, 7600.0
_RANGE_DB = 50.0  # below the loudness of the voice, mapped to 0..1
_MIN_POWER = 1e-14


@dataclass(frozen=True, eq=False)
class LipModel:
    """The network.

    visemes : names of the n visemes that it distinguishes. hidden : (INPUTS + 1, h) float64, and out : (h + 1, n)
    float64, the weights of the two layers; the last row of each is its bias.
    """

    visemes: tuple[str, ...]
    hidden: Floats
    out: Floats

    def classify(self, features: Floats) -> Floats:
        """Return the (..., n) probabilities of the visemes, which sum to 1, for features (..., INPUTS)."""
        inner = np.tanh(features @ self.hidden[:-1] + self.hidden[-1])
        score = inner @ self.out[:-1] + self.out[-1]
        probabilities: Floats = np.exp(score - score.max(axis=-1, keepdims=True))
        probabilities /= probabilities.sum(axis=-1, keepdims=True)
        return probabilities


@cache
def lip_model() -> LipModel:
    """Return the shipped network, which is read only once."""
    stored = files.read_npz(Path(__file__).with_name("lips.npz"))
    return LipModel(tuple(map(str, stored["visemes"])), stored["hidden"] / 256.0, stored["out"] / 256.0)


def band_levels(frames: Floats, rate_hz: int) -> Floats:
    """Return the (..., BANDS) energies, in dB, of frames (..., n) of samples -1..1.

    A sine of amplitude 1 has 0 dB in its band. Bands above half the rate have -140 dB.
    """
    window, bands = _bands(frames.shape[-1], rate_hz)
    power = np.abs(np.fft.rfft(frames * window)) ** 2
    levels: Floats = 10.0 * np.log10(power @ bands + _MIN_POWER)
    return levels


@cache
def _bands(size: int, rate_hz: int) -> tuple[Floats, Floats]:
    """Return a Hann window (size,) and triangular bands (bins, BANDS), after Davis and Mermelstein 1980."""
    window = np.hanning(size)
    edges = 700.0 * np.expm1(np.linspace(_mel(_MIN_BAND_HZ), _mel(_MAX_BAND_HZ), BANDS + 2) / 1127.0)
    pitch = np.fft.rfftfreq(size, 1 / rate_hz)[:, None]
    rise = (pitch - edges[:-2]) / (edges[1:-1] - edges[:-2])
    fall = (edges[2:] - pitch) / (edges[2:] - edges[1:-1])
    bands = np.clip(np.minimum(rise, fall), 0.0, 1.0)
    return window, bands / (window.sum() / 2) ** 2


def _mel(hz: float) -> float:
    return 1127.0 * math.log1p(hz / 700.0)


def loudness_db(levels: Floats) -> Floats:
    """Return the (...) loudness, in dB, of all bands (..., BANDS) together."""
    total: Floats = 10.0 * np.log10(np.sum(10.0 ** (levels / 10.0), axis=-1))
    return total


def features(levels: Floats, loud_db: Floats | float) -> Floats:
    """Return the network's inputs (k, INPUTS) for k frames.

    levels : (k + BEFORE + AHEAD, BANDS) dB, of the frames and those before and after. loud_db : the greatest loudness
    of the voice, to which the inputs are relative; one number, or (k,) one for each frame.
    """
    count = len(levels) - BEFORE - AHEAD
    loud = np.broadcast_to(np.asarray(loud_db, dtype=np.float64), (count,))[:, None]
    pairs = 0.5 * (levels[:, ::2] + levels[:, 1::2])
    context = [pairs[BEFORE + step : BEFORE + step + count] for step in OFFSETS]
    inputs = np.concatenate([levels[BEFORE : BEFORE + count], *context], axis=1)
    return np.clip((inputs - loud) / _RANGE_DB + 1.0, 0.0, 1.2)
