"""Moves the mouth by the sound of a voice: a WAV file becomes a take, and a stream is followed while it plays.

The lips form the viseme that the sound resembles most (:mod:`controller.takes.voices.lips`), and the jaw opens the
further, the louder the voice is. Loudness is relative to the loud parts of a file, or to the loudest of the last few
seconds of a stream.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import numpy as np

from controller.base.errors import TakeError
from controller.base.parameters import Floats, Parameters
from controller.layers.commands import CommandState
from controller.takes.livelink import Take
from controller.takes.voices.lips import (
    AHEAD,
    BANDS,
    BEFORE,
    HOP_S,
    WINDOW_S,
    band_levels,
    features,
    lip_model,
    loudness_db,
)
from controller.takes.voices.pcm import HINT, MIN_HZ, Sound, open_sound
from controller.vocabulary.visemes import Visemes
from surface.base import files

__all__ = ["HOP_S", "VoiceEnvelope", "VoiceListener", "voice_take", "wav_take"]

_RATE_HZ = round(1 / HOP_S)
_LIP_TIME_CONSTANT_S = 0.01
_SHARPNESS = 2.0  # power of the viseme probabilities, because a mixture of many visemes looks like no sound
_CLOSURE_WEIGHT = 2.0  # lips that do not meet for a closure are more noticeable than lips that meet too often
_LOUDEST_DECAY_S = 4.0  # time constant with which the loudest level of a stream is forgotten
_MAX_SOUND_S = 3600.0
_QUIET_DB = -53.0  # absolute level up to which sound counts as silence
_HUSHED_DB = 28.0  # sound more than this below the loudest, for the whole context of a frame, counts as silence
_SOFT_DB, _SOFT_JAW = 26.0, 0.6  # a voice this much below the loudest opens the jaw by this fraction
_LOUD_PERCENTILE = 95.0
_BLOCK = 4096  # frames
_SILENCE_DB = -140.0


def wav_take(path: Path, parameters: Parameters) -> Take:
    """Read a take of a WAV file, with a row every 10 ms. Raises TakeError: omote cannot decode it, or it is empty."""
    with files.reading(path, TakeError), files.open_file(path) as stream:
        return voice_take(stream, str(path), parameters)


def voice_take(
    stream: IO[bytes], name: str, parameters: Parameters, *, raw_hz: int | None = None, longest_s: float | None = None
) -> Take:
    """Return a take of a voice, with a row every 10 ms.

    stream : open for reading bytes. name : for errors. raw_hz : samples per second of signed 16 bit mono PCM without a
    header; None for WAV. longest_s : how much of the sound to read, at most and by default an hour.

    Raises TakeError: omote cannot decode the sound, or it is empty. OSError: the stream cannot be read.
    """
    sound = open_sound(stream, name, raw_hz)
    rate = sound.format.rate_hz
    levels = levels_of(_seconds(sound, min(longest_s or _MAX_SOUND_S, _MAX_SOUND_S)), rate)
    if not len(levels):
        raise TakeError(f"{name}: no sound in it", hint=HINT)
    mouth = _Mouth(parameters)
    loudness = loudness_db(levels)
    loud = max(float(np.percentile(loudness, _LOUD_PERCENTILE)), _QUIET_DB)
    weights = np.concatenate([mouth.rest[None], *_classify(levels, loud, mouth)])  # a frame's middle is a hop later
    current = mouth.rest
    for i, goal in enumerate(weights):
        weights[i] = current = _follow(current, goal)
    values = mouth.pose(weights[:-1], loudness - loud)
    times: Floats = np.arange(len(values)) / _RATE_HZ
    return Take(
        Path(name).name, times, values, mouth.visemes.mask, parameters.low, parameters.high, mouth.visemes.through
    )


def _seconds(sound: Sound, seconds: float) -> Iterator[Floats]:
    """Yield the samples of the first ``seconds`` of a sound, one second at a time."""
    left = math.ceil(seconds * sound.format.rate_hz)
    while left > 0 and (piece := sound.read(min(sound.format.rate_hz, left))):
        yield sound.format.samples(piece)
        left -= sound.format.rate_hz


def levels_of(seconds: Iterator[Floats], rate: int) -> Floats:
    """Return the (k, BANDS) levels (dB), every 10 ms, of a sound that is given one second, (rate,), at a time."""
    size = int(WINDOW_S * rate)
    window = np.arange(size)
    out, current = [np.zeros((0, BANDS))], next(seconds, np.zeros(0))
    while len(current):
        following = next(seconds, np.zeros(0))
        hops = _RATE_HZ if len(following) else max(len(current) * _RATE_HZ // rate, not out[1:])
        starts = np.arange(hops) * rate // _RATE_HZ
        sound = np.concatenate([current, following[:size], np.zeros(size)])
        out.append(band_levels(sound[starts[:, None] + window], rate))
        current = following
    return np.concatenate(out)


def _classify(levels: Floats, loud: float, mouth: _Mouth) -> Iterator[Floats]:
    """Yield the weights of the visemes (k, n) for levels (k, BANDS), in blocks of frames."""
    silence = np.full((BEFORE, BANDS), _SILENCE_DB)
    padded = np.concatenate([silence, levels, silence[:AHEAD]])
    for begin in range(0, len(levels), _BLOCK):
        part = padded[begin : begin + _BLOCK + BEFORE + AHEAD]
        near = np.lib.stride_tricks.sliding_window_view(loudness_db(part), BEFORE + AHEAD + 1).max(axis=1)
        yield mouth.weights(part, loud, near)


class _Mouth:
    """Computes weights of visemes from sound, and parameters from weights.

    visemes : the vocabulary. rest : (n,) weights of silence.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.visemes = Visemes.load(parameters)
        self._model = lip_model()
        known = self.visemes.names
        columns = [known.index(name) if name in known else 0 for name in self._model.visemes]
        self._columns = self.visemes.matrix[:, columns].T
        self._firmness = self.visemes.hold[columns] * np.where(
            np.array(self._model.visemes) == "PP", _CLOSURE_WEIGHT, 1.0
        )
        self.rest = np.eye(len(self._columns))[0]
        self._jaw = parameters.index("jawOpen")

    def weights(self, levels: Floats, loud: Floats | float, near: Floats) -> Floats:
        """Return the weights (k, n) of the visemes in k frames.

        levels : (k + BEFORE + AHEAD, BANDS) dB. loud : the loudest level of the voice (dB). near : (k,) the loudest
        level around each frame (dB); if that is too low, the frame is silence.
        """
        found = self._model.classify(features(levels, loud)) ** _SHARPNESS * self._firmness
        found /= np.maximum(found.sum(axis=1, keepdims=True), 1e-9)
        is_voice = (near > _QUIET_DB) & (near > loud - _HUSHED_DB)
        return np.where(is_voice[:, None], found, self.rest)

    def pose(self, weights: Floats, level_db: Floats) -> Floats:
        """Return the parameters (k, P) for weights (k, n); ``level_db`` : (k,) loudness relative to the loudest."""
        values: Floats = weights @ self._columns
        loud = np.clip(1.0 + level_db / _SOFT_DB, 0.0, 1.0)
        values[:, self._jaw] *= _SOFT_JAW + (1.0 - _SOFT_JAW) * loud
        return np.clip(values, 0.0, 1.0, out=values)


