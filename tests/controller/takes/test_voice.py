"""A mouth that follows a voice while it is heard."""

from __future__ import annotations

import io
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
    _Mouth,
    levels_of,
    voice_take,
    wav_take,
)
from controller.takes.voices.lips import AHEAD, BANDS, BEFORE, band_levels, features
from tests.controller.takes.voices.synthesis import MEN, noise, vowel

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
    silence = np.zeros(RATE // 2)
    face = heard(VoiceEnvelope(P, RATE), np.concatenate([silence, vowel(MEN["ɑ"], 120.0, 0.5), silence]))
    assert face[:49, JAW].max() == 0.0
    assert face[62:99, JAW].min() > 0.4
    assert face[-1, JAW] < 0.02
    assert np.all((face >= 0) & (face <= 1))


def test_of_two_visemes_the_likelier_one_shows_by_the_square_of_how_much_likelier_it_is() -> None:
    """Else a mouth between all visemes would look like none."""
    mouth, k = _Mouth(P), 40
    levels = np.random.default_rng(5).uniform(-60.0, -20.0, (k + BEFORE + AHEAD, BANDS))
    judged, shown = mouth._model.classify(features(levels, -10.0)), mouth.weights(levels, -10.0, np.full(k, -10.0))
    likelier, stronger = judged[:, 1] / judged[:, 2], shown[:, 1] / shown[:, 2]
    assert np.ptp(likelier) > 0.5
    np.testing.assert_allclose(stronger / stronger[0], (likelier / likelier[0]) ** 2)
    np.testing.assert_allclose(shown.sum(axis=1), 1.0)


def test_hissing_moves_the_lips_and_hardly_the_jaw() -> None:
    face = heard(VoiceEnvelope(P, RATE), np.concatenate([AH, noise(4500, 7800, 0.2, 0.06)]))
    assert face[-1, STRETCH] > 0.2
    assert face[-1, JAW] < 0.1


@pytest.mark.parametrize("loud", [0.02, 0.2, 0.9])
def test_a_quiet_voice_moves_the_mouth_as_far_as_a_loud_one(loud: float) -> None:
    voice = 2 * loud * vowel(MEN["ɑ"], 120.0, 0.6)
    assert heard(VoiceEnvelope(P, RATE), voice)[20:, JAW].mean() == pytest.approx(0.5, abs=0.08)


def test_noise_of_a_silent_room_moves_nothing() -> None:
    room = np.random.default_rng(0).normal(0, 2e-4, RATE)
    assert heard(VoiceEnvelope(P, RATE), room).max() == 0.0


@pytest.mark.parametrize(("rms", "heard_of"), [(0.001, False), (0.01, True)])
def test_a_voice_counts_from_the_loudness_of_silence_on(rms: float, heard_of: bool) -> None:
    voice = vowel(MEN["ɑ"], 120.0, 0.4)
    face = heard(VoiceEnvelope(P, RATE), rms / np.sqrt((voice**2).mean()) * voice)
    assert bool(face[20:, JAW].max() > 0.3) == heard_of and (heard_of or not face.any())


def test_a_stream_moves_the_speech_layer_until_it_ends() -> None:
    state, out = CommandState(P), P.neutral()
    listener = VoiceListener(io.BytesIO(wav(vowel(MEN["ɑ"], 120.0, 0.3))), state)
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


@pytest.mark.parametrize("data", [b"", b"RIFF", b"no sound at all, but long enough to be read as a header"])
def test_what_is_no_wav_is_refused(data: bytes) -> None:
    with pytest.raises(TakeError, match="not WAV") as caught:
        VoiceListener(io.BytesIO(data), CommandState(P))
    assert "ffmpeg" in caught.value.hint


def test_sound_without_a_header_is_signed_16_bit_mono() -> None:
    raw = (vowel(MEN["ɑ"], 120.0, 0.2) * 32767).astype("<i2").tobytes()
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
    voice = vowel(MEN["ɑ"], 120.0, 0.6)
    face = heard(VoiceEnvelope(P, RATE), np.concatenate([voice, 0.02 * voice]))  # above silence, far below the loudest
    assert face[45, JAW] > 0.4
    assert 0.0 <= face[-1, JAW] < 0.01 and face.min() >= 0.0


def test_what_was_loud_fades_by_a_factor_of_e_in_four_seconds() -> None:
    """A soft voice then moves the mouth as one does that is louder by as much and begins later by as little."""
    loud, soft = vowel(MEN["ɑ"], 120.0, 0.3), 0.05 * vowel(MEN["ɑ"], 120.0, 4.8)
    late = heard(VoiceEnvelope(P, RATE), np.concatenate([loud, soft]))[:, JAW]
    soon = heard(VoiceEnvelope(P, RATE), np.concatenate([loud, np.e * soft[:RATE]]))[:, JAW]
    assert late[60] < 0.01 and soon[70] > 0.03
    assert late[470] == pytest.approx(soon[70], rel=0.02)


AH = np.concatenate([np.zeros(RATE // 4), vowel(MEN["ɑ"], 120.0, 0.6), np.zeros(RATE // 4)])


def test_a_file_shows_what_a_stream_shows_without_its_delay(tmp_path: Path) -> None:
    sound = np.concatenate([AH, noise(4500, 7800, 0.2, 0.06), AH])
    (tmp_path / "a.wav").write_bytes(wav(sound))
    take, live = wav_take(tmp_path / "a.wav", P), heard(VoiceEnvelope(P, RATE), sound)
    assert take.frames == len(sound) // 160 and take.rate_hz == pytest.approx(100.0)
    np.testing.assert_allclose(take.times_s, np.arange(take.frames) / 100)
    later = [np.abs(live[30 + lag : 200 + lag, JAW] - take.values[30:200, JAW]).mean() for lag in range(10)]
    assert 3 <= int(np.argmin(later)) <= 6 and min(later) < 0.03
    assert take.mask[JAW] and take.mask[STRETCH] and take.through is not None


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
    size = int(0.025 * rate)
    starts = np.arange(len(sound) * 100 // rate) * rate // 100
    whole = band_levels(np.concatenate([sound, np.zeros(size)])[starts[:, None] + np.arange(size)], rate)
    pieces = (sound[at : at + rate] for at in range(0, len(sound), rate))
    np.testing.assert_allclose(levels_of(pieces, rate), whole, atol=1e-9)
