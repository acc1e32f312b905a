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
from typing import Any, cast

import numpy as np
import pytest

from controller.base.errors import TakeError
from controller.base.mailboxes import Mailbox
from controller.base.parameters import PARAMETERS as P
from controller.body.body import Body
from controller.body.sources import PipeStream, Sources, Voice, pump, standard_input
from controller.layers.commands import CommandState
from controller.links.line.script import Script
from controller.links.line.session import LineSession
from controller.links.line.show import Shows
from controller.stage.stage import load_stage
from tests.controller.takes.voices.synthesis import MEN, vowel

RATE = 8000
JAW = P.index("jawOpen")


def sound(seconds: float) -> bytes:
    wave_ = vowel(MEN["ɑ"], 120.0, seconds, RATE)
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
    with pytest.raises(TakeError, match=r"none\.wav: cannot be read: No such file"):
        Voice(str(tmp_path / "none.wav")).check()
    Voice(str(tmp_path / "a.wav")).check()
    Voice("-").check()


def test_a_record_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        object.__new__(Voice).anything = 1


class Broken:
    """A take, a measured face or a player of shows that raises."""

    name = "a.csv"
    layer = "capture"
    finished = False

    def __init__(self) -> None:
        self.take, self.calls = self, 0

    def tick(self, now_ns: int) -> None:
        self.calls += 1
        raise ZeroDivisionError("division by zero")

    def capture(self, state: CommandState, now_ns: int) -> None:
        self.tick(now_ns)


SECOND = 10**9


def held(state: CommandState, layer: str) -> None:
    """Let a layer hold the jaw."""
    state.write_layer(layer, np.full(len(P), 0.5), np.arange(len(P)) == JAW, 0)


def test_a_take_that_fails_beside_links_ends_and_its_layer_is_released(caplog: pytest.LogCaptureFixture) -> None:
    state, take = CommandState(P), cast(Any, Broken())
    held(state, "capture")
    sources = Sources(state, take, beside=True)
    assert sources.playing
    for i in range(300):
        sources.tick(i * SECOND, True)
    assert take.calls == 1 and sources.error is None and not sources.playing and not sources.finished
    assert caplog.messages == [
        "take a.csv failed: ZeroDivisionError: division by zero; its layer fades out; "
        "it plays again when omote is started again"
    ]
    assert not state.mixer["capture"].holding


def test_a_take_that_is_all_there_is_ends_the_run_with_its_error(caplog: pytest.LogCaptureFixture) -> None:
    sources = Sources(CommandState(P), cast(Any, Broken()))
    sources.tick(SECOND, True)
    sources.tick(2 * SECOND, True)
    assert isinstance(sources.error, ZeroDivisionError) and caplog.messages == []  # main reports it


def test_a_measured_face_that_fails_begins_again_by_itself(caplog: pytest.LogCaptureFixture) -> None:
    state, face = CommandState(P), cast(Any, Broken())
    held(state, "capture")
    sources = Sources(state, follow=face)
    for i in range(400):
        sources.tick(i * SECOND // 10, False)
    assert face.calls == 6 and state.parts.failed == ("measured face",)
    assert len(caplog.messages) == 2 and "switched off" in caplog.messages[1]
    assert not state.mixer["capture"].holding


def test_a_show_that_fails_gives_back_what_it_moved_and_nothing_else(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    state = CommandState(P)
    steps = ((0.0, "SET jawOpen 0.5"), (0.0, "EXPR smile"), (0.0, "GAZE 10 0"), (1.0, "SET jawOpen 1"))
    shows = Shows(lambda name: Script(steps, name=name), state)
    state.shows = shows
    state.set_parameters([JAW + 1], [0.2], 0)  # a host's
    sources = Sources(state)
    shows.start("tour")
    sources.tick(SECOND, True)
    assert state.status()["manual"] == 2 and state.status()["expression"] == "smile" and sources.playing
    monkeypatch.setattr(LineSession, "feed", lambda self, data, now_ns: 1 / 0)
    sources.tick(2 * SECOND, True)
    sources.tick(3 * SECOND, True)
    assert caplog.messages == [
        "show tour failed: ZeroDivisionError: division by zero; the parameters that it moved are released; "
        "SHOW tour starts it again"
    ]
    status = state.status()
    assert (status["manual"], status["expression"], status["gaze"]) == (1, "neutral", "off")
    assert status["failed"] == "show_tour" and shows.status() == "off" and not sources.playing
    monkeypatch.undo()
    shows.start("tour")
    sources.tick(4 * SECOND, True)
    assert state.status()["expression"] == "smile" and state.parts.failed == ()


def test_a_voice_on_a_pipe_is_opened_again_and_one_in_a_file_is_not(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("controller.base.parts.PAUSES_S", (0.01,) * 5)
    state, path = CommandState(P), tmp_path / "voice"
    os.mkfifo(path)
    sources = Sources(state, voice=Voice(str(path)))
    sources.begin()
    with path.open("wb") as pipe:
        pipe.write(b"this is no sound")
    assert until(lambda: state.parts.failed == (f"voice {path}",))
    with path.open("wb") as pipe:
        pipe.write(wav(0.2))
    assert until(lambda: sources.voice_ended)
    assert jaw_of(state) > 0.3 and state.parts.failed == ()
    assert len(caplog.messages) == 2 and "not WAV of PCM" in caplog.messages[0]
    (tmp_path / "a.wav").write_bytes(b"no sound")
    other = Sources(state, voice=Voice(str(tmp_path / "a.wav")))
    other.begin()
    assert until(lambda: other.voice_ended)
    assert other.error is None and not other.finished
    assert caplog.messages[2].endswith("it plays again when omote is started again")


def test_without_standard_input_no_voice_can_come_from_it(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = io.StringIO("")
    monkeypatch.setattr("sys.stdin", stream)
    assert standard_input() is stream
    monkeypatch.setattr("sys.stdin", None)
    with pytest.raises(TakeError, match="standard input is closed") as caught:
        standard_input()
    assert "ffmpeg" in caught.value.hint
