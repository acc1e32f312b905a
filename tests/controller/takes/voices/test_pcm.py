"""WAV in every format that is read, against the standard library's decoders, and those that are refused."""

from __future__ import annotations

import io
import struct
import warnings

import numpy as np
import pytest

from controller.base.errors import TakeError
from controller.takes.voices.pcm import SoundFormat, open_sound

TAIL = bytes.fromhex("000000001000800000aa00389b71")
SOUND = np.sin(np.arange(800) / 5.0) * 0.8


def wav(data: bytes, kind: int, bits: int, channels: int = 1, rate: int = 16000, *, extensible: bool = False,
        start: bytes = b"RIFF", before: bytes = b"", size: int | None = None) -> bytes:  # fmt: skip
    block = channels * bits // 8
    form = struct.pack("<HHIIHH", 0xFFFE if extensible else kind, channels, rate, rate * block, block, bits)
    if extensible:
        form += struct.pack("<HHIH", 22, bits, 0, kind) + TAIL
    chunks = before + b"fmt " + struct.pack("<I", len(form)) + form
    chunks += b"data" + struct.pack("<I", len(data) if size is None else size) + data
    return start + struct.pack("<I", 4 + len(chunks)) + b"WAVE" + chunks


def heard(data: bytes) -> np.ndarray:
    sound = open_sound(io.BytesIO(data), "a.wav")
    return sound.format.samples(sound.read(1 << 20))


def packed(width: int) -> bytes:
    """SOUND as little-endian integers of any width."""
    return b"".join(int(v * (2 ** (8 * width - 1) - 1)).to_bytes(width, "little", signed=True) for v in SOUND)


FORMS = {
    "u8": (((SOUND * 127) + 128).astype("u1").tobytes(), 1, 8, 0.02),
    "s16": (packed(2), 1, 16, 1e-4),
    "s24": (packed(3), 1, 24, 1e-6),
    "s32": (packed(4), 1, 32, 1e-8),
    "f32": (SOUND.astype("<f4").tobytes(), 3, 32, 1e-7),
    "f64": (SOUND.astype("<f8").tobytes(), 3, 64, 1e-15),
}


@pytest.mark.parametrize("extensible", [False, True])
@pytest.mark.parametrize("form", FORMS)
def test_every_width_is_the_same_sound(form: str, extensible: bool) -> None:
    data, kind, bits, within = FORMS[form]
    np.testing.assert_allclose(heard(wav(data, kind, bits, extensible=extensible)), SOUND, atol=within)


def test_channels_are_mixed_and_other_chunks_skipped() -> None:
    both = np.stack([SOUND, -0.5 * SOUND], axis=1).astype("<f4").tobytes()
    before = b"LIST" + struct.pack("<I", 3) + b"abc\0" + b"JUNK" + struct.pack("<I", 70000) + bytes(70000)
    after = b"LIST" + struct.pack("<I", 4) + b"tail"
    np.testing.assert_allclose(heard(wav(both, 3, 32, 2, before=before) + after), 0.25 * SOUND, atol=1e-7)


def test_laws_are_those_of_the_standard_library() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        audioop = pytest.importorskip("audioop", reason="Python 3.13 has no audioop")
    codes = bytes(range(256))
    for kind, decode in ((6, audioop.alaw2lin), (7, audioop.ulaw2lin)):
        expected = np.frombuffer(decode(codes, 2), "<i2") / 32768
        np.testing.assert_array_equal(heard(wav(codes, kind, 8)), expected)


@pytest.mark.parametrize("size", [0xFFFFFFFF, 0xFFFFFFFE])
def test_a_pipe_and_rf64_may_not_know_how_long_they_are(size: int) -> None:
    data = wav(packed(2), 1, 16, start=b"RF64" if size == 0xFFFFFFFF else b"RIFF", size=size)
    np.testing.assert_allclose(heard(data), SOUND, atol=1e-4)


