"""Plays the sound of a timeline by a program of the system, from any moment on."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import wave
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from controller.base.errors import ControllerError
from controller.takes.voices.pcm import HINT, Sound, SoundFormat, open_sound
from surface.base.files import open_file, reading

PLAYERS: tuple[tuple[str, ...], ...] = (
    ("pw-play",), ("paplay",), ("aplay", "-q"), ("afplay",), ("ffplay", "-nodisp", "-autoexit", "-loglevel", "error"),
    ("play", "-q"),
)  # fmt: skip
"""Programs that play a WAV file, the likeliest first."""
_WINDOWS = "import sys, winsound; winsound.PlaySound(sys.argv[1], winsound.SND_FILENAME)"
_BLOCK = 1 << 16  # frames


def find_player() -> tuple[str, ...] | None:
    """Return the command that plays a WAV file whose path follows; None where there is none."""
    if sys.platform == "win32":
        return (sys.executable, "-c", _WINDOWS)
    return next((command for command in PLAYERS if shutil.which(command[0])), None)


def sound_length_s(path: Path) -> float:
    """Return how long the samples of a WAV file are. Raises ControllerError: it cannot be read, or is none."""
    with _open(path) as sound:
        return sum(len(block) // sound.format.frame for block in _read_blocks(sound)) / sound.format.rate_hz


class SoundPlayer:
    """Plays one sound at a time.

    command : see :func:`find_player`; None for that of this system.
    """

    def __init__(self, command: Sequence[str] | None = None) -> None:
        self._command = command
        self._process: subprocess.Popen[bytes] | None = None
        self._rest: Path | None = None

    @property
    def playing(self) -> bool:
        """Whether a sound is heard."""
        return self._process is not None and self._process.poll() is None

    def start(self, path: Path, from_s: float = 0.0) -> None:
        """Play a WAV file from a moment on; nothing behind its end.

        Raises ControllerError: the file cannot be read, or there is no program that plays it.
        """
        self.stop()
        command = self._command or find_player()
        if command is None:
            raise ControllerError("no program here plays sound", hint="sudo apt-get install alsa-utils, or ffmpeg")
        self._rest = _write_rest(path, from_s)
        if self._rest is not None:
            words = [*command, str(self._rest)]
            quiet = subprocess.DEVNULL
            try:
                self._process = subprocess.Popen(words, stdin=quiet, stdout=quiet, stderr=quiet)
            except OSError as error:
                self.stop()
                raise ControllerError(f"{words[0]}: cannot be started: {error.strerror}", hint="install it") from error

    def stop(self) -> None:
        """Play nothing."""
        if self._process is not None:
            with suppress(OSError):
                self._process.terminate()
            self._process.wait()
        if self._rest is not None:
            self._rest.unlink(missing_ok=True)
        self._process = self._rest = None


@contextmanager
def _open(path: Path) -> Iterator[Sound]:
    with reading(path, ControllerError, hint=HINT), open_file(path) as stream:
        yield open_sound(stream, str(path))


def _read_blocks(sound: Sound) -> Iterator[bytes]:
    """Return the remaining part of a sound."""
    while block := sound.read(_BLOCK):
        yield block


def _write_rest(path: Path, from_s: float) -> Path | None:
    """Return a WAV file of what comes after a moment, as 16 bit PCM: not every player can begin in the middle, or reads
    every kind of WAV. None where nothing comes."""
    with _open(path) as sound:
        form = sound.format
        skip = round(max(from_s, 0.0) * form.rate_hz)
        while skip > 0 and (block := sound.read(min(skip, _BLOCK))):
            skip -= len(block) // form.frame or skip
        parts = [np.rint(form.frames(block) * 32767.0).astype("<i2") for block in _read_blocks(sound)]
    if not any(map(len, parts)):
        return None
    try:
        return _write_wav(form, parts)
    except OSError as error:
        raise ControllerError(
            f"{path}: cannot be played: no room in {tempfile.gettempdir()}: {error.strerror}", hint="make room there"
        ) from error


def _write_wav(form: SoundFormat, parts: Sequence[NDArray[np.int16]]) -> Path:
    """Return a WAV file of samples, 16 bit PCM, that somebody else removes. Raises OSError, and leaves no file then."""
    with tempfile.NamedTemporaryFile(prefix="omote-", suffix=".wav", delete=False) as file:
        path = Path(file.name)
        try:
            with wave.open(file, "wb") as rest:
                rest.setparams((form.channels, 2, form.rate_hz, 0, "NONE", ""))
                for part in parts:
                    rest.writeframes(part.tobytes())
        except OSError:
            path.unlink(missing_ok=True)
            raise
    return path
