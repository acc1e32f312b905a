"""Speech as takes: timed visemes, phonemes, Rhubarb's output, or just the sound of a WAV file.

Timed sounds are blended by dominance (after Cohen and Massaro 1993): each sound reaches into its neighbours, the less
the firmer they hold their own shape, so that lips meet for a short "p" between two open vowels.
"""

from __future__ import annotations

import json
import math
import wave
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from controller.base.errors import ParameterError, TakeError
from controller.base.parameters import Floats, Parameters
from controller.motion.motion import minimum_jerk
from controller.takes.livelink import Take
from controller.vocabulary.sides import spread
from controller.vocabulary.visemes import Visemes

RATE_HZ = 100.0
"""Rows per second of the takes made here."""

_BEFORE_S = 0.12
_AFTER_S = 0.08
_FIRM = 0.85
_NEIGHBOURS = 3
_LOUD_PERCENTILE = 95.0
_GATE = 0.06


@dataclass(frozen=True, eq=False)
class Cue:
    """One sound: when it begins (s), and its visemes (n,)."""

    start_s: float
    weights: Floats


def speech_take(name: str, cues: Sequence[Cue], end_s: float, parameters: Parameters, visemes: Visemes) -> Take:
    """A take of timed sounds.

    Parameters
    ----------
    cues : rising in time; the last lasts until ``end_s``.

    Raises
    ------
    TakeError : no cue, or times that do not rise.
    """
    starts = np.array([cue.start_s for cue in cues])
    if len(cues) == 0 or np.any(np.diff(starts) < 0) or end_s < starts[-1]:
        raise TakeError(f"{name}: needs at least one sound, with times that rise", hint="sort the sounds by time")
    ends = np.append(starts[1:], end_s)
    weights = np.stack([cue.weights for cue in cues])
    hold = weights @ visemes.hold
    times = np.arange(0.0, end_s + _AFTER_S + 1 / RATE_HZ, 1 / RATE_HZ)
    values = np.stack([visemes.matrix @ _mix(t, starts, ends, weights, hold) for t in times])
    return Take(name, times, np.minimum(values, 1.0), visemes.mask, parameters.low, parameters.high, visemes.through)


def _mix(t: float, starts: Floats, ends: Floats, weights: Floats, hold: Floats) -> Floats:
    """(n,) weights of the visemes at a time: the sounds near it, each by its dominance there."""
    here = min(max(int(np.searchsorted(starts, t, side="right")) - 1, 0), len(starts) - 1)
    near = range(max(here - _NEIGHBOURS, 0), min(here + _NEIGHBOURS + 1, len(starts)))
    room = 1.0 - _FIRM * hold[here]
    dominance = np.array([_dominance(t, starts[k], ends[k], room) * (0.2 + 0.8 * hold[k]) for k in near])
    total = dominance.sum()
    if total <= 0.0:
        return np.zeros(weights.shape[1])
    mixed: Floats = dominance @ weights[near.start : near.stop] / total
    mixed *= min(1.0, _dominance(t, starts[0], ends[-1], 1.0))
    return mixed


def _dominance(t: float, start: float, end: float, room: float) -> float:
    """1 during a sound, falling to 0 before and after it over a time that ``room`` scales."""
    if t < start:
        return 1.0 - minimum_jerk((start - t) / (_BEFORE_S * room))
    if t >= end:
        return 1.0 - minimum_jerk((t - end) / (_AFTER_S * room))
    return 1.0


def cue_take(path: Path, parameters: Parameters, visemes: Visemes | None = None) -> Take:
    """A take from Rhubarb's TSV or JSON, or from a TSV of phonemes or visemes (time, tab, name). Raises TakeError."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise TakeError(f"{path}: cannot be read: {error}", hint=f"look at: ls -l {path}") from error
    visemes = visemes or Visemes.load(parameters)
    rows, end_s = _json_rows(path, text) if path.suffix.lower() == ".json" else _tsv_rows(path, text)
    shapes = all(name in visemes.rhubarb for _, _, name in rows)
    cues = [Cue(start_s, _weights(path, line, name, visemes, shapes)) for line, start_s, name in rows]
    return speech_take(path.name, cues, end_s or _last_end(cues), parameters, visemes)


def _weights(path: Path, line: str, name: str, visemes: Visemes, shapes: bool) -> Floats:
    """Rhubarb's letters mean its shapes only where every name in the file is one: B and F are phonemes, too."""
    if shapes:
        return visemes.rhubarb[name]
    try:
        return visemes.weights(name)
    except ParameterError as error:
        raise TakeError(f"{path}, {line}: {error}", hint=error.hint) from error


def _tsv_rows(path: Path, text: str) -> tuple[list[tuple[str, float, str]], float]:
    rows = []
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        cells = line.split()
        start = _seconds(cells[0])
        if len(cells) != 2 or start is None:
            raise TakeError(f"{path}, line {number}: {line!r} is not a time in seconds, a tab and a name",
                            hint="write it like: 0.27<tab>C")  # fmt: skip
        rows.append((f"line {number}", start, cells[1]))
    return rows, 0.0


