"""Voices and takes beside the links."""

from __future__ import annotations

import io
import multiprocessing
import os
import time
import wave
from collections.abc import Callable
from dataclasses import FrozenInstanceError
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import TakeError
from controller.base.mailboxes import Mailbox
from controller.base.parameters import PARAMETERS as P
from controller.body.body import Body
from controller.body.sources import PipeStream, Sources, Voice, pump
from controller.layers.commands import CommandState
from controller.stage.stage import load_stage

RATE = 8000
JAW = P.index("jawOpen")


def sound(seconds: float) -> bytes:
    wave_ = 0.5 * np.sin(2 * np.pi * 200 * np.arange(int(RATE * seconds)) / RATE)
    return (wave_ * 32767).astype("<i2").tobytes()


def wav(seconds: float) -> bytes:
    out = io.BytesIO()
    with wave.open(out, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(RATE)
        file.writeframes(sound(seconds))
    return out.getvalue()


def until(condition: Callable[[], bool], seconds: float = 60.0) -> bool:
    end = time.monotonic() + seconds
    while time.monotonic() < end and not condition():
        time.sleep(0.01)
    return condition()


def jaw_of(state: CommandState) -> float:
    return float(state.mixer["speech"].values[JAW])


def test_a_file_moves_the_mouth_and_ends(tmp_path: Path) -> None:
    (tmp_path / "a.wav").write_bytes(wav(0.3))
    state = CommandState(P)
    sources = Sources(state, voice=Voice(str(tmp_path / "a.wav")))
    assert not sources.finished and sources.report()["voice"] == {"heard_s": 0.0}
    sources.begin()
    assert until(lambda: sources.voice_ended)
    assert jaw_of(state) > 0.3 and sources.error is None
    assert sources.report()["voice"] == {"heard_s": pytest.approx(0.3, abs=0.02)}
    assert not sources.finished  # the run goes on without it
    sources.stop()


@pytest.mark.parametrize("raw_hz", [None, RATE])
def test_standard_input_reaches_another_process_through_a_pipe(raw_hz: int | None) -> None:
    theirs, mine = multiprocessing.Pipe(duplex=False)
    read, write = os.pipe()
    with os.fdopen(read, "rb") as stream:
        thread = pump(mine, stream)
        os.write(write, sound(0.2) if raw_hz else wav(0.2))
        os.close(write)
        state = CommandState(P)
        sources = Sources(state, voice=Voice("-", raw_hz, alone=True, pipe=theirs))
        sources.begin()
        assert until(lambda: sources.finished)
        thread.join(30.0)
    assert jaw_of(state) > 0.3


def test_a_stages_own_take_and_voice_play_beside_its_links(tmp_path: Path) -> None:
    (tmp_path / "a.tsv").write_text("0.0\taa\n0.3\tsil\n")
    (tmp_path / "a.wav").write_bytes(wav(0.1))
    (tmp_path / "stage.toml").write_text('name = "mine"\ntake = "a.tsv"\nvoice = "a.wav"\n')
    with Mailbox.create(len(P)) as mailbox:
        body = Body(load_stage(str(tmp_path / "stage.toml"), P), P, mailbox)
        body.start()
        body.begin()
        try:
            most, sources = 0.0, body.sources
            while not (sources.voice_ended and sources._player is not None and sources._player.finished):
                most = max(most, body.newest()[0][JAW])
                time.sleep(0.01)
            assert most > 0.1 and not body.finished
            body.check()
        finally:
            body.stop()


def test_a_pipe_that_closes_is_the_end() -> None:
    theirs, mine = multiprocessing.Pipe(duplex=False)
    mine.send_bytes(b"abcdef")
    mine.close()
    stream = PipeStream(theirs)
    first, second, third = bytearray(4), bytearray(4), bytearray(4)
    assert [stream.readinto(part) for part in (first, second, third)] == [4, 2, 0]
    assert bytes(first + second[:2]) == b"abcdef" and stream.readable()


def test_what_is_no_voice_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.wav").write_bytes(b"hello")
    sources = Sources(CommandState(P), voice=Voice(str(tmp_path / "a.wav"), alone=True))
    sources.begin()
    assert until(lambda: sources.voice_ended)
    assert isinstance(sources.error, TakeError) and not sources.playing
    with pytest.raises(TakeError, match=r"none\.wav: the voice is not there"):
        Voice(str(tmp_path / "none.wav")).check()
    Voice(str(tmp_path / "a.wav")).check()
    Voice("-").check()


def test_a_record_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        object.__new__(Voice).anything = 1
