"""Sources of the layers besides the links: a take, a voice, a head that is moved by hand."""

from __future__ import annotations

import io
import os
import sys
import threading
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import IO, TYPE_CHECKING, TextIO

from controller.base.errors import TakeError
from controller.layers.commands import CommandState
from controller.robot.following import MeasuredFace
from controller.takes.livelink import TakePlayer
from controller.takes.voice import HOP_S, VoiceListener

if TYPE_CHECKING:
    from _typeshed import WriteableBuffer  # a name of the type checker's only

_CHUNK = 4096


@dataclass(frozen=True)
class Voice:
    """Where a voice comes from.

    path : file, named pipe or device with WAV of PCM; ``-`` for standard input.
    raw_hz : samples per second of signed 16 bit mono PCM without a header; None for WAV.
    alone : nothing else plays: its end is the end of the run. pipe : carries standard input to the body's process.
    """

    path: str
    raw_hz: int | None = None
    alone: bool = False
    pipe: Connection | None = None

    def open(self) -> IO[bytes]:
        """Open the stream; raises TakeError when that fails."""
        if self.pipe is not None:
            return io.BufferedReader(PipeStream(self.pipe), _CHUNK)
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
        """Always true."""
        return True

    def readinto(self, buffer: WriteableBuffer) -> int:
        """Wait for some bytes; 0 at the end."""
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
    """Standard input; raises TakeError where it is closed."""
    if sys.stdin is None:
        hint = "ffmpeg -i voice.mp3 -f wav -acodec pcm_s16le - | omote play -"
        raise TakeError("standard input is closed: no voice can come from it", hint=hint)
    return sys.stdin


def pump(pipe: Connection, stream: IO[bytes] | None = None) -> threading.Thread:
    """Copy a stream, by default standard input, to a pipe in a thread, and close the pipe at the end.

    Raises TakeError when standard input is closed.
    """
    source = (stream or standard_input()).fileno()

    def run() -> None:
        with suppress(OSError):  # the body has ended, or the stream was closed
            while data := os.read(source, _CHUNK):
                pipe.send_bytes(data)
        pipe.close()

    thread = threading.Thread(target=run, name="standard input", daemon=True)
    thread.start()
    return thread


class Sources:
    """Everything that writes to the layers before they are mixed.

    Parameters
    ----------
    state : the layers. player : plays a take. follow : the measured face of a head that is moved by hand.
    voice : a voice to listen to.
    beside : the take plays beside the links, and its end is not the end of the run.
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
        self._stopped = False
        self.error: Exception | None = None  # what ended the voice
        self.voice_ended = False

    @property
    def finished(self) -> bool:
        """A take has been played to its end, or a voice that was all there is to play has ended."""
        if self._player is not None:
            return self._player.finished and not self._beside
        return self.voice_ended and self._voice is not None and self._voice.alone

    def begin(self) -> None:
        """Start to listen to the voice."""
        if self._voice is not None:
            threading.Thread(target=self._listen, args=(self._voice,), name="voice", daemon=True).start()

    def stop(self) -> None:
        """Stop listening; a thread that waits for a silent stream ends with the process."""
        self._stopped = True
        if self._voice_listener is not None:
            self._voice_listener.stop()

    def tick(self, now_ns: int, begun: bool) -> None:
        """Write to the layers what is due; takes and shows wait until ``begun``."""
        if self._player is not None and begun:
            self._player.tick(now_ns)
        if self._follow is not None:
            self._follow.capture(self._state, now_ns)
        if self._state.shows is not None and begun:
            self._state.shows.tick(now_ns)

    def report(self) -> dict[str, object]:
        """How much of a take was played and of a voice was received (s); None without."""
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
        try:
            with voice.open() as stream:
                self._voice_listener = VoiceListener(stream, self._state, raw_hz=voice.raw_hz)
                if not self._stopped:
                    self._voice_listener.run()
        except Exception as error:  # noqa: BLE001  the body raises it
            self.error = error
        self.voice_ended = True
