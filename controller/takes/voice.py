"""A mouth that follows a voice while it is heard: WAV from a pipe, a socket or any file-like object.

The same jaw and lips as :func:`controller.takes.speech.wav_take`, but loudness is compared with the loudest of the
last few seconds, for the end is not known yet.
"""

from __future__ import annotations

import math
import threading
import time
import wave
from typing import IO

import numpy as np

from controller.base.errors import TakeError
from controller.base.parameters import Floats, Parameters
from controller.layers.commands import CommandState
from controller.takes.speech import voice_shapes
from controller.vocabulary.visemes import Visemes

HOP_S = 0.01
_WINDOW_S = 0.03
_GATE = 0.06
_RISE_S, _FALL_S = 0.03, 0.09
_MEMORY_S = 4.0
_QUIET = 0.003  # rms of what counts as silence whatever came before
_KINDS = {1: "u1", 2: "<i2", 4: "<i4"}


class VoiceEnvelope:
    """Turns sound into a mouth, a hop of 10 ms at a time.

    Parameters
    ----------
    parameters : the registry. rate_hz : samples per second.

    Attributes
    ----------
    mask : (P,) bool, the parameters it moves.
    """

    def __init__(self, parameters: Parameters, rate_hz: int) -> None:
        if rate_hz < 1000:
            raise ValueError(f"rate_hz must be 1000 or more, not {rate_hz}")
        self.hop = round(rate_hz * HOP_S)
        self._jaw, self._lips = voice_shapes(parameters)
        self.mask = (self._jaw + self._lips) > 0
        self._heard = np.zeros(round(rate_hz * _WINDOW_S))
        self._shape = np.hanning(len(self._heard))
        pitch = np.fft.rfftfreq(len(self._heard), 1 / rate_hz)
        self._bands = (pitch > 60) & (pitch < 2500), pitch > 4000
        # a sine of rms r gives a band of this times r
        self._least = _QUIET * math.sqrt(float((self._shape**2).sum()) * len(self._heard) / 2)
        self._loudest, self._level = np.full(2, self._least), np.zeros(2)

    def process(self, sound: Floats) -> Floats:
        """(P,) the mouth after one hop of samples -1..1, (hop,) float64; shorter at the end of a stream."""
        self._heard = np.concatenate([self._heard, sound])[-len(self._shape) :]
        power = np.abs(np.fft.rfft(self._heard * self._shape)) ** 2
        loud = np.array([np.sqrt(power[band].sum()) for band in self._bands])
        keep = math.exp(-HOP_S / _MEMORY_S)
        self._loudest = np.maximum(np.maximum(self._loudest * keep, loud), self._least)
        goal = np.where(loud > self._least, np.clip(loud / self._loudest - _GATE, 0.0, 1.0), 0.0)
        tau = np.where(goal > self._level, _RISE_S, _FALL_S)
        self._level += (goal - self._level) * (1.0 - np.exp(-HOP_S / tau))
        voice, hiss = self._level
        return np.minimum(voice * self._jaw + hiss * (1.0 - 0.7 * voice) * self._lips, 1.0)


class VoiceListener:
    """Hears a WAV stream in a thread of its own and writes the speech layer; the layer lets go when it ends.

    A stream that comes faster than sound, such as a file, is taken at the pace of its rate.

    Parameters
    ----------
    stream : open for reading bytes. It need not know its length or be seekable.
    raw_hz : samples per second of a stream of signed 16 bit mono PCM without a header; None for WAV.

    Attributes
    ----------
    hops : how many pieces of 10 ms were heard.

    Raises
    ------
    TakeError : the stream does not begin as WAV of 8, 16 or 32 bit PCM.
    """

    def __init__(self, stream: IO[bytes], state: CommandState, *, raw_hz: int | None = None) -> None:
        self._file = _open(stream) if raw_hz is None else RawPcm(stream, raw_hz)
        self._channels, self._width = self._file.getnchannels(), self._file.getsampwidth()
        self._rate = self._file.getframerate()
        self._state, self._envelope = state, VoiceEnvelope(state.parameters, self._rate)
        self._through = Visemes.load(state.parameters).through
        self._stopping = threading.Event()
        self.hops = 0
        self._thread = threading.Thread(target=self.run, name="voice", daemon=True)

    def start(self) -> VoiceListener:
        """Begin to listen."""
        self._thread.start()
        return self

    def stop(self) -> None:
        """Stop listening; a stream that is silent is left to end by itself."""
        self._stopping.set()

    def join(self, timeout_s: float | None = None) -> bool:
        """Wait until the stream has ended; False if it has not after ``timeout_s``."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def run(self) -> None:
        """Listen until the stream ends."""
        began = time.monotonic()
        while not self._stopping.is_set():
            data = self._file.readframes(self._envelope.hop)
            if not data:
                return
            self.hops += 1
            ahead = self.hops * HOP_S - (time.monotonic() - began)
            if ahead > 0:
                self._stopping.wait(ahead)
            now = time.monotonic_ns()
            values = self._envelope.process(samples(data, self._width, self._channels))
            self._state.write_layer("speech", values, self._envelope.mask, now, now, through=self._through)


class RawPcm:
    """PCM without a header, read as :class:`wave.Wave_read` reads WAV: signed 16 bit, little end first, mono."""

    def __init__(self, stream: IO[bytes], rate_hz: int) -> None:
        self._stream, self._rate_hz = stream, rate_hz

    def getnchannels(self) -> int:
        """One."""
        return 1

    def getsampwidth(self) -> int:
        """Two bytes."""
        return 2

    def getframerate(self) -> int:
        """Samples per second."""
        return self._rate_hz

    def readframes(self, count: int) -> bytes:
        """Up to ``count`` samples; none at the end."""
        return self._stream.read(2 * count)


def samples(data: bytes, width: int, channels: int) -> Floats:
    """(k,) mono samples -1..1 of PCM frames; a frame that is cut short is left out."""
    whole = len(data) // (width * channels) * width * channels
    raw = np.frombuffer(data[:whole], dtype=np.dtype(_KINDS[width])).astype(np.float64)
    if width == 1:
        raw -= 128.0
    mixed: Floats = raw.reshape(-1, channels).mean(axis=1) / 2.0 ** (8 * width - 1)
    return mixed


def _open(stream: IO[bytes]) -> wave.Wave_read:
    hint = "ffmpeg -i voice.mp3 -f wav -acodec pcm_s16le -"
    try:
        file = wave.Wave_read(stream)
    except (OSError, wave.Error, EOFError) as error:
        raise TakeError(f"the stream is not WAV of PCM: {str(error) or 'it ends too early'}", hint=hint) from error
    if file.getsampwidth() not in _KINDS or file.getframerate() < 1000:
        found = f"{8 * file.getsampwidth()} bit at {file.getframerate()} Hz"
        raise TakeError(f"the stream has {found}; 8, 16 or 32 bit PCM is heard", hint=hint)
    return file
