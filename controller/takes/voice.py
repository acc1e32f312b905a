"""Moves a mouth by the sound of a voice: of a WAV file as a take, of a stream while it plays.

The jaw follows the loudness of the voice, the lips that of hissing. A file is compared with its own loud parts, a
stream with the loudest of the last few seconds.
"""

from __future__ import annotations

import math
import struct
import threading
import time
import wave
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import IO

import numpy as np

from controller.base.errors import TakeError
from controller.base.parameters import Flags, Floats, Parameters
from controller.layers.commands import CommandState
from controller.takes.livelink import Take
from controller.vocabulary.sides import spread
from controller.vocabulary.visemes import Visemes
from surface.base import files

_RATE_HZ = 100
HOP_S = 1.0 / _RATE_HZ
_WINDOW_S = 0.03
_GATE = 0.06
_RISE_S, _FALL_S = 0.03, 0.09
_MEMORY_S = 4.0
_LONGEST_S = 3600.0
_HIGHEST_HZ, _MOST_CHANNELS = 384_000, 32
_QUIET = 0.003  # rms of what counts as silence whatever came before
_LOUD_PERCENTILE = 95.0
_FORMATS = {1: "u1", 2: "<i2", 4: "<i4"}
_HINT = "ffmpeg -i voice.mp3 -f wav -acodec pcm_s16le -"


def wav_take(path: Path, parameters: Parameters) -> Take:
    """A take of a WAV file, a row every 10 ms. Raises TakeError: not a WAV file of PCM, or an empty one."""
    with files.reading(path, TakeError), files.open_file(path) as stream:
        return voice_take(stream, str(path), parameters)


def voice_take(
    stream: IO[bytes], name: str, parameters: Parameters, *, raw_hz: int | None = None, longest_s: float | None = None
) -> Take:
    """A take of a voice, a row every 10 ms, of the first ``longest_s`` (at most an hour).

    ``raw_hz``: samples per second of signed 16 bit mono PCM without a header; None for WAV. ``name`` : for errors.
    Raises TakeError: not WAV of PCM, or empty. OSError: the stream cannot be read.
    """
    seconds = min(longest_s or _LONGEST_S, _LONGEST_S)
    if raw_hz is None:
        file = _open(stream, name)
        rate, width, channels = file.getframerate(), file.getsampwidth(), file.getnchannels()
        pieces = _pieces(file.readframes, rate, seconds)
    else:
        rate, width, channels = raw_hz, 2, 1
        pieces = _pieces(lambda count: stream.read(2 * count), rate, seconds)
    loudness = _loudness_of((samples(piece, width, channels) for piece in pieces), rate)
    if not len(loudness):
        raise TakeError(f"{name}: no sound in it", hint=_HINT)
    loud = np.percentile(loudness, _LOUD_PERCENTILE, axis=0)
    goals = np.clip(loudness / np.where(loud > 0.0, loud, 1.0) - _GATE, 0.0, 1.0)
    levels, level = np.empty_like(goals), np.zeros(2)
    for i, goal in enumerate(goals):
        levels[i] = level = _follow(level, goal)
    shapes, through = _mouth_shapes(parameters), Visemes.load(parameters).through
    times: Floats = np.arange(len(levels)) / _RATE_HZ
    mask = shapes.sum(axis=0) > 0
    return Take(Path(name).name, times, _mouth(levels, shapes), mask, parameters.low, parameters.high, through)


def _pieces(read: Callable[[int], bytes], rate: int, seconds: float) -> Iterator[bytes]:
    """The first ``seconds`` of a sound, a second at a time: a file may say that it is longer than it is."""
    left = math.ceil(seconds * rate)
    while left > 0 and (piece := read(min(rate, left))):
        yield piece
        left -= rate


