"""Reads voices in compressed files, MP3, Ogg, M4A and others, through the program ffmpeg."""

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
_LONGEST_S = 3600
_ERROR_BYTES = 4096


def compressed_take(path: Path, parameters: Parameters) -> Take:
    """A take of a voice in any file that ffmpeg decodes, of the first hour.

    Raises TakeError: the file cannot be read, ffmpeg is not installed, or it finds no sound in the file.
    """
    with files.reading(path, TakeError), files.open_file(path):
        command = _command(path)  # it is a file, and not too large
    with tempfile.TemporaryFile() as said:
        try:
            return _decoded(command, path, parameters, said)
        except TakeError as error:
            said.seek(0)
            why = said.read(_ERROR_BYTES).decode("utf-8", "replace").strip().splitlines()
            raise TakeError(
                f"{path}: ffmpeg finds no sound in it{f': {why[-1]}' if why else ''}",
                hint=f"look at: ffmpeg -i {path.name}",
            ) from error


def _decoded(command: list[str], path: Path, parameters: Parameters, said: IO[bytes]) -> Take:
    with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=said) as decoder:
        assert decoder.stdout is not None
        try:
            return voice_take(decoder.stdout, str(path), parameters, raw_hz=_RATE_HZ)
        finally:
            decoder.kill()  # it has ended, or what it still has is not read


def _command(path: Path) -> list[str]:
    """Raises TakeError: ffmpeg is not installed."""
    program = ffmpeg.find_ffmpeg()
    if program is None:
        hint = f"{ffmpeg.INSTALL}, or convert it to .wav elsewhere"
        raise TakeError(f"{path}: needs the program ffmpeg, which is not installed", hint=hint)
    wanted = ["-t", str(_LONGEST_S), "-vn", "-f", "s16le", "-ac", "1", "-ar", str(_RATE_HZ), "pipe:1"]
    return [program, "-nostdin", "-loglevel", "error", *ffmpeg.source(path), *wanted]
