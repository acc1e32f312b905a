"""Find the program ffmpeg: on the path, or in the package imageio-ffmpeg."""

from __future__ import annotations

import shutil
from importlib.util import find_spec
from pathlib import Path

INSTALL = "apt install ffmpeg, or pip install imageio-ffmpeg"
"""What to type if there is none."""


def find_ffmpeg() -> str | None:
    """Return the program's path; None where there is none."""
    if found := shutil.which("ffmpeg"):
        return found
    if find_spec("imageio_ffmpeg") is None:
        return None
    import imageio_ffmpeg  # start-up: only where there is no other

    try:
        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except RuntimeError:
        return None


def source(path: Path) -> list[str]:
    """Return options that read only this file: a protocol in its name or a playlist in it cannot reach a network."""
    return ["-protocol_whitelist", "file,pipe", "-i", f"file:{path.resolve()}"]