def _loudness_of(seconds: Iterator[Floats], rate: int) -> Floats:
    """(k, 2) loudness of the voice and of hissing every 10 ms of a sound that comes a second, (rate,), at a time."""
    size = int(_WINDOW_S * rate)
    window = np.arange(size)
    out, here = [np.zeros((0, 2))], next(seconds, np.zeros(0))
    while len(here):
        after = next(seconds, np.zeros(0))
        hops = _RATE_HZ if len(after) else max(len(here) * _RATE_HZ // rate, not out[1:])
        starts = np.arange(hops) * rate // _RATE_HZ
        sound = np.concatenate([here, after[:size], np.zeros(size)])
        out.append(_loudness(sound[starts[:, None] + window], rate))
        here = after
    return np.concatenate(out)


class VoiceEnvelope:
    """Turns sound of ``rate_hz`` samples per second into a mouth, a hop of 10 ms at a time.

    mask : (P,) bool, the parameters it moves.
    """

    def __init__(self, parameters: Parameters, rate_hz: int) -> None:
        if rate_hz < 1000:
            raise ValueError(f"rate_hz must be 1000 or more, not {rate_hz}")
        self.hop = round(rate_hz * HOP_S)
        self._shapes = _mouth_shapes(parameters)
        self.mask = self._shapes.sum(axis=0) > 0
        self._rate_hz, self._window = rate_hz, np.zeros(round(rate_hz * _WINDOW_S))
        # a sine of rms r gives a band of this times r
        self._least = _QUIET * math.sqrt(float((np.hanning(len(self._window)) ** 2).sum()) * len(self._window) / 2)
        self._loudest, self._level = np.full(2, self._least), np.zeros(2)

    def process(self, sound: Floats) -> Floats:
        """(P,) the mouth after one hop of samples -1..1, (hop,) float64; shorter at the end of a stream."""
        self._window = np.concatenate([self._window, sound])[-len(self._window) :]
        loudness = _loudness(self._window, self._rate_hz)
        keep = math.exp(-HOP_S / _MEMORY_S)
        self._loudest = np.maximum(np.maximum(self._loudest * keep, loudness), self._least)
        goal = np.where(loudness > self._least, np.clip(loudness / self._loudest - _GATE, 0.0, 1.0), 0.0)
        self._level = _follow(self._level, goal)
        return _mouth(self._level, self._shapes)


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

    Raises TakeError: the stream does not begin as WAV of 8, 16 or 32 bit PCM.
    """

    def __init__(self, stream: IO[bytes], state: CommandState, *, raw_hz: int | None = None) -> None:
        self._read: Callable[[int], bytes]
        if raw_hz is None:
            file = _open(stream, "the stream")
            self._read, rate_hz = file.readframes, file.getframerate()
            self._width, self._channels = file.getsampwidth(), file.getnchannels()
        else:
            self._read, rate_hz = lambda count: stream.read(2 * count), raw_hz
            self._width, self._channels = 2, 1
        self._state, self._envelope = state, VoiceEnvelope(state.parameters, rate_hz)
        self._through = Visemes.load(state.parameters).through
        self._stopping = threading.Event()
        self.hops = 0

    def stop(self) -> None:
        """Stop listening; a blocked read ends when the stream does."""
        self._stopping.set()

    def run(self) -> None:
        """Listen until the stream ends."""
        began = time.monotonic()
        while not self._stopping.is_set() and (data := self._read(self._envelope.hop)):
            self.hops += 1
            ahead = self.hops * HOP_S - (time.monotonic() - began)
            if ahead > 0:
                self._stopping.wait(ahead)
            now = time.monotonic_ns()
            values = self._envelope.process(samples(data, self._width, self._channels))
            self._state.write_layer("speech", values, self._envelope.mask, now, now, through=self._through)


def samples(data: bytes, width: int, channels: int) -> Floats:
    """(k,) mono samples -1..1 of PCM frames of ``width`` bytes a sample; a frame that is cut short is left out."""
    whole = len(data) // (width * channels) * width * channels
    raw = np.frombuffer(data[:whole], dtype=np.dtype(_FORMATS[width])).astype(np.float64)
    if width == 1:
        raw -= 128.0
    mixed: Floats = raw.reshape(-1, channels).mean(axis=1) / 2.0 ** (8 * width - 1)
    return mixed


def _open(stream: IO[bytes], name: str) -> wave.Wave_read:
    try:
        file = wave.Wave_read(stream)
    except (OSError, wave.Error, EOFError, struct.error, RuntimeError) as error:
        raise TakeError(f"{name}: not WAV of PCM: {str(error) or 'it ends too early'}", hint=_HINT) from error
    width, channels, rate = file.getsampwidth(), file.getnchannels(), file.getframerate()
    if width not in _FORMATS or channels > _MOST_CHANNELS or not 1000 <= rate <= _HIGHEST_HZ:
        found = f"{channels} channels of {8 * width} bit at {rate} Hz"
        read = f"8, 16 or 32 bit PCM of 1000 to {_HIGHEST_HZ} Hz and up to {_MOST_CHANNELS} channels is read"
        raise TakeError(f"{name}: {found}; {read}", hint=_HINT)
    return file


@cache
def _window(size: int, rate_hz: int) -> tuple[Floats, tuple[Flags, Flags]]:
    """A Hann window, and which frequencies of its spectrum are of the voice and of hissing."""
    pitch = np.fft.rfftfreq(size, 1 / rate_hz)
    return np.hanning(size), ((pitch > 60) & (pitch < 2500), pitch > 4000)


def _loudness(frames: Floats, rate_hz: int) -> Floats:
    """(..., 2) loudness of the voice and of hissing in frames (..., n) of samples."""
    shape, bands = _window(frames.shape[-1], rate_hz)
    power = np.abs(np.fft.rfft(frames * shape)) ** 2
    return np.stack([np.sqrt(power[..., band].sum(axis=-1)) for band in bands], axis=-1)


def _follow(level: Floats, goal: Floats) -> Floats:
    """(2,) levels a hop later: they rise fast and fall slowly, as a jaw does."""
    tau = np.where(goal > level, _RISE_S, _FALL_S)
    return level + (goal - level) * (1.0 - np.exp(-HOP_S / tau))


def _mouth_shapes(parameters: Parameters) -> Floats:
    """(2, P) the mouth at full voice, and at full hiss."""
    jaw = spread(parameters, {"jawOpen": 0.55, "mouthLowerDown": 0.2, "mouthUpperUp": 0.1})
    return np.stack([jaw, spread(parameters, {"mouthStretch": 0.3, "mouthLowerDown": 0.25, "jawOpen": 0.06})])


def _mouth(levels: Floats, shapes: Floats) -> Floats:
    """(..., P) the mouth at levels (..., 2) of voice and hiss."""
    voice, hiss = levels[..., :1], levels[..., 1:]
    mouth: Floats = np.minimum(voice * shapes[0] + hiss * (1.0 - 0.7 * voice) * shapes[1], 1.0)
    return mouth
