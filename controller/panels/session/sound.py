"""Plays the sound of a timeline by a program of the system, from any moment on."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import wave
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from controller.base.errors import ControllerError
from surface.base.files import reading

PLAYERS: tuple[tuple[str, ...], ...] = (
    ("pw-play",), ("paplay",), ("aplay", "-q"), ("afplay",), ("ffplay", "-nodisp", "-autoexit", "-loglevel", "error"),
    ("play", "-q"),
)  # fmt: skip
"""Programs that play a WAV file, the likeliest first."""
_WINDOWS = "import sys, winsound; winsound.PlaySound(sys.argv[1], winsound.SND_FILENAME)"
_HINT = "a WAV of 8 to 32 bit PCM; another: ffmpeg -i FILE sound.wav"


def find_player() -> tuple[str, ...] | None:
    """The command that plays a WAV file whose path follows; None where there is none."""
    if sys.platform == "win32":
        return (sys.executable, "-c", _WINDOWS)
    return next((command for command in PLAYERS if shutil.which(command[0])), None)


def sound_length_s(path: Path) -> float:
    """How long a WAV file is. Raises ControllerError: it cannot be read, or is none."""
    with reading(path, ControllerError, hint=_HINT), _opened(path) as found:
        return found.getnframes() / found.getframerate()


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
        self._rest = _from(path, from_s)
        if self._rest is not None:
            words = [*command, str(self._rest)]
            quiet = subprocess.DEVNULL
            self._process = subprocess.Popen(words, stdin=quiet, stdout=quiet, stderr=quiet)

    def stop(self) -> None:
        """Play nothing."""
        if self._process is not None:
            with suppress(OSError):
                self._process.terminate()
            self._process.wait()
        if self._rest is not None:
            self._rest.unlink(missing_ok=True)
        self._process = self._rest = None


def _opened(path: Path) -> wave.Wave_read:
    try:
        return wave.open(str(path), "rb")
    except (wave.Error, EOFError) as error:
        raise ControllerError(f"{path}: is no sound that can be played: {error}", hint=_HINT) from error


def _from(path: Path, from_s: float) -> Path | None:
    """A WAV file of what comes after a moment: not every player can begin in the middle. None where nothing does."""
    with reading(path, ControllerError, hint=_HINT), _opened(path) as whole:
        first = round(max(from_s, 0.0) * whole.getframerate())
        if first >= whole.getnframes():
            return None
        whole.setpos(first)
        with tempfile.NamedTemporaryFile(prefix="omote-", suffix=".wav", delete=False) as file:
            with wave.open(file, "wb") as rest:
                rest.setparams(whole.getparams())
                rest.writeframes(whole.readframes(whole.getnframes() - first))
            return Path(file.name)
