"""Reads WAV (PCM, floating point, A-law and mu-law) from a file or a pipe, and samples without a header.

Sources: Microsoft, "Multiple Channel Audio Data and WAVE Files" (2007) for EXTENSIBLE; RFC 2361 for the format numbers;
EBU Tech 3306 for RF64; ITU-T G.711 for A-law and mu-law.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import IO

import numpy as np

from controller.base.errors import TakeError
from controller.base.parameters import Floats

MIN_HZ, MAX_HZ, MAX_CHANNELS = 1000, 384_000, 32
HINT = "ffmpeg -i voice.mp3 -f wav -acodec pcm_s16le -"

_PCM, _FLOAT, _A_LAW, _MU_LAW, _EXTENSIBLE = 1, 3, 6, 7, 0xFFFE
_WIDTHS = {_PCM: (1, 2, 3, 4), _FLOAT: (4, 8), _A_LAW: (1,), _MU_LAW: (1,)}
_NAMES = {0x02: "Microsoft ADPCM", 0x11: "IMA ADPCM", 0x31: "GSM 6.10", 0x50: "MPEG", 0x55: "MP3", 0xFF: "AAC"}
_GUID_TAIL = bytes.fromhex("000000001000800000aa00389b71")
"""The last 14 bytes of the GUID of an EXTENSIBLE header whose first two bytes are a format number."""
_MAX_READ_BYTES = 1 << 16
_MAX_FORMAT_BYTES = 4096


@dataclass(frozen=True)
class SoundFormat:
    """How samples are stored.

    rate_hz : frames per second. channels : samples per frame. width : bytes per sample. kind : format number in a WAV
    header: 1 PCM, 3 floating point, 6 A-law, 7 mu-law.
    """

    rate_hz: int
    channels: int = 1
    width: int = 2
    kind: int = _PCM

    @property
    def frame(self) -> int:
        """Bytes per frame."""
        return self.width * self.channels

    def samples(self, data: bytes) -> Floats:
        """Return (k,) float64 samples -1..1, the mean of all channels; an incomplete last frame is left out.

        Floating-point samples are clipped to -1..1; NaN counts as 0.
        """
        mixed: Floats = self.frames(data).mean(axis=1, dtype=np.float64)
        return mixed

    def frames(self, data: bytes) -> Floats:
        """Return (k, channels) float64 samples -1..1, otherwise like :meth:`samples`."""
        whole = len(data) // self.frame * self.frame
        return self._decode(data[:whole]).reshape(-1, self.channels)

    def _decode(self, data: bytes) -> Floats:
        if self.kind == _FLOAT:
            raw = np.nan_to_num(np.frombuffer(data, f"<f{self.width}").astype(np.float64), posinf=1.0, neginf=-1.0)
            return np.clip(raw, -1.0, 1.0)
        if self.kind in (_A_LAW, _MU_LAW):
            table = _a_law() if self.kind == _A_LAW else _mu_law()
            return table[np.frombuffer(data, np.uint8)]
        if self.width == 1:
            return (np.frombuffer(data, np.uint8).astype(np.float64) - 128.0) / 128.0
        if self.width == 3:
            wide = np.zeros((len(data) // 3, 4), np.uint8)
            wide[:, 1:] = np.frombuffer(data, np.uint8).reshape(-1, 3)
            return wide.view("<i4")[:, 0] / 2.0**31
        return np.frombuffer(data, f"<i{self.width}").astype(np.float64) / 2.0 ** (8 * self.width - 1)


@dataclass
class Sound:
    """An open sound: its format, and ``read(frames)``, which returns the bytes of up to that many frames."""

    format: SoundFormat
    read: Callable[[int], bytes]


def open_sound(stream: IO[bytes], name: str, raw_hz: int | None = None) -> Sound:
    """Read the header of a sound and return the open sound.

    stream : need not be seekable, and its header need not state the length. name : for errors. raw_hz : frames per
    second of signed 16 bit mono PCM without a header; None for WAV.

    Raises TakeError: it is not WAV, or a format that omote does not decode.
    """
    if raw_hz is not None:
        return Sound(SoundFormat(raw_hz), lambda frames: stream.read(2 * frames))
    try:
        form, size = _header(stream)
    except ValueError as error:
        raise TakeError(f"{name}: not WAV of PCM: {error}", hint=HINT) from error
    if why := _refusal(form):
        raise TakeError(f"{name}: {why}", hint=HINT)
    return Sound(form, _limited_reader(stream, form.frame, size))


def _limited_reader(stream: IO[bytes], frame: int, left: int | None) -> Callable[[int], bytes]:
    """Return a function that reads frames, at most ``left`` bytes in all: other chunks may follow the samples."""

    def read(frames: int) -> bytes:
        nonlocal left
        size = frames * frame if left is None else min(frames * frame, left)
        data = stream.read(size)
        left = None if left is None else left - len(data)
        return data

    return read


def _header(stream: IO[bytes]) -> tuple[SoundFormat, int | None]:
    """Read the format, and how many bytes of samples follow; None for all the rest. Raises ValueError."""
    start = _read_exactly(stream, 12)
    if start[:4] not in (b"RIFF", b"RF64") or start[8:] != b"WAVE":
        raise ValueError("it begins without RIFF and WAVE")
    form = None
    while True:
        kind, size = struct.unpack("<4sI", _read_exactly(stream, 8))
        if kind == b"data":
            if form is None:
                raise ValueError("its samples come before their format")
            return form, None if size in (0, 0xFFFFFFFF) and _is_length_unknown(size, start) else size
        if kind == b"fmt ":
            form = _parse_format(_read_exactly(stream, size + size % 2))
        else:
            _skip(stream, size + size % 2)


def _is_length_unknown(size: int, start: bytes) -> bool:
    """Whether a sample chunk of length 0 or 2^32 - 1 goes to the end: it was written to a pipe, or is RF64."""
    return size > 0 or start[4:8] in (b"\0\0\0\0", b"\xff\xff\xff\xff")


def _parse_format(chunk: bytes) -> SoundFormat:
    if not 16 <= len(chunk) <= _MAX_FORMAT_BYTES:
        raise ValueError(f"its format has {len(chunk)} bytes")
    kind, channels, rate_hz, _, block, bits = struct.unpack_from("<HHIIHH", chunk)
    if kind == _EXTENSIBLE:
        if len(chunk) < 40 or chunk[26:40] != _GUID_TAIL:
            raise ValueError("its EXTENSIBLE header names an unknown format")
        kind = struct.unpack_from("<H", chunk, 24)[0]
    width = block // channels if channels and block % channels == 0 else (bits + 7) // 8
    return SoundFormat(rate_hz, channels, width, kind)


def _refusal(form: SoundFormat) -> str:
    """Return why sound of this format cannot be read; empty if it can."""
    if form.kind not in _WIDTHS:
        name = _NAMES.get(form.kind, f"format {form.kind}")
        return f"WAV of {name}; PCM, floating point, A-law and mu-law are read"
    if form.width not in _WIDTHS[form.kind] or not 1 <= form.channels <= MAX_CHANNELS:
        pass
    elif MIN_HZ <= form.rate_hz <= MAX_HZ:
        return ""
    found = f"{form.channels} channels of {8 * form.width} bit at {form.rate_hz} Hz"
    read = f"8 to 32 bit of {MIN_HZ} to {MAX_HZ} Hz and up to {MAX_CHANNELS} channels is read"
    return f"{found}; {read}"


def _read_exactly(stream: IO[bytes], size: int) -> bytes:
    """Read ``size`` bytes. Raises ValueError: the stream ends before, or ``size`` is implausibly large."""
    if size > _MAX_READ_BYTES:
        raise ValueError(f"its format says that it has {size} bytes")
    data = stream.read(size)
    if len(data) < size:
        raise ValueError("it ends too early")
    return data


def _skip(stream: IO[bytes], size: int) -> None:
    while size > 0:
        step = len(stream.read(min(size, _MAX_READ_BYTES)))
        if not step:
            raise ValueError("it ends too early")
        size -= step


@cache
def _a_law() -> Floats:
    """Return the (256,) samples of the A-law codes.

    G.711, table 1a: every other bit is inverted; 3 bits of exponent and 4 of mantissa.
    """
    code = np.arange(256) ^ 0x55
    exponent, mantissa = code >> 4 & 7, code & 15
    size = np.where(exponent == 0, 2 * mantissa + 1, (2 * mantissa + 33) << np.maximum(exponent - 1, 0))
    table: Floats = np.where(code & 0x80, size, -size) / 4096.0
    return table


@cache
def _mu_law() -> Floats:
    """Return the (256,) samples of the mu-law codes.

    G.711, table 2a: all bits are inverted; the bias is 33 in units of 1/8192.
    """
    code = np.arange(256) ^ 0xFF
    exponent, mantissa = code >> 4 & 7, code & 15
    size = ((2 * mantissa + 33) << exponent) - 33
    table: Floats = np.where(code & 0x80, -size, size) / 8192.0
    return table