def _json_rows(path: Path, text: str) -> tuple[list[tuple[str, float, str]], float]:
    try:
        cues = json.loads(text)["mouthCues"]
        rows = [(f"mouthCues[{i}]", float(cue["start"]), str(cue["value"])) for i, cue in enumerate(cues)]
        return rows, float(cues[-1]["end"]) if cues else 0.0
    except (json.JSONDecodeError, KeyError, TypeError, ValueError) as error:
        raise TakeError(
            f"{path}: not the output of rhubarb -f json: {error}", hint="rhubarb -f json voice.wav"
        ) from error


def _last_end(cues: Sequence[Cue]) -> float:
    return cues[-1].start_s + 0.1 if cues else 0.0


def _seconds(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) and value >= 0.0 else None


def wav_take(path: Path, parameters: Parameters, visemes: Visemes | None = None) -> Take:
    """A mouth that follows a voice: the jaw its loudness, the lips how bright it is. Good enough for a servo mouth.

    Raises
    ------
    TakeError : not a PCM WAV file.
    """
    visemes = visemes or Visemes.load(parameters)
    sound, rate = _read_wav(path)
    low, high = _bands(sound, rate)
    loud = np.percentile(low, _LOUD_PERCENTILE) or 1.0
    bright = np.percentile(high, _LOUD_PERCENTILE) or 1.0
    voice = _follow(np.clip(low / loud - _GATE, 0.0, 1.0))
    hiss = _follow(np.clip(high / bright - _GATE, 0.0, 1.0)) * (1.0 - 0.7 * voice)
    jaw, lips = voice_shapes(parameters)
    values = np.minimum(voice[:, None] * jaw + hiss[:, None] * lips, 1.0)
    times = np.arange(len(values)) / RATE_HZ
    return Take(path.name, times, values, (jaw + lips) > 0, parameters.low, parameters.high, visemes.through)


def voice_shapes(parameters: Parameters) -> tuple[Floats, Floats]:
    """(P,) each: the mouth at full voice, and at full hiss."""
    jaw = spread(parameters, {"jawOpen": 0.55, "mouthLowerDown": 0.2, "mouthUpperUp": 0.1})
    return jaw, spread(parameters, {"mouthStretch": 0.3, "mouthLowerDown": 0.25, "jawOpen": 0.06})


def _read_wav(path: Path) -> tuple[Floats, int]:
    """Mono samples -1..1 and their rate."""
    try:
        with wave.open(str(path), "rb") as file:
            width, channels, rate = file.getsampwidth(), file.getnchannels(), file.getframerate()
            data = file.readframes(file.getnframes())
    except (OSError, wave.Error, EOFError) as error:
        raise TakeError(f"{path}: not a WAV file of PCM: {error}", hint="ffmpeg -i voice.mp3 voice.wav") from error
    kinds = {1: "u1", 2: "<i2", 4: "<i4"}
    if width not in kinds or not data or rate < 1:
        raise TakeError(f"{path}: {8 * width} bit or empty; 8, 16 or 32 bit PCM is read",
                        hint="ffmpeg -i in.wav -acodec pcm_s16le out.wav")  # fmt: skip
    samples = np.frombuffer(data, dtype=np.dtype(kinds[width])).astype(np.float64)
    if width == 1:
        samples -= 128.0
    return samples[: len(samples) // channels * channels].reshape(-1, channels).mean(axis=1) / 2.0 ** (
        8 * width - 1
    ), rate


def _bands(sound: Floats, rate: int) -> tuple[Floats, Floats]:
    """Loudness of the voice (below 2.5 kHz) and of hissing (above 4 kHz), :data:`RATE_HZ` times a second."""
    size = max(int(0.03 * rate), 8)
    count = max(int(len(sound) / rate * RATE_HZ), 1)
    starts = (np.arange(count) * rate / RATE_HZ).astype(int)
    padded = np.concatenate([sound, np.zeros(size)])
    frames = padded[starts[:, None] + np.arange(size)] * np.hanning(size)
    power = np.abs(np.fft.rfft(frames, axis=1)) ** 2
    pitch = np.fft.rfftfreq(size, 1 / rate)
    low, high = (pitch > 60) & (pitch < 2500), pitch > 4000
    return np.sqrt(power[:, low].sum(axis=1)), np.sqrt(power[:, high].sum(axis=1))


def _follow(level: Floats, rise_s: float = 0.03, fall_s: float = 0.09) -> Floats:
    """Rises fast and falls slowly, as a jaw does."""
    out, state = np.empty_like(level), 0.0
    rise, fall = 1 - math.exp(-1 / (RATE_HZ * rise_s)), 1 - math.exp(-1 / (RATE_HZ * fall_s))
    for i, value in enumerate(level):
        state += (value - state) * (rise if value > state else fall)
        out[i] = state
    return out
