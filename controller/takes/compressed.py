"""Reads voices in compressed files, MP3, Ogg, M4A and others, through the program ffmpeg."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import IO

from controller.base.errors import TakeError
from controller.base.parameters import Parameters
from controller.takes.livelink import Take
from controller.takes.voice import voice_take
from surface.base import files

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
    # a protocol of its own in the name, or a playlist inside the file, must not reach a network
    source = ["-protocol_whitelist", "file,pipe", "-i", f"file:{path.resolve()}"]
    wanted = ["-t", str(_LONGEST_S), "-vn", "-f", "s16le", "-ac", "1", "-ar", str(_RATE_HZ), "pipe:1"]
    return [_ffmpeg(path), "-nostdin", "-loglevel", "error", *source, *wanted]


def _ffmpeg(path: Path) -> str:
    """The program: on the path, or that of the package imageio-ffmpeg. Raises TakeError: neither is there."""
    if found := shutil.which("ffmpeg"):
        return found
    if find_spec("imageio_ffmpeg") is not None:
        import imageio_ffmpeg  # start-up: only where there is no other

        try:
            return str(imageio_ffmpeg.get_ffmpeg_exe())
        except RuntimeError:
            pass
    raise TakeError(
        f"{path}: needs the program ffmpeg, which is not installed",
        hint="apt install ffmpeg, pip install imageio-ffmpeg, or convert it to .wav elsewhere",
    )
