"""Sources that write to the layers, besides the links: a take, a voice, a show, a robot that is moved by hand."""

from __future__ import annotations

import errno
import io
import os
import sys
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import IO, TYPE_CHECKING, TextIO

from controller.base.errors import TakeError
from controller.base.parts import Part
from controller.layers.commands import CommandState, Player
from controller.robot.following import MeasuredFace
from controller.takes.livelink import TakePlayer
from controller.takes.voice import HOP_S, VoiceListener

if TYPE_CHECKING:
    from _typeshed import WriteableBuffer  # a name of the type checker's only

_CHUNK_BYTES = 4096


@dataclass(frozen=True)
class Voice:
    """Where a voice comes from.

    path : file, named pipe or device with WAV (PCM); ``-`` for standard input.
    raw_hz : sample rate of signed 16 bit mono PCM without a header; None for WAV.
    alone : the voice is all there is to play, so its end, also by an error, ends the run.
    pipe : carries standard input to the control process (body).
    """

    path: str
    raw_hz: int | None = None
    alone: bool = False
    pipe: Connection | None = None

    @property
    def name(self) -> str:
        """Name for messages."""
        return "on standard input" if self.path == "-" else self.path

    @property
    def reopens(self) -> bool:
        """Whether to open it again after a failure: a named pipe or a device, but not a file, which would restart."""
        return self.path != "-" and not Path(self.path).is_file()

    def check(self) -> None:
        """Raise TakeError if there is nothing at the path, or it may not be read."""
        if self.path != "-" and not os.access(self.path, os.R_OK):
            why = os.strerror(errno.EACCES if os.path.exists(self.path) else errno.ENOENT)
            raise TakeError(f"{self.path}: cannot be read: {why}", hint=f"look at: ls -l {self.path}")

    def open(self) -> IO[bytes]:
        """Open the stream. Raises TakeError: it cannot be opened."""
        if self.pipe is not None:
            return io.BufferedReader(PipeStream(self.pipe), _CHUNK_BYTES)
        if self.path == "-":
            return standard_input().buffer
        try:
            return open(self.path, "rb")
        except OSError as error:
            hint = f"look at: ls -l {self.path}"
            raise TakeError(f"{self.path}: cannot be read: {error.strerror}", hint=hint) from error


