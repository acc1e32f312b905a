"""controller.panels.session.sound: lengths, and what a player is given, against the wave module."""

from __future__ import annotations

import os
import struct
import sys
import wave
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ControllerError
from controller.panels.session.sound import SoundPlayer, find_player, sound_length_s

RATE = 8000
COPY = "import shutil, sys; shutil.copy(sys.argv[2], sys.argv[1])"
"""A player that keeps what it was given."""


def write_wav(path: Path, data: bytes, *, kind: int = 1, channels: int = 1, bits: int = 16, claim: int = -1) -> Path:
    """A WAV file of samples; ``claim`` : how many bytes its header says they have."""
    block = channels * bits // 8
    form = struct.pack("<HHIIHH", kind, channels, RATE, RATE * block, block, bits)
    size = len(data) if claim < 0 else claim
    path.write_bytes(
        b"RIFF" + struct.pack("<I", (36 + size) & 0xFFFFFFFF) + b"WAVEfmt " + struct.pack("<I", 16) + form + b"data"
        + struct.pack("<I", size) + data
    )  # fmt: skip
    return path


def heard(path: Path, from_s: float, kept: Path) -> np.ndarray:
    """(k, channels) int16 what a player is given."""
    player = SoundPlayer([sys.executable, "-c", COPY, str(kept)])
    player.start(path, from_s)
    assert player._process is not None and player._process.wait(30) == 0
    player.stop()
    with wave.open(str(kept)) as file:
        assert (file.getframerate(), file.getsampwidth()) == (RATE, 2)
        return np.frombuffer(file.readframes(file.getnframes()), "<i2").reshape(-1, file.getnchannels())


def test_a_player_is_given_the_rest_of_both_channels(tmp_path: Path) -> None:
    samples = np.arange(-2000, 2000, dtype="<i2").reshape(-1, 2) * 8
    path = write_wav(tmp_path / "a.wav", samples.tobytes(), channels=2)
    assert sound_length_s(path) == 2000 / RATE
    found = heard(path, 500 / RATE, tmp_path / "kept.wav")
    assert found.shape == (1500, 2)
    assert np.abs(found - samples[500:]).max() <= 1


@pytest.mark.parametrize(("kind", "bits", "code"), [(3, 32, "<f4"), (3, 64, "<f8"), (1, 32, "<i4"), (1, 8, "u1")])
def test_every_kind_of_wav_that_a_take_may_be_plays(tmp_path: Path, kind: int, bits: int, code: str) -> None:
    wanted = np.sin(np.arange(800) / 20.0)
    scaled = wanted if kind == 3 else wanted * 127 + 128 if bits == 8 else wanted * (2.0 ** (bits - 1) - 1)
    path = write_wav(tmp_path / "a.wav", scaled.astype(code).tobytes(), kind=kind, bits=bits)
    found = heard(path, 0.0, tmp_path / "kept.wav")[:, 0] / 32767.0
    assert found == pytest.approx(wanted, abs=2 / 127 if bits == 8 else 1e-4)


def test_the_length_is_that_of_the_samples_and_not_what_the_header_says(tmp_path: Path) -> None:
    path = write_wav(tmp_path / "a.wav", bytes(2 * RATE), claim=2_000_000_000)
    assert sound_length_s(path) == 1.0
    assert len(heard(path, 0.25, tmp_path / "kept.wav")) == 0.75 * RATE


def test_behind_the_end_nothing_plays(tmp_path: Path) -> None:
    path = write_wav(tmp_path / "a.wav", bytes(2 * RATE))
    player = SoundPlayer(["no-such-player"])
    player.start(path, 1.0)
    assert not player.playing


def test_stopping_ends_the_player_and_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    path = write_wav(tmp_path / "a.wav", bytes(2 * RATE))
    player = SoundPlayer([sys.executable, "-c", "import time; time.sleep(60)"])
    player.start(path)
    assert player.playing
    player.stop()
    assert not player.playing
    assert sorted(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("damage", ["rate", "text", "pipe", "missing"])
def test_what_is_no_sound_is_refused_with_its_name(tmp_path: Path, damage: str) -> None:
    path = tmp_path / "a.wav"
    if damage == "rate":
        data = bytearray(write_wav(path, bytes(200)).read_bytes())
        data[24:28] = bytes(4)
        path.write_bytes(data)
    elif damage == "text":
        path.write_text("no sound")
    elif damage == "pipe":
        os.mkfifo(path)
    for read in (sound_length_s, SoundPlayer(["no-such-player"]).start):
        with pytest.raises(ControllerError, match=r"a\.wav") as caught:
            read(path)
        assert caught.value.hint


def test_a_player_that_went_and_a_full_disk_are_errors_with_a_next_step(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_wav(tmp_path / "a.wav", bytes(2 * RATE))
    player = SoundPlayer([str(tmp_path / "gone")])
    with pytest.raises(ControllerError, match="cannot be started") as caught:
        player.start(path)
    assert caught.value.hint and not player.playing
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "none"))
    with pytest.raises(ControllerError, match="no room in") as caught:
        player.start(path)
    assert caught.value.hint


def test_a_moment_far_into_a_sound_is_found_block_by_block(tmp_path: Path) -> None:
    samples = (np.arange(200_000) % 30_000).astype("<i2")  # a block has 65536
    path = write_wav(tmp_path / "a.wav", samples.tobytes())
    assert sound_length_s(path) == 25.0
    for begin in (65_536, 150_000):
        found = heard(path, begin / RATE, tmp_path / "kept.wav")[:, 0]
        assert len(found) == 200_000 - begin and np.abs(found - samples[begin:]).max() <= 1
    assert len(heard(path, -3.0, tmp_path / "kept.wav")) == 200_000


def test_of_the_programs_that_are_there_the_likeliest_plays(monkeypatch: pytest.MonkeyPatch) -> None:
    there = {"ffplay", "play"}
    monkeypatch.setattr("shutil.which", lambda name: name if name in there else None)
    monkeypatch.setattr(sys, "platform", "linux")
    assert find_player() == ("ffplay", "-nodisp", "-autoexit", "-loglevel", "error")
    there.add("aplay")
    assert find_player() == ("aplay", "-q")
    there.clear()
    assert find_player() is None
    monkeypatch.setattr(sys, "platform", "win32")
    command = find_player()
    assert command is not None and command[:2] == (sys.executable, "-c") and "winsound" in command[2]