def test_floating_point_that_is_no_sound_is_bounded() -> None:
    data = np.array([np.nan, np.inf, -np.inf, 3.0, -0.5], "<f4").tobytes()
    assert heard(wav(data, 3, 32)).tolist() == [0.0, 1.0, -1.0, 1.0, -0.5]


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"", "it ends too early"),
        (b"OggS" + bytes(40), "begins without RIFF"),
        (wav(b"", 1, 16, start=b"RIFX"), "begins without RIFF"),
        (wav(bytes(64), 2, 4), "WAV of Microsoft ADPCM"),
        (wav(bytes(64), 0x55, 8), "WAV of MP3"),
        (wav(bytes(64), 0x1234, 8), "WAV of format 4660"),
        (wav(bytes(64), 1, 64), "1 channels of 64 bit"),
        (wav(bytes(64), 3, 16), "16 bit at 16000 Hz"),
        (wav(bytes(66), 1, 16, 33), "33 channels"),
        (wav(bytes(64), 1, 16, 0), "0 channels"),
        (wav(bytes(64), 1, 16, rate=900), "900 Hz"),
        (wav(bytes(64), 1, 16, rate=400_000), "400000 Hz"),
        (wav(bytes(64), 1, 16, extensible=True).replace(TAIL, bytes(14)), "an unknown format"),
        (b"RIFF\0\0\0\0WAVEdata" + struct.pack("<I", 4) + bytes(4), "come before their format"),
        (b"RIFF\0\0\0\0WAVEfmt " + struct.pack("<I", 8) + bytes(8), "its format has 8 bytes"),
        (b"RIFF\0\0\0\0WAVEfmt " + struct.pack("<I", 1 << 30) + bytes(8), "its format says that it has"),
        (b"RIFF\0\0\0\0WAVEJUNK" + struct.pack("<I", 1 << 30) + bytes(8), "it ends too early"),
    ],
)  # fmt: skip
def test_what_is_not_read_says_why_and_names_ffmpeg(data: bytes, why: str) -> None:
    with pytest.raises(TakeError, match=why) as caught:
        open_sound(io.BytesIO(data), "a.wav")
    assert "a.wav" in str(caught.value) and "ffmpeg" in caught.value.hint


def test_no_more_is_read_than_a_file_holds_and_a_cut_frame_is_left_out() -> None:
    sound = open_sound(io.BytesIO(wav(packed(2), 1, 16) + b"more"), "a.wav")
    assert [len(sound.read(500)) for _ in range(3)] == [1000, 600, 0]
    assert SoundFormat(16000, 2, 2).samples(bytes(7)).tolist() == [0.0]
    assert len(open_sound(io.BytesIO(bytes(10)), "raw", 8000).read(100)) == 10


@pytest.mark.parametrize("size", [0, 0xFFFFFFFF])
@pytest.mark.parametrize(("whole", "goes_on"), [(0, True), (0xFFFFFFFF, True), (4000, False)])
def test_samples_go_on_after_an_empty_chunk_only_where_the_file_has_no_length(
    size: int, whole: int, goes_on: bool
) -> None:
    """A chunk that is as long as it can be goes on in any case."""
    data = bytearray(wav(packed(2), 1, 16, size=size))
    data[4:8] = struct.pack("<I", whole)
    assert (len(heard(bytes(data))) == len(SOUND)) == (goes_on or size > 0)


@pytest.mark.parametrize(
    ("rate", "channels", "read"),
    [(1000, 1, True), (999, 1, False), (384_000, 1, True), (384_001, 1, False), (16000, 32, True), (16000, 33, False)],
)
def test_rates_and_channels_have_bounds(rate: int, channels: int, read: bool) -> None:
    data = wav(bytes(64 * channels), 1, 16, channels, rate)
    if read:
        assert len(heard(data)) == 32
        return
    with pytest.raises(TakeError, match="8 to 32 bit of 1000 to 384000 Hz and up to 32 channels"):
        heard(data)


def form(size: int) -> bytes:
    """WAV whose format has so many bytes."""
    layout = struct.pack("<HHIIHH", 1, 1, 16000, 32000, 2, 16)[:size].ljust(size, b"\0")
    chunks = b"fmt " + struct.pack("<I", size) + layout + b"\0" * (size % 2) + b"data" + struct.pack("<I", 4) + bytes(4)
    return b"RIFF" + struct.pack("<I", 4 + len(chunks)) + b"WAVE" + chunks


@pytest.mark.parametrize(("size", "read"), [(14, False), (16, True), (17, True), (4096, True), (4098, False)])
def test_a_format_has_a_length_within_bounds_and_its_padding_is_skipped(size: int, read: bool) -> None:
    if read:
        assert len(heard(form(size))) == 2
        return
    with pytest.raises(TakeError, match="its format has"):
        heard(form(size))


@pytest.mark.parametrize("size", [65536, 65537])
def test_a_chunk_of_any_length_is_skipped(size: int) -> None:
    before = b"JUNK" + struct.pack("<I", size) + bytes(size + size % 2)
    np.testing.assert_allclose(heard(wav(packed(2), 1, 16, before=before)), SOUND, atol=1e-4)


def test_a_width_that_no_frame_has_is_that_of_its_bits() -> None:
    """A block that channels do not divide says nothing; 20 bits take 3 bytes."""
    data = bytearray(wav(packed(3), 1, 24, 2))
    data[32:36] = struct.pack("<HH", 5, 20)
    np.testing.assert_allclose(heard(bytes(data)), SOUND.reshape(-1, 2).mean(axis=1), atol=1e-6)


def test_each_channel_is_heard_alone_too() -> None:
    form = SoundFormat(8000, 2, 1)
    assert form.frame == 2
    assert form.frames(bytes([128, 0, 255, 64, 9])).tolist() == [[0.0, -1.0], [127 / 128, -0.5]]
