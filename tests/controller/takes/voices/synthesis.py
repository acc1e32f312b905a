"""Sounds whose mouths are known: vowels by a source and resonators, friction, closures; nothing of omote is used.

Formants: averages of Peterson and Barney 1952 ("Control methods used in a study of the vowels", table II). Resonators:
Klatt 1980 ("Software for a cascade/parallel formant synthesizer", eq. 2).
"""

from __future__ import annotations

import numpy as np

RATE = 16000
MEN = {
    "i": (270, 2290, 3010), "ɪ": (390, 1990, 2550), "ɛ": (530, 1840, 2480), "æ": (660, 1720, 2410),
    "ɑ": (730, 1090, 2440), "ɔ": (570, 840, 2410), "ʊ": (440, 1020, 2240), "u": (300, 870, 2240),
}  # fmt: skip
WOMEN = {
    "i": (310, 2790, 3310), "ɪ": (430, 2480, 3070), "ɛ": (610, 2330, 2990), "æ": (860, 2050, 2850),
    "ɑ": (850, 1220, 2810), "ɔ": (590, 920, 2710), "ʊ": (470, 1160, 2680), "u": (370, 950, 2670),
}  # fmt: skip
BANDWIDTHS = (60.0, 90.0, 150.0, 200.0, 250.0)


def vowel(formants: tuple[float, ...], pitch_hz: float, seconds: float = 0.4, rate: int = RATE) -> np.ndarray:
    """A voice on one vowel, at most 0.5: pulses that fall by 12 dB an octave, resonators, radiation."""
    count = int(seconds * rate)
    pulses = np.diff(np.floor(np.arange(count + 1) * pitch_hz / rate))
    pole = float(np.exp(-2 * np.pi * 78.0 / rate))
    sound = one_pole(one_pole(pulses, pole), pole)
    high = (formants[2] + 900, formants[2] + 1900)
    for hz, width in zip((*formants, *high), BANDWIDTHS, strict=True):
        sound = resonate(sound, hz, width, rate) if hz < rate / 2 else sound
    sound = np.diff(sound, prepend=0.0)
    return 0.5 * sound / np.abs(sound).max()


def one_pole(sound: np.ndarray, pole: float) -> np.ndarray:
    out, last = np.empty_like(sound), 0.0
    for i, value in enumerate(sound.tolist()):
        out[i] = last = value + pole * last
    return out


def resonate(sound: np.ndarray, hz: float, width_hz: float, rate: int) -> np.ndarray:
    c = -np.exp(-2 * np.pi * width_hz / rate)
    b = 2 * np.exp(-np.pi * width_hz / rate) * np.cos(2 * np.pi * hz / rate)
    out, one, two = np.empty_like(sound), 0.0, 0.0
    for i, value in enumerate(sound.tolist()):
        one, two = (1 - b - c) * value + b * one + c * two, one
        out[i] = one
    return out


def noise(low_hz: float, high_hz: float, seconds: float, loud: float, rate: int = RATE) -> np.ndarray:
    """Friction between two frequencies, of rms ``loud``."""
    spectrum = np.fft.rfft(np.random.default_rng(3).normal(size=int(seconds * rate)))
    pitch = np.fft.rfftfreq(int(seconds * rate), 1 / rate)
    sound = np.fft.irfft(spectrum * ((pitch >= low_hz) & (pitch <= high_hz)), int(seconds * rate))
    return loud * sound / np.sqrt((sound**2).mean())


def resampled(sound: np.ndarray, rate: int) -> np.ndarray:
    """A sound of RATE at another rate, band-limited."""
    count = len(sound) * rate // RATE
    spectrum = np.fft.rfft(sound)[: count // 2 + 1]
    return np.fft.irfft(np.pad(spectrum, (0, count // 2 + 1 - len(spectrum))), count) * count / len(sound)