class PipeStream(io.RawIOBase):
    """Bytes that another process sends over a pipe, as a stream that ends when the pipe does."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe, self._left = pipe, b""

    def readable(self) -> bool:
        """Return True."""
        return True

    def readinto(self, buffer: WriteableBuffer) -> int:
        """Wait for bytes, write them to ``buffer`` and return their number; 0 at the end."""
        if not self._left:
            try:
                self._left = self._pipe.recv_bytes()
            except (EOFError, OSError):
                return 0
        room = memoryview(buffer)
        count = min(len(room), len(self._left))
        room[:count], self._left = self._left[:count], self._left[count:]
        return count


def standard_input() -> TextIO:
    """Return standard input. Raises TakeError: it is closed."""
    if sys.stdin is None:
        hint = "ffmpeg -i voice.mp3 -f wav -acodec pcm_s16le - | omote play -"
        raise TakeError("standard input is closed: no voice can come from it", hint=hint)
    return sys.stdin


def pump(pipe: Connection, stream: IO[bytes] | None = None, *, raw: bool = False) -> threading.Thread:
    """Copy a stream, by default standard input, to a pipe in a thread; the pipe is closed at the end.

    raw : write plain bytes, for a reader that uses the pipe as a file; otherwise messages of multiprocessing.

    Raises TakeError: standard input is closed.
    """
    source = (stream or standard_input()).fileno()

    def run() -> None:
        with suppress(OSError):  # the body has ended, or the stream was closed
            while data := os.read(source, _CHUNK_BYTES):
                if raw:
                    _write_all(pipe.fileno(), data)
                else:
                    pipe.send_bytes(data)
        pipe.close()

    thread = threading.Thread(target=run, name="standard input", daemon=True)
    thread.start()
    return thread


def _write_all(file: int, data: bytes) -> None:
    while data:
        data = data[os.write(file, data) :]


class Sources:
    """The sources of a run, which write to the layers before these are mixed; each is a part that fails separately.

    Parameters
    ----------
    state : the layers. player : plays a take. follow : the measured face of a robot that is moved by hand.
    voice : a voice to listen to.
    beside : whether the take plays beside links, so that its end does not end the run.

    Attributes
    ----------
    error : the error of the only source of the run, which ends the run.
    """

    def __init__(
        self,
        state: CommandState,
        player: TakePlayer | None = None,
        follow: MeasuredFace | None = None,
        voice: Voice | None = None,
        *,
        beside: bool = False,
    ) -> None:
        self._state, self._player, self._follow, self._voice, self._beside = state, player, follow, voice, beside
        self._voice_listener: VoiceListener | None = None
        self._stopping = threading.Event()
        self.error: Exception | None = None
        self.voice_ended = False
        self._take = self._part(f"take {player.take.name}", player.layer) if player is not None else None
        self._measured = state.parts.add(Part("measured face", ended=lambda: state.release_layer("capture")))
        self._voice_part = self._part(f"voice {voice.name}", "speech", reopens=voice.reopens) if voice else None

    def _part(self, name: str, layer: str, *, reopens: bool = False) -> Part:
        remedy = "" if reopens else "it plays again when omote is started again"
        ended = partial(self._state.release_layer, layer)
        return self._state.parts.add(Part(name, remedy=remedy, effect="its layer fades out", ended=ended))

    @property
    def finished(self) -> bool:
        """Whether the take, or the voice that is all there is to play, has ended."""
        if self._player is not None:
            return self._player.finished and not self._beside
        return self.voice_ended and self._voice is not None and self._voice.alone

    @property
    def playing(self) -> bool:
        """Whether the face follows a take, a voice, a show or a robot now."""
        take = self._player is not None and not self._player.finished and not (self._take and self._take.failed)
        voice = self._voice is not None and not self.voice_ended
        show = self._state.shows is not None and self._state.shows.status() != "off"
        return take or voice or show or self._follow is not None

    @property
    def any(self) -> bool:
        """Whether there is a source besides the links: a take, a voice, a show or a robot that is moved by hand."""
        show = self._state.shows is not None and self._state.shows.name is not None
        return show or any(each is not None for each in (self._player, self._voice, self._follow))

    def begin(self) -> None:
        """Start the thread that listens to the voice."""
        if self._voice is not None:
            threading.Thread(target=self._listen, args=(self._voice,), name="voice", daemon=True).start()

    def play(self, player: TakePlayer) -> None:
        """Play another take from its beginning; the one before ends, and its layer is released."""
        before, self._player = self._player, None
        if before is not None:
            self._state.release_layer(before.layer)
        self._take = self._part(f"take {player.take.name}", player.layer)
        self._take.recover()
        self._player, self._beside = player, True

    def stop(self) -> None:
        """Stop listening; a thread that waits for a silent stream only ends with the process."""
        self._stopping.set()
        if self._voice_listener is not None:
            self._voice_listener.stop()

    def tick(self, now_ns: int, begun: bool) -> None:
        """Write to the layers what is due at ``now_ns``; takes and shows only if the run has ``begun``."""
        if begun:
            self._play_take(now_ns)
        if (follow := self._follow) is not None:
            self._measured.run(lambda: follow.capture(self._state, now_ns), now_ns * 1e-9)
        if begun and self._state.shows is not None and self._state.shows.name is not None:
            self._play_show(self._state.shows, self._state.shows.name, now_ns)

    def _play_take(self, now_ns: int) -> None:
        player = self._player  # the panel may replace it from another thread
        if player is None or self._take is None or self._take.failed:
            return
        try:
            player.tick(now_ns)
        except Exception as error:  # noqa: BLE001  a failed take must not end the control loop
            if self._beside:
                self._take.fail(error, now_ns * 1e-9)
            else:
                self._end_run(self._take, error)

    def _end_run(self, part: Part, error: Exception) -> None:
        """Keep the error of the only source, which ends the run."""
        part.failed = True
        self.error = self.error or error

    def _play_show(self, shows: Player, name: str, now_ns: int) -> None:
        part = self._state.parts.add(show_part(name))
        failures = part.failures
        part.run(lambda: shows.tick(now_ns), now_ns * 1e-9)
        if part.failures > failures:
            with suppress(Exception):
                shows.abandon(now_ns)

    def report(self) -> dict[str, object]:
        """Return how much of the take was played, and of the voice was received (s); each is None if there is none."""
        take, voice = None, None
        if self._player is not None:
            played = self._player.take
            take = {
                "rows": played.frames,
                "rate_hz": played.rate_hz,
                "played_s": min(self._player.position_s, played.duration_s),
                "duration_s": played.duration_s,
            }
        if self._voice is not None:
            voice = {"heard_s": self._voice_listener.hops * HOP_S if self._voice_listener else 0.0}
        return {"take": take, "voice": voice}

    def _listen(self, voice: Voice) -> None:
        """Listen to the voice until it ends; a pipe or device that failed is opened again."""
        pause_s: float | None = 0.0
        while pause_s is not None and not self._stopping.wait(pause_s):
            pause_s = self._listen_once(voice)
        self.voice_ended = True

    def _listen_once(self, voice: Voice) -> float | None:
        """Listen until the stream ends; return after how long (s) to open it again, or None not to."""
        part = self._voice_part
        assert part is not None
        try:
            with voice.open() as stream:
                self._voice_listener = VoiceListener(stream, self._state, raw_hz=voice.raw_hz)
                part.recover()
                if not self._stopping.is_set():
                    self._voice_listener.run()
        except Exception as error:  # noqa: BLE001  a failed voice must not end the thread without a report
            if voice.alone:
                self._end_run(part, error)
                return None
            retry_s = part.fail(error, time.monotonic())
            return retry_s if voice.reopens else None
        return None


def show_part(name: str) -> Part:
    """Return the part of a show, which the user restarts by its command."""
    return Part(
        f"show {name}", remedy=f"SHOW {name} starts it again", effect="the parameters that it moved are released"
    )
