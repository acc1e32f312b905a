"""Estimates from the sound of a voice which viseme the lips show, every 10 ms.

A frame of 25 ms is reduced to the energies of 24 bands that are equally wide in mel, relative to the voice's own
loudness. The shape of the lips follows from these bands, where formants and friction stand, and from those shortly
before and after, where closures and bursts stand, by a small network (one hidden layer). Its weights are in
``lips.npz``, learnt from speech of flite and espeak-ng; ``benchmarks/voice_shapes.py`` measures how well they do.
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
"""Time from a frame to the next."""
WINDOW_S = 0.025
"""Length of a frame."""
BANDS = 24
OFFSETS = (-10, -5, -2, 2, 4)
"""Frames beside the one that is judged, of which the bands are taken two at a time."""
BEFORE, AHEAD = -OFFSETS[0], OFFSETS[-1]
"""How many frames before and after it are needed to judge a frame."""
INPUTS = BANDS + len(OFFSETS) * BANDS // 2

_LOWEST_HZ, _HIGHEST_HZ = 80.0, 7600.0
_RANGE_DB = 50.0
_LEAST_POWER = 1e-14


@dataclass(frozen=True, eq=False)
class LipModel:
    """The network: ``hidden`` (INPUTS + 1, h) and ``out`` (h + 1, n) float64, the last row of each added to its sums.

    visemes : names of the n visemes that it distinguishes.
    """

    visemes: tuple[str, ...]
    hidden: Floats
    out: Floats

    def judge(self, features: Floats) -> Floats:
        """(..., n) shares of the visemes, which sum to 1, of features (..., INPUTS)."""
        inner = np.tanh(features @ self.hidden[:-1] + self.hidden[-1])
        score = inner @ self.out[:-1] + self.out[-1]
        share: Floats = np.exp(score - score.max(axis=-1, keepdims=True))
        share /= share.sum(axis=-1, keepdims=True)
        return share


@cache
def lip_model() -> LipModel:
    """The shipped network."""
    stored = files.read_npz(Path(__file__).with_name("lips.npz"))
    return LipModel(tuple(map(str, stored["visemes"])), stored["hidden"] / 256.0, stored["out"] / 256.0)


def band_levels(frames: Floats, rate_hz: int) -> Floats:
    """(..., BANDS) energies of frames (..., n) of samples -1..1, dB; a sine of amplitude 1 has 0 dB in its band.

    Bands above half the rate have the least energy there is.
    """
    window, bands = _bands(frames.shape[-1], rate_hz)
    power = np.abs(np.fft.rfft(frames * window)) ** 2
    levels: Floats = 10.0 * np.log10(power @ bands + _LEAST_POWER)
    return levels


@cache
def _bands(size: int, rate_hz: int) -> tuple[Floats, Floats]:
    """A Hann window (size,), and triangular bands (bins, BANDS), after Davis and Mermelstein 1980."""
    window = np.hanning(size)
    edges = 700.0 * np.expm1(np.linspace(_mel(_LOWEST_HZ), _mel(_HIGHEST_HZ), BANDS + 2) / 1127.0)
    pitch = np.fft.rfftfreq(size, 1 / rate_hz)[:, None]
    rise = (pitch - edges[:-2]) / (edges[1:-1] - edges[:-2])
    fall = (edges[2:] - pitch) / (edges[2:] - edges[1:-1])
    bands = np.clip(np.minimum(rise, fall), 0.0, 1.0)
    return window, bands / (window.sum() / 2) ** 2


def _mel(hz: float) -> float:
    return 1127.0 * math.log1p(hz / 700.0)


def loudness_db(levels: Floats) -> Floats:
    """(...) loudness of all bands (..., BANDS) together, dB."""
    total: Floats = 10.0 * np.log10(np.sum(10.0 ** (levels / 10.0), axis=-1))
    return total


def features(levels: Floats, loud_db: Floats | float) -> Floats:
    """(k, INPUTS) of the frames BEFORE.. of levels (k + BEFORE + AHEAD, BANDS), dB, which are relative to ``loud_db``.

    ``loud_db`` : how loud the voice is where it is loudest; a number, or (k,) one for each frame.
    """
    count = len(levels) - BEFORE - AHEAD
    loud = np.broadcast_to(np.asarray(loud_db, dtype=np.float64), (count,))[:, None]
    pairs = 0.5 * (levels[:, ::2] + levels[:, 1::2])
    around = [pairs[BEFORE + step : BEFORE + step + count] for step in OFFSETS]
    here = np.concatenate([levels[BEFORE : BEFORE + count], *around], axis=1)
    return np.clip((here - loud) / _RANGE_DB + 1.0, 0.0, 1.2)
