"""surface.view.pictures.clip"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from surface.base.errors import ViewError
from surface.view import write_clip


def frames(count: int, size: tuple[int, int] = (48, 32)) -> Iterator[np.ndarray]:
    for i in range(count):
        frame = np.zeros((size[1], size[0], 3), np.uint8)
        frame[:, : 4 + 4 * i] = (220, 120, 60)
        yield frame


@pytest.mark.parametrize("suffix", [".webp", ".gif"])
def test_pillow_formats_keep_frames_and_rate(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"clip{suffix}"
    assert write_clip(frames(7), path, fps=20.0) == 7
    with Image.open(path) as clip:
        assert clip.n_frames == 7
        assert clip.size == (48, 32)
        clip.seek(3)
        clip.load()
        assert clip.info["duration"] == 50
        shown = np.asarray(clip.convert("RGB")).astype(int)
    assert (np.abs(shown[16, 4:12] - (220, 120, 60)) < 25).all()
    assert (shown[16, 24:] < 25).all()


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="needs ffmpeg on the PATH")
def test_mp4_keeps_frames_and_cuts_odd_sizes(tmp_path: Path) -> None:
    path = tmp_path / "clip.mp4"
    assert write_clip(frames(9, (51, 33)), path, fps=25) == 9
    probe = ["ffprobe", "-v", "error", "-count_frames", "-select_streams", "v:0"]
    probe += ["-show_entries", "stream=width,height,nb_read_frames,r_frame_rate", "-of", "csv=p=0", str(path)]
    told = subprocess.run(probe, capture_output=True, text=True, check=True).stdout.strip()
    assert told == "50,32,25/1,9"


def test_mp4_without_ffmpeg(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ViewError, match="ffmpeg") as caught:
        write_clip(frames(2), tmp_path / "clip.mp4")
    assert ".webp" in caught.value.hint
    assert list(tmp_path.iterdir()) == []


def test_an_ffmpeg_that_fails_is_quoted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake = tmp_path / "ffmpeg"
    fake.write_text("#!/bin/sh\necho no such encoder >&2\nexit 3\n")
    fake.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    with pytest.raises(ViewError, match="no such encoder"):
        write_clip(frames(400, (256, 256)), tmp_path / "clip.mp4")
    assert list(tmp_path.iterdir()) == [fake]


@pytest.mark.parametrize("name", ["clip.avi", "clip"])
def test_unknown_suffixes(tmp_path: Path, name: str) -> None:
    with pytest.raises(ViewError, match="no clip format") as caught:
        write_clip(frames(2), tmp_path / name)
    assert ".webp" in caught.value.hint


def test_refused_frames(tmp_path: Path) -> None:
    with pytest.raises(ViewError, match="at least one frame"):
        write_clip([], tmp_path / "clip.webp")
    with pytest.raises(ViewError, match="frame 1 is"):
        write_clip([np.zeros((8, 8, 3), np.uint8), np.zeros((9, 8, 3), np.uint8)], tmp_path / "clip.webp")
    with pytest.raises(ViewError, match="0 frames per second"):
        write_clip(frames(2), tmp_path / "clip.webp", fps=0)
    assert list(tmp_path.iterdir()) == []
