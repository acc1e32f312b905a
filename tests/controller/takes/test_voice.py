"""A mouth that follows a voice while it is heard."""

from __future__ import annotations

import io
import math
import os
import struct
import threading
import wave
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import TakeError
from controller.base.parameters import PARAMETERS as P
from controller.layers.commands import CommandState
from controller.takes.voice import (
    VoiceEnvelope,
    VoiceListener,
    _loudness,
    _loudness_of,
    samples,
    voice_take,
    wav_take,
)

RATE = 16000
JAW, STRETCH = P.index("jawOpen"), P.index("mouthStretchLeft")


def tone(hz: float, seconds: float, loud: float = 0.5) -> np.ndarray:
    return loud * np.sin(2 * np.pi * hz * np.arange(int(RATE * seconds)) / RATE)


def heard(ear: VoiceEnvelope, sound: np.ndarray) -> np.ndarray:
    hops = len(sound) // ear.hop
    return np.array([ear.process(hop) for hop in sound[: hops * ear.hop].reshape(hops, ear.hop)])


def wav(sound: np.ndarray, width: int = 2) -> bytes:
    out = io.BytesIO()
    with wave.open(out, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(width)
        file.setframerate(RATE)
        file.writeframes((sound * 32767).astype("<i2").tobytes())
    return out.getvalue()


def test_the_jaw_opens_with_the_voice_and_closes_with_silence() -> None:
    face = heard(VoiceEnvelope(P, RATE), np.concatenate([np.zeros(RATE // 2), tone(200, 0.5), np.zeros(RATE // 2)]))
    assert face[:49, JAW].max() == 0.0
    assert face[90:99, JAW].min() > 0.4
    assert face[-1, JAW] < 0.02
    assert np.all((face >= 0) & (face <= 1))


def test_hissing_moves_the_lips_and_hardly_the_jaw() -> None:
    face = heard(VoiceEnvelope(P, RATE), tone(6000, 0.5))
    assert face[-1, STRETCH] > 0.2
    assert face[-1, JAW] < 0.1


@pytest.mark.parametrize("loud", [0.02, 0.2, 0.9])
def test_a_quiet_voice_moves_the_mouth_as_far_as_a_loud_one(loud: float) -> None:
    assert heard(VoiceEnvelope(P, RATE), tone(200, 0.6, loud))[-1, JAW] == pytest.approx(0.5, abs=0.08)


def test_noise_of_a_silent_room_moves_nothing() -> None:
    room = np.random.default_rng(0).normal(0, 2e-4, RATE)
    assert heard(VoiceEnvelope(P, RATE), room).max() == 0.0


@pytest.mark.parametrize(("rms", "heard_of"), [(0.0029, False), (0.0033, True)])
def test_a_voice_counts_from_the_loudness_of_silence_on(rms: float, heard_of: bool) -> None:
    face = heard(VoiceEnvelope(P, RATE), tone(1000, 0.3, rms * math.sqrt(2)))
    assert (face[10:, JAW].max() > 0.1) == heard_of and (heard_of or not face[10:-1].any())


def test_a_stream_moves_the_speech_layer_until_it_ends() -> None:
    state, out = CommandState(P), P.neutral()
    listener = VoiceListener(io.BytesIO(wav(tone(200, 0.3))), state)
    listener.run()
    assert listener.hops == 30
    now = int(1e18)  # long after
    assert state.mixer["speech"].holding > 0
    state.tick(now, 0.01, out)
    for i in range(1, 100):
        state.tick(now + i * 10_000_000, 0.01, out)
    assert state.mixer["speech"].holding == 0
    assert out[JAW] == pytest.approx(0.0, abs=1e-3)


def test_a_pipe_of_unknown_length_is_heard_as_it_comes() -> None:
    reading, writing = os.pipe()
    whole = bytearray(wav(tone(200, 0.2)))
    struct.pack_into("<I", whole, 4, 0xFFFFFFFF)  # as ffmpeg writes to a pipe
    struct.pack_into("<I", whole, 40, 0xFFFFFFFF)

    def send() -> None:
        with os.fdopen(writing, "wb") as pipe:
            pipe.write(whole[:1000])
            pipe.flush()
            pipe.write(whole[1000:])

    sender = threading.Thread(target=send)
    sender.start()
    with os.fdopen(reading, "rb") as stream:
        listener = VoiceListener(stream, CommandState(P))
        listener.run()
    sender.join()
    assert listener.hops == 20


def test_samples_of_every_width_are_mono_between_one_and_one() -> None:
    assert samples(bytes([0, 255, 128, 128]), 1, 2) == pytest.approx([-1 / 256, 0.0], abs=1e-2)
    assert samples(np.array([-32768, 32767], "<i2").tobytes() + b"x", 2, 1) == pytest.approx([-1.0, 1.0], abs=1e-4)
    assert samples(np.array([2**30], "<i4").tobytes(), 4, 1) == pytest.approx([0.5])


@pytest.mark.parametrize("data", [b"", b"RIFF", b"no sound at all, but long enough to be read as a header"])
def test_what_is_no_wav_is_refused(data: bytes) -> None:
    with pytest.raises(TakeError, match="not WAV") as caught:
        VoiceListener(io.BytesIO(data), CommandState(P))
    assert "ffmpeg" in caught.value.hint


def test_three_byte_samples_are_refused() -> None:
    with pytest.raises(TakeError, match="24 bit"):
        VoiceListener(io.BytesIO(wav(tone(200, 0.3), 3)), CommandState(P))


def test_sound_without_a_header_is_signed_16_bit_mono() -> None:
    raw = (tone(200, 0.2) * 32767).astype("<i2").tobytes()
    state = CommandState(P)
    listener = VoiceListener(io.BytesIO(raw), state, raw_hz=RATE)
    listener.run()
    assert listener.hops == 20  # 160 samples of 2 bytes each
    layer = state.mixer["speech"]
    assert layer.values[JAW] > 0.3 and layer.holding == np.count_nonzero(VoiceEnvelope(P, RATE).mask)


def test_a_listener_that_was_stopped_hears_nothing() -> None:
    state = CommandState(P)
    listener = VoiceListener(io.BytesIO(wav(tone(200, 5.0))), state)
    listener.stop()
    listener.run()
    assert listener.hops == 0 and state.mixer["speech"].holding == 0


@pytest.mark.parametrize("rate", [999, 0])
def test_rates_that_are_no_sound_are_refused(rate: int) -> None:
    with pytest.raises(ValueError, match="rate_hz must be 1000 or more"):
        VoiceEnvelope(P, rate)
    assert VoiceEnvelope(P, 1000).hop == 10


def test_a_voice_far_below_the_loudest_closes_the_mouth_and_no_further() -> None:
    sound = np.concatenate([tone(200, 0.5, 0.8), tone(200, 0.8, 0.03)])  # above silence, below a share of the loudest
    face = heard(VoiceEnvelope(P, RATE), sound)
    assert face[45, JAW] > 0.4
    assert 0.0 <= face[-1, JAW] < 0.01 and face.min() >= 0.0


def followed(loudness: np.ndarray, loud: np.ndarray) -> np.ndarray:
    """(n, 2) levels of voice and hiss, a row every 10 ms: up in 30 ms, down in 90 ms, nothing below 6 %."""
    level, rows = [0.0, 0.0], []
    for row in loudness:
        for k in range(2):
            goal = min(max(row[k] / (loud[k] or 1.0) - 0.06, 0.0), 1.0)
            level[k] += (goal - level[k]) * (1 - math.exp(-0.01 / (0.03 if goal > level[k] else 0.09)))
        rows.append(list(level))
    return np.array(rows)


def bands(piece: np.ndarray, rate: int) -> list[float]:
    """Strength of 60 to 2500 Hz and of all above 4000 Hz, by a sum over each frequency alone."""
    n = len(piece)
    shaped = piece * (0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n) / (n - 1)))
    found = [0.0, 0.0]
    for k in range(n // 2 + 1):
        power = abs(np.sum(shaped * np.exp(-2j * np.pi * k * np.arange(n) / n))) ** 2
        hz = np.fft.rfftfreq(n, 1 / rate)[k]  # rounds to one side of a band's edge
        found[0] += power if 60 < hz < 2500 else 0.0
        found[1] += power if hz > 4000 else 0.0
    return [math.sqrt(value) for value in found]


def mouth(voice: float, hiss: float) -> dict[str, float]:
    shared = hiss * (1 - 0.7 * voice)
    return {
        "jawOpen": 0.55 * voice + 0.06 * shared,
        "mouthLowerDownLeft": 0.2 * voice + 0.25 * shared,
        "mouthUpperUpRight": 0.1 * voice,
        "mouthStretchRight": 0.3 * shared,
    }


EDGES = tone(2500, 0.05, 0.3) + tone(4000, 0.05, 0.3)  # just outside of both bands
SPOKEN = np.concatenate(
    [
        np.linspace(0.2, 1.0, 1600) * tone(200, 0.1),  # no two pieces are as loud
        np.zeros(800),
        np.linspace(0.5, 1.0, 960) * tone(6000, 0.06, 0.2),
        np.linspace(1.0, 0.4, 800) * (tone(300, 0.05) + tone(5000, 0.05)),
        EDGES,
    ]
)


def test_a_file_becomes_the_take_that_its_sound_gives(tmp_path: Path) -> None:
    path = tmp_path / "a.wav"
    path.write_bytes(wav(SPOKEN))
    take = wav_take(path, P)
    sound = np.concatenate([(SPOKEN * 32767).astype("<i2") / 32768, np.zeros(480)])
    count = len(SPOKEN) // 160
    loudness = np.array([bands(sound[160 * i : 160 * i + 480], RATE) for i in range(count)])
    levels = followed(loudness, np.percentile(loudness, 95, axis=0))
    assert take.frames == count and take.rate_hz == pytest.approx(100.0)
    np.testing.assert_allclose(take.times_s, np.arange(count) / 100)
    for i, (voice, hiss) in enumerate(levels):
        for name, value in mouth(voice, hiss).items():
            assert take.values[i, P.index(name)] == pytest.approx(value, abs=1e-9), (i, name)
    assert levels.max() > 0.6 and not take.values[:, P.index("mouthSmileLeft")].any()
    assert take.mask[JAW] and take.mask[STRETCH] and not take.mask[P.index("mouthSmileLeft")]


def test_a_stream_gives_what_its_sound_gives() -> None:
    ear = VoiceEnvelope(P, RATE)
    face = heard(ear, SPOKEN)
    window = np.zeros(480)
    hann = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(480) / 479)
    least = 0.003 * math.sqrt((hann**2).sum() * 480 / 2)
    loudest, rows, shares = [least, least], [], []
    for i in range(len(face)):
        window = np.concatenate([window[160:], SPOKEN[160 * i : 160 * i + 160]])
        row = bands(window, RATE)
        loudest = [max(most * math.exp(-0.01 / 4.0), now, least) for most, now in zip(loudest, row, strict=True)]
        shares.append([now / most if now > least else 0.0 for now, most in zip(row, loudest, strict=True)])
    rows = followed(np.array(shares), np.ones(2))
    for i, (voice, hiss) in enumerate(rows):
        for name, value in mouth(voice, hiss).items():
            assert face[i, P.index(name)] == pytest.approx(value, abs=1e-9), (i, name)


def test_files_without_sound_are_refused_and_short_ones_have_a_row(tmp_path: Path) -> None:
    path = tmp_path / "a.wav"
    path.write_bytes(wav(np.zeros(0)))
    with pytest.raises(TakeError, match=r"a\.wav: no sound in it") as caught:
        wav_take(path, P)
    assert "ffmpeg" in caught.value.hint
    path.write_bytes(wav(tone(200, 0.005)))
    assert wav_take(path, P).frames == 1
    path.write_bytes(wav(np.zeros(1600)))
    assert not wav_take(path, P).values.any()
    with pytest.raises(TakeError, match=r"none\.wav: cannot be read: No such file") as caught:
        wav_take(tmp_path / "none.wav", P)
    assert caught.value.hint == f"look at: ls -l {tmp_path / 'none.wav'}"


def test_every_width_fills_its_range_exactly() -> None:
    assert samples(bytes([0, 128, 192]), 1, 1).tolist() == [-1.0, 0.0, 0.5]
    assert samples(np.array([-(2**15), 2**14, 2**14, -(2**14)], "<i2").tobytes(), 2, 2).tolist() == [-0.25, 0.0]
    assert samples(np.array([-(2**31), 2**29], "<i4").tobytes() + b"abc", 4, 1).tolist() == [-1.0, 0.25]


@pytest.mark.parametrize("cut", [1, 3, 101, 102])
def test_a_file_cut_at_any_byte_is_read_as_far_as_it_goes(tmp_path: Path, cut: int) -> None:
    data = wav(tone(200, 0.5))
    (tmp_path / "v.wav").write_bytes(data[:-cut])
    assert wav_take(tmp_path / "v.wav", P).frames in (49, 50)


def test_a_file_that_says_it_is_longer_than_it_is_costs_no_more_than_it_is(tmp_path: Path) -> None:
    data = bytearray(wav(tone(200, 0.003)))
    data[40:44] = struct.pack("<I", 2_000_000_000)
    (tmp_path / "v.wav").write_bytes(data)
    asked = []

    class Sound(io.BytesIO):
        def read(self, size: int | None = -1) -> bytes:
            asked.append(size or 0)
            return super().read(size)

    assert voice_take(Sound(bytes(data)), "v", P).frames == 1
    assert max(asked) <= 2 * RATE and wav_take(tmp_path / "v.wav", P).frames == 1


@pytest.mark.parametrize(("at", "layout", "value"), [(24, "<I", 4_000_000_000), (22, "<H", 40_000), (24, "<I", 10)])
def test_rates_and_channels_no_microphone_has_are_refused(tmp_path: Path, at: int, layout: str, value: int) -> None:
    data = bytearray(wav(tone(200, 0.1)))
    struct.pack_into(layout, data, at, value)
    (tmp_path / "v.wav").write_bytes(data)
    with pytest.raises(TakeError, match=r"384000 Hz|not WAV"):
        wav_take(tmp_path / "v.wav", P)


@pytest.mark.parametrize("rate", [11025, 16000, 44100])
def test_a_long_sound_is_heard_as_in_one_piece(rate: int) -> None:
    sound = np.sin(np.arange(int(2.7 * rate)) * 0.11) * np.linspace(0, 1, int(2.7 * rate))
    size = int(0.03 * rate)
    starts = np.arange(len(sound) * 100 // rate) * rate // 100
    whole = _loudness(np.concatenate([sound, np.zeros(size)])[starts[:, None] + np.arange(size)], rate)
    pieces = (sound[at : at + rate] for at in range(0, len(sound), rate))
    np.testing.assert_allclose(_loudness_of(pieces, rate), whole, atol=1e-12)
