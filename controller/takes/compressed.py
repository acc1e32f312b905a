"""Reads voices from compressed files (MP3, Ogg, M4A and others) with the program ffmpeg."""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path
from typing import IO

from controller.base.errors import TakeError
from controller.base.parameters import Parameters
from controller.takes.livelink import Take
from controller.takes.voice import voice_take
from surface.base import ffmpeg, files

_RATE_HZ = 16_000
_MAX_SOUND_S = 3600
_MAX_ERROR_BYTES = 4096


def compressed_take(path: Path, parameters: Parameters) -> Take:
    """Read a take of a voice, at most its first hour, from any file that ffmpeg decodes.

    Raises TakeError: the file cannot be read, ffmpeg is not installed, or it finds no sound in the file.
    """
    with files.reading(path, TakeError), files.open_file(path):  # checks that it is a file and not too large
        command = _command(path)
    with tempfile.TemporaryFile() as messages:
        try:
            return _decode(command, path, parameters, messages)
        except TakeError as error:
            messages.seek(0)
            why = messages.read(_MAX_ERROR_BYTES).decode("utf-8", "replace").strip().splitlines()
            raise TakeError(
                f"{path}: ffmpeg finds no sound in it{f': {why[-1]}' if why else ''}",
                hint=f"look at: ffmpeg -i {path.name}",
            ) from error


def _decode(command: list[str], path: Path, parameters: Parameters, messages: IO[bytes]) -> Take:
    with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=messages) as decoder:
        assert decoder.stdout is not None
        try:
            return voice_take(decoder.stdout, str(path), parameters, raw_hz=_RATE_HZ)
        finally:
            decoder.kill()  # it has ended already, or the rest of its output is not needed


def _command(path: Path) -> list[str]:
    """Return the command line of ffmpeg. Raises TakeError: ffmpeg is not installed."""
    program = ffmpeg.find_ffmpeg()
    if program is None:
        hint = f"{ffmpeg.INSTALL}, or convert it to .wav elsewhere"
        raise TakeError(f"{path}: needs the program ffmpeg, which is not installed", hint=hint)
    wanted = ["-t", str(_MAX_SOUND_S), "-vn", "-f", "s16le", "-ac", "1", "-ar", str(_RATE_HZ), "pipe:1"]
    return [program, "-nostdin", "-loglevel", "error", *ffmpeg.source(path), *wanted]
