"""Video clips: animated WebP and GIF by Pillow, MP4 with or without sound by ffmpeg."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Iterable, Iterator, Sized
from contextlib import suppress
from itertools import chain, takewhile
from itertools import count as counting
from pathlib import Path
from typing import Any

import numpy as np

from surface.base import ffmpeg
from surface.base.errors import ViewError
from surface.view.pictures.imagefile import replacing

SUFFIXES = (".webp", ".gif", ".mp4")
_FPS = 0.01, 1000.0
_TICK_MS = {".webp": 1, ".gif": 10}
"""Unit of the time for which a frame is shown."""
_LEAST_TICKS = {".webp": 1, ".gif": 2}
"""Browsers show a GIF frame of less than 20 ms for 100 ms."""
_WEBP_QUALITY = 80
_MESSAGE_BYTES = 400  # of ffmpeg's output, its end


def write_clip(
    frames: Iterable[np.ndarray],
    path: str | Path,
    *,
    fps: float = 25.0,
    sound: Path | None = None,
    count: int | None = None,
) -> int:
    """Write frames as a clip; the suffix chooses the format (.webp, .gif, .mp4).

    frames : (height, width, 3) uint8 each, all of one size; taken one by one.
    fps : frames per second, 0.01 to 1000; a GIF shows 50 at most and leaves out what is more.
    count : how many frames there are, where they have no length; unknown, a .webp and a .gif keep them until the end.
    sound : file whose sound the clip has (.mp4), from its beginning, cut or silent at the end.

    Returns how many frames were given.

    Raises ViewError: unknown suffix, no frames, no ffmpeg for .mp4, a sound that cannot be read or that
    the format has no room for, or the file cannot be written.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise ViewError(
            f"cannot write {path.name}: {path.suffix or 'no suffix'} is no clip format",
            hint=f"end the name with one of {', '.join(SUFFIXES)}",
        )
    if not _FPS[0] <= fps <= _FPS[1]:
        message = f"a clip cannot run at {fps} frames per second"
        raise ViewError(message, hint=f"give a rate of {_FPS[0]:g} to {_FPS[1]:g}")
    if sound is not None and suffix != ".mp4":
        raise ViewError(f"{path.name}: a {suffix} has no sound", hint="end the name with .mp4, or leave out the sound")
    counted = _CheckedFrames(frames)
    with replacing(path) as temporary:
        if suffix == ".mp4":
            _write_mp4(temporary, counted, fps, sound)
        else:
            _write_pillow(temporary, counted, fps, len(frames) if isinstance(frames, Sized) else count)
    return counted.count


class _CheckedFrames:
    """Iterates over frames, counts them, and refuses an empty clip or a frame of another size."""

    def __init__(self, frames: Iterable[np.ndarray]) -> None:
        self._frames = iter(frames)
        self.count = 0
        first = next(self._frames, None)
        if first is None:
            raise ViewError("a clip needs at least one frame", hint="record for longer")
        self.first = np.asarray(first)

    def __iter__(self) -> Iterator[np.ndarray]:
        for frame in chain([self.first], self._frames):
            if frame.shape != self.first.shape:
                raise ViewError(f"frame {self.count} is {frame.shape}, the first was {self.first.shape}")
            self.count += 1
            yield frame


def _write_pillow(path: Path, frames: Iterable[np.ndarray], fps: float, count: int | None) -> None:
    """WebP or GIF, by the path's suffix, of so many frames; they are kept only where ``count`` is None."""
    from surface.view.pictures.reel import Reel  # imports Pillow, which few runs need

    if count is None:
        frames = list(frames)
        count = len(frames)
    given, suffix = iter(frames), path.suffix.lower()
    shown = list(takewhile(lambda place: place[0] < count, _shown(fps, _TICK_MS[suffix], _LEAST_TICKS[suffix])))
    options: dict[str, Any] = {"save_all": True, "loop": 0, "duration": [duration_ms for _, duration_ms in shown]}
    if suffix == ".webp":
        options |= {"quality": _WEBP_QUALITY, "method": 2, "minimize_size": False}
    wanted = {index for index, _ in shown}
    Reel((frame for index, frame in enumerate(given) if index in wanted), len(shown)).save(path, **options)
    for _ in given:  # those after the last that is shown are counted, too
        pass


def _shown(fps: float, tick_ms: int, least: int) -> Iterator[tuple[int, int]]:
    """(index, duration in ms) of every frame that is shown: none for less than some ticks, and all keep the rate."""
    begin, index = 0, 0
    for other in counting(1):
        end = round(1000.0 * other / fps / tick_ms)
        if end - begin >= least:
            yield index, (end - begin) * tick_ms
            begin, index = end, other


def _write_mp4(path: Path, frames: _CheckedFrames, fps: float, sound: Path | None) -> None:
    """H.264 through a pipe to ffmpeg; odd sizes lose their last row or column. The sound is added to what is there."""
    program = ffmpeg.find_ffmpeg()
    if program is None:
        raise ViewError("writing .mp4 needs ffmpeg, which is not installed", hint=f"{ffmpeg.INSTALL}, or name a .webp")
    height, width = (length & ~1 for length in frames.first.shape[:2])
    command = [program, "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"]
    command += ["-s", f"{width}x{height}", "-r", f"{fps:g}", "-i", "-", "-an"]
    command += ["-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "18", "-movflags", "+faststart", str(path)]
    pieces = (np.ascontiguousarray(frame[:height, :width]).tobytes() for frame in frames)
    _run(command, pieces, hint="write a .webp instead")
    if sound is not None:
        _add_sound(program, path, sound, frames.count / fps)


def _add_sound(program: str, path: Path, sound: Path, length_s: float) -> None:
    """Put the first sound of a file to a film, as AAC and as long as the pictures: silence follows a shorter one."""
    silent = path.with_name(f"{path.stem}-silent{path.suffix}")
    path.replace(silent)
    command = [program, "-y", "-nostdin", "-loglevel", "error", *ffmpeg.source(silent), *ffmpeg.source(sound)]
    command += ["-map", "0:v", "-map", "1:a:0", "-c:v", "copy", "-c:a", "aac", "-af", "apad", "-t", f"{length_s:.6f}"]
    try:
        _run([*command, "-movflags", "+faststart", str(path)], hint=f"look at: ffmpeg -i {sound}")
    finally:
        silent.unlink(missing_ok=True)


def _run(command: list[str], pieces: Iterable[bytes] = (), *, hint: str) -> None:
    """Feed ffmpeg, and raise ViewError with its own words where it fails."""
    with tempfile.TemporaryFile() as log:
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=log, stderr=log) as process:
            assert process.stdin is not None
            try:
                for piece in pieces:
                    process.stdin.write(piece)
                process.stdin.close()
            except BrokenPipeError:  # ffmpeg has ended: its exit status is checked below
                with suppress(BrokenPipeError):  # of what is still in the buffer
                    process.stdin.close()
        if process.returncode != 0:
            log.seek(0)
            message = log.read()[-_MESSAGE_BYTES:].decode(errors="replace").strip()
            raise ViewError(f"ffmpeg failed ({process.returncode}): {message}", hint=hint)
