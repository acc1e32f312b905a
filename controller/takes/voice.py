"""Moves a mouth by the sound of a voice: of a WAV file as a take, of a stream while it plays.

The lips form the viseme that the sound is most like (:mod:`controller.takes.voices.lips`), the jaw opens the further
the louder the voice is. A file is compared with its own loud parts, a stream with the loudest of the last few seconds.
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
from controller.takes.voices.pcm import HINT, LOWEST_HZ, Sound, open_sound
from controller.vocabulary.visemes import Visemes
from surface.base import files

__all__ = ["HOP_S", "VoiceEnvelope", "VoiceListener", "voice_take", "wav_take"]

_RATE_HZ = round(1 / HOP_S)
_TAU_S = 0.01
_SHARPNESS = 2.0  # power of the shares: mouths between all visemes look like none
_CLOSING = 2.0  # lips that do not meet are noticed more than lips that meet too often
_MEMORY_S = 4.0
_LONGEST_S = 3600.0
_QUIET_DB = -53.0  # what is never louder counts as silence whatever came before
_HUSHED_DB = 28.0  # below the loudest: silence, where a tenth of a second holds nothing louder
_SOFT_DB, _SOFT_JAW = 26.0, 0.6  # a voice softer by so much opens the jaw by this share
_LOUD_PERCENTILE = 95.0
_BLOCK = 4096
_NOTHING_DB = -140.0


def wav_take(path: Path, parameters: Parameters) -> Take:
    """A take of a WAV file, a row every 10 ms. Raises TakeError: not a WAV file that omote decodes, or an empty one."""
    with files.reading(path, TakeError), files.open_file(path) as stream:
        return voice_take(stream, str(path), parameters)


def voice_take(
    stream: IO[bytes], name: str, parameters: Parameters, *, raw_hz: int | None = None, longest_s: float | None = None
) -> Take:
    """A take of a voice, a row every 10 ms, of the first ``longest_s`` (at most an hour).

    ``raw_hz``: samples per second of signed 16 bit mono PCM without a header; None for WAV. ``name`` : for errors.
    Raises TakeError: not WAV that omote decodes, or empty. OSError: the stream cannot be read.
    """
    sound = open_sound(stream, name, raw_hz)
    rate = sound.format.rate_hz
    levels = levels_of(_seconds(sound, min(longest_s or _LONGEST_S, _LONGEST_S)), rate)
    if not len(levels):
        raise TakeError(f"{name}: no sound in it", hint=HINT)
    mouth = _Mouth(parameters)
    loudness = loudness_db(levels)
    loud = max(float(np.percentile(loudness, _LOUD_PERCENTILE)), _QUIET_DB)
    shares = np.concatenate([mouth.rest[None], *_judged(levels, loud, mouth)])  # a frame's middle is a hop later
    share = mouth.rest
    for i, goal in enumerate(shares):
        shares[i] = share = _follow(share, goal)
    values = mouth.pose(shares[:-1], loudness - loud)
    times: Floats = np.arange(len(values)) / _RATE_HZ
    return Take(
        Path(name).name, times, values, mouth.visemes.mask, parameters.low, parameters.high, mouth.visemes.through
    )


def _seconds(sound: Sound, seconds: float) -> Iterator[Floats]:
    """The first ``seconds`` of a sound, a second at a time: a file may say that it is longer than it is."""
    left = math.ceil(seconds * sound.format.rate_hz)
    while left > 0 and (piece := sound.read(min(sound.format.rate_hz, left))):
        yield sound.format.samples(piece)
        left -= sound.format.rate_hz


def levels_of(seconds: Iterator[Floats], rate: int) -> Floats:
    """(k, BANDS) levels (dB) every 10 ms of a sound that comes a second, (rate,), at a time."""
    size = int(WINDOW_S * rate)
    window = np.arange(size)
    out, here = [np.zeros((0, BANDS))], next(seconds, np.zeros(0))
    while len(here):
        after = next(seconds, np.zeros(0))
        hops = _RATE_HZ if len(after) else max(len(here) * _RATE_HZ // rate, not out[1:])
        starts = np.arange(hops) * rate // _RATE_HZ
        sound = np.concatenate([here, after[:size], np.zeros(size)])
        out.append(band_levels(sound[starts[:, None] + window], rate))
        here = after
    return np.concatenate(out)


def _judged(levels: Floats, loud: float, mouth: _Mouth) -> Iterator[Floats]:
    """Shares of the visemes (k, n) of levels (k, BANDS), some thousand frames at a time."""
    silence = np.full((BEFORE, BANDS), _NOTHING_DB)
    padded = np.concatenate([silence, levels, silence[:AHEAD]])
    for at in range(0, len(levels), _BLOCK):
        part = padded[at : at + _BLOCK + BEFORE + AHEAD]
        near = np.lib.stride_tricks.sliding_window_view(loudness_db(part), BEFORE + AHEAD + 1).max(axis=1)
        yield mouth.shares(part, loud, near)


class _Mouth:
    """Shares of visemes, and the parameters that they move.

    visemes : of the vocabulary. rest : (n,) share of silence alone.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.visemes = Visemes.load(parameters)
        self._model = lip_model()
        known = self.visemes.names
        at = [known.index(name) if name in known else 0 for name in self._model.visemes]
        self._columns = self.visemes.matrix[:, at].T
        self._firmness = self.visemes.hold[at] * np.where(np.array(self._model.visemes) == "PP", _CLOSING, 1.0)
        self.rest = np.eye(len(self._columns))[0]
        self._jaw = parameters.index("jawOpen")

    def shares(self, levels: Floats, loud: Floats | float, near: Floats) -> Floats:
        """(k, n) shares in levels (k + BEFORE + AHEAD, BANDS); silence where ``near``, the loudest around, is low."""
        judged = self._model.judge(features(levels, loud)) ** _SHARPNESS * self._firmness
        judged /= np.maximum(judged.sum(axis=1, keepdims=True), 1e-9)
        heard = (near > _QUIET_DB) & (near > loud - _HUSHED_DB)
        return np.where(heard[:, None], judged, self.rest)

    def pose(self, shares: Floats, level_db: Floats) -> Floats:
        """(k, P) parameters of shares (k, n), whose frames are by ``level_db`` louder than the loudest."""
        values: Floats = shares @ self._columns
        loud = np.clip(1.0 + level_db / _SOFT_DB, 0.0, 1.0)
        values[:, self._jaw] *= _SOFT_JAW + (1.0 - _SOFT_JAW) * loud
        return np.clip(values, 0.0, 1.0, out=values)


