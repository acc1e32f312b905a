"""Voices in compressed files, by ffmpeg where there is one."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import IO

import numpy as np
import pytest

from controller.base.errors import TakeError
from controller.base.parameters import PARAMETERS as P
from controller.takes import compressed
from controller.takes.reader import load_take
from controller.takes.voice import wav_take
from surface.base import ffmpeg
from surface.base.ffmpeg import INSTALL, find_ffmpeg
from tests.controller.takes.voices.synthesis import MEN, vowel

needs_ffmpeg = pytest.mark.skipif(find_ffmpeg() is None, reason=f"needs ffmpeg: {INSTALL}")


def test_without_ffmpeg_the_message_names_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ffmpeg, "find_ffmpeg", lambda: None)
    (tmp_path / "a.mp3").write_bytes(b"ID3")
    with pytest.raises(TakeError, match="needs the program ffmpeg") as caught:
        load_take(tmp_path / "a.mp3", P)
    assert "apt install ffmpeg" in caught.value.hint
    with pytest.raises(TakeError, match="cannot be read: No such file"):
        load_take(tmp_path / "none.mp3", P)


@needs_ffmpeg
@pytest.mark.parametrize("ending", ["mp3", "ogg", "m4a", "flac"])
def test_a_compressed_voice_moves_the_mouth_as_the_voice_does(tmp_path: Path, ending: str) -> None:
    sound = np.concatenate([np.zeros(4000), vowel(MEN["ɑ"], 120.0, 0.5), np.zeros(4000)])
    (tmp_path / "a.s16").write_bytes((sound * 32767).astype("<i2").tobytes())
    program = str(find_ffmpeg())
    for name in ("a.wav", f"a.{ending}"):
        source = [program, "-loglevel", "error", "-f", "s16le", "-ar", "16000", "-i", str(tmp_path / "a.s16")]
        subprocess.run([*source, str(tmp_path / name)], check=True, timeout=60)
    jaw = P.index("jawOpen")
    plain, packed = wav_take(tmp_path / "a.wav", P), load_take(tmp_path / f"a.{ending}", P)
    assert packed.duration_s == pytest.approx(plain.duration_s, abs=0.15)
    assert packed.values[:, jaw].max() == pytest.approx(plain.values[:, jaw].max(), abs=0.1)


@needs_ffmpeg
@pytest.mark.parametrize("data", [b"", b"no sound at all", b"#EXTM3U\nhttp://127.0.0.1:9/a.mp3\n"])
def test_what_holds_no_sound_is_one_message(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "a.mp3").write_bytes(data)
    with pytest.raises(TakeError, match="ffmpeg finds no sound in it") as caught:
        load_take(tmp_path / "a.mp3", P)
    assert caught.value.hint


@pytest.mark.parametrize(("size", "said"), [(4096, "x"), (4097, None)])
def test_the_last_line_of_the_first_messages_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: int, said: str | None
) -> None:
    def decode(command: list[str], path: Path, parameters: object, messages: IO[bytes]) -> object:
        messages.write(b"-" * (size - 2) + b"\nx")
        raise TakeError("no sound")

    monkeypatch.setattr(ffmpeg, "find_ffmpeg", lambda: "ffmpeg")
    monkeypatch.setattr(compressed, "_decode", decode)
    (tmp_path / "a.mp3").write_bytes(b"ID3")
    with pytest.raises(TakeError) as caught:
        load_take(tmp_path / "a.mp3", P)
    ends = f"ffmpeg finds no sound in it: {said or '-' * 4095}"
    assert str(caught.value).endswith(ends) and caught.value.hint == "look at: ffmpeg -i a.mp3"


def test_the_first_hour_is_asked_for_in_one_channel_at_sixteen_kilohertz(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ffmpeg, "find_ffmpeg", lambda: "ffmpeg")
    command = compressed._command(Path("a.mp3"))
    assert command[0] == "ffmpeg" and command[command.index("-t") + 1] == "3600"
    assert command[-7:] == ["-f", "s16le", "-ac", "1", "-ar", "16000", "pipe:1"]
