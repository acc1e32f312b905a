"""Finds the program ffmpeg: that on the path, or that of the package imageio-ffmpeg."""

from __future__ import annotations

import shutil
from importlib.util import find_spec
from pathlib import Path

INSTALL = "apt install ffmpeg, or pip install imageio-ffmpeg"
"""What to type where there is none."""


def find_ffmpeg() -> str | None:
    """The program's path; None where there is none."""
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
    """Options that read a file alone: neither a protocol in its name nor a playlist in it reaches a network."""
    return ["-protocol_whitelist", "file,pipe", "-i", f"file:{path.resolve()}"]