class VoiceEnvelope:
    """Turns sound of ``rate_hz`` samples per second into a mouth, a hop of 10 ms at a time.

    The mouth is about 60 ms behind the sound: 40 ms of it to hear what follows a closure.

    mask : (P,) bool, the parameters it moves.
    """

    def __init__(self, parameters: Parameters, rate_hz: int) -> None:
        if rate_hz < LOWEST_HZ:
            raise ValueError(f"rate_hz must be {LOWEST_HZ} or more, not {rate_hz}")
        self.hop = round(rate_hz * HOP_S)
        self._mouth = _Mouth(parameters)
        self.mask = self._mouth.visemes.mask
        self._rate_hz, self._window = rate_hz, np.zeros(int(rate_hz * WINDOW_S))
        self._levels = np.full((BEFORE + 1 + AHEAD, BANDS), _NOTHING_DB)
        self._loudness = np.full(len(self._levels), _NOTHING_DB)
        self._loudest, self._share = _QUIET_DB, self._mouth.rest

    def process(self, sound: Floats) -> Floats:
        """(P,) the mouth after one hop of samples -1..1, (hop,) float64; shorter at the end of a stream."""
        self._window = np.concatenate([self._window, sound])[-len(self._window) :]
        self._levels[:-1], self._loudness[:-1] = self._levels[1:], self._loudness[1:]
        self._levels[-1] = band_levels(self._window, self._rate_hz)
        self._loudness[-1] = loudness_db(self._levels[-1])
        faded = self._loudest - 20.0 * math.log10(math.e) * HOP_S / _MEMORY_S
        self._loudest = max(faded, float(self._loudness[-1]), _QUIET_DB)
        near = self._loudness.max(keepdims=True)
        self._share = _follow(self._share, self._mouth.shares(self._levels, self._loudest, near)[0])
        level_db = self._loudness[BEFORE : BEFORE + 1] - self._loudest
        pose: Floats = self._mouth.pose(self._share[None], level_db)[0]
        return pose


class VoiceListener:
    """Writes the speech layer from a WAV stream; the layer's time-out releases it when the stream ends.

    A stream that comes faster than sound, such as a file, is taken at the pace of its rate.

    Parameters
    ----------
    stream : open for reading bytes. It need not know its length or be seekable.
    raw_hz : samples per second of a stream of signed 16 bit mono PCM without a header; None for WAV.

    Attributes
    ----------
    hops : how many pieces of 10 ms were processed.

    Raises TakeError: the stream does not begin as WAV that omote decodes.
    """

    def __init__(self, stream: IO[bytes], state: CommandState, *, raw_hz: int | None = None) -> None:
        self._sound = open_sound(stream, "the stream", raw_hz)
        self._state, self._envelope = state, VoiceEnvelope(state.parameters, self._sound.format.rate_hz)
        self._through = Visemes.load(state.parameters).through
        self._stopping = threading.Event()
        self.hops = 0

    def stop(self) -> None:
        """Stop listening; a blocked read ends when the stream does."""
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


def _follow(share: Floats, goal: Floats) -> Floats:
    """Shares (n,) a hop later: lips need a little time from shape to shape."""
    return share + (goal - share) * (1.0 - math.exp(-HOP_S / _TAU_S))
