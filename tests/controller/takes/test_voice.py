"""A mouth that follows a voice while it is heard."""

from __future__ import annotations

import io
import os
import struct
import threading
import wave

import numpy as np
import pytest

from controller.base.errors import TakeError
from controller.base.parameters import PARAMETERS as P
from controller.layers.commands import CommandState
from controller.takes.voice import VoiceEnvelope, VoiceListener, samples

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