class VoiceEnvelope:
    """Turns sound of ``rate_hz`` samples per second into the parameters of a mouth, one hop of 10 ms at a time.

    The mouth lags the sound by about 60 ms, of which 40 ms are the context after a frame.

    mask : (P,) bool, the parameters that it moves. hop : number of samples in 10 ms.
    """

    def __init__(self, parameters: Parameters, rate_hz: int) -> None:
        if rate_hz < MIN_HZ:
            raise ValueError(f"rate_hz must be {MIN_HZ} or more, not {rate_hz}")
        self.hop = round(rate_hz * HOP_S)
        self._mouth = _Mouth(parameters)
        self.mask = self._mouth.visemes.mask
        self._rate_hz, self._window = rate_hz, np.zeros(int(rate_hz * WINDOW_S))
        self._levels = np.full((BEFORE + 1 + AHEAD, BANDS), _SILENCE_DB)
        self._loudness = np.full(len(self._levels), _SILENCE_DB)
        self._loudest, self._weights = _QUIET_DB, self._mouth.rest

    def process(self, sound: Floats) -> Floats:
        """Return the parameters (P,) after one hop of samples -1..1, (hop,) float64; the last hop may be shorter."""
        self._window = np.concatenate([self._window, sound])[-len(self._window) :]
        self._levels[:-1], self._loudness[:-1] = self._levels[1:], self._loudness[1:]
        self._levels[-1] = band_levels(self._window, self._rate_hz)
        self._loudness[-1] = loudness_db(self._levels[-1])
        faded = self._loudest - 20.0 * math.log10(math.e) * HOP_S / _LOUDEST_DECAY_S
        self._loudest = max(faded, float(self._loudness[-1]), _QUIET_DB)
        near = self._loudness.max(keepdims=True)
        self._weights = _follow(self._weights, self._mouth.weights(self._levels, self._loudest, near)[0])
        level_db = self._loudness[BEFORE : BEFORE + 1] - self._loudest
        pose: Floats = self._mouth.pose(self._weights[None], level_db)[0]
        return pose


class VoiceListener:
    """Writes the speech layer from a WAV stream; the layer's time-out releases it when the stream ends.

    A stream that comes faster than real time, such as a file, is read in real time.

    Parameters
    ----------
    stream : open for reading bytes. It need not know its length or be seekable.
    raw_hz : samples per second of a stream of signed 16 bit mono PCM without a header; None for WAV.

    Attributes
    ----------
    hops : number of pieces of 10 ms that were processed.

    Raises TakeError: the stream does not begin as WAV that omote decodes.
    """

    def __init__(self, stream: IO[bytes], state: CommandState, *, raw_hz: int | None = None) -> None:
        self._sound = open_sound(stream, "the stream", raw_hz)
        self._state, self._envelope = state, VoiceEnvelope(state.parameters, self._sound.format.rate_hz)
        self._through = Visemes.load(state.parameters).through
        self._stopping = threading.Event()
        self.hops = 0

    def stop(self) -> None:
        """Stop listening; a read that is blocked returns only when the stream sends data or ends."""
        self._stopping.set()

    def run(self) -> None:
        """Listen until the stream ends."""
        began = time.monotonic()
        while not self._stopping.is_set() and (data := self._sound.read(self._envelope.hop)):
            self.hops += 1
            ahead = self.hops * HOP_S - (time.monotonic() - began)
            if ahead > 0:
                self._stopping.wait(ahead)
            now = time.monotonic_ns()
            values = self._envelope.process(self._sound.format.samples(data))
            self._state.write_layer("speech", values, self._envelope.mask, now, now, through=self._through)


def _follow(weights: Floats, goal: Floats) -> Floats:
    """Return the weights (n,) one hop later: lips need a little time from shape to shape."""
    return weights + (goal - weights) * (1.0 - math.exp(-HOP_S / _LIP_TIME_CONSTANT_S))
