"""surface.view.pictures.clip"""

from __future__ import annotations

import shutil
import subprocess
import time
import wave
import weakref
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from surface.base import ffmpeg
from surface.base.errors import ViewError
from surface.view import write_clip


def frames(count: int, size: tuple[int, int] = (48, 32)) -> Iterator[np.ndarray]:
    for i in range(count):
        frame = np.zeros((size[1], size[0], 3), np.uint8)
        frame[:, : 4 + 4 * i] = (220, 120, 60)
        yield frame


@pytest.mark.parametrize("suffix", [".webp", ".gif"])
@pytest.mark.parametrize("given", ["known", "unknown", "list"])
def test_pillow_formats_keep_frames_and_rate(tmp_path: Path, suffix: str, given: str) -> None:
    path = tmp_path / f"clip{suffix}"
    made = list(frames(7)) if given == "list" else frames(7)
    assert write_clip(made, path, fps=20.0, count=7 if given == "known" else None) == 7
    with Image.open(path) as clip:
        assert clip.n_frames == 7
        assert clip.size == (48, 32)
        clip.seek(3)
        clip.load()
        assert clip.info["duration"] == 50
        shown = np.asarray(clip.convert("RGB")).astype(int)
    assert (np.abs(shown[16, 4:12] - (220, 120, 60)) < 25).all()
    assert (shown[16, 24:] < 25).all()


def durations(path: Path) -> list[int]:
    with Image.open(path) as clip:
        out = []
        for index in range(clip.n_frames):
            clip.seek(index)
            clip.load()
            out.append(clip.info["duration"])
        return out


@pytest.mark.parametrize(
    ("suffix", "fps", "shown", "total_ms"),
    [
        (".gif", 30.0, [30, 40, 30] * 4, 400),  # a GIF counts hundredths of a second
        (".gif", 60.0, [20, 30, 20, 30] * 2, 200),  # and browsers show less than two of them for ten
        (".gif", 120.0, [20, 20, 20, 20, 20], 100),
        (".gif", 12.0, [80, 90, 80, 80, 80, 90, 80, 80, 90, 80, 80, 90], 1000),
        (".webp", 30.0, [33, 34, 33] * 4, 400),
        (".webp", 120.0, [8, 9, 8] * 4, 100),
    ],
)
def test_a_clip_runs_at_its_rate(tmp_path: Path, suffix: str, fps: float, shown: list[int], total_ms: int) -> None:
    path = tmp_path / f"clip{suffix}"
    assert write_clip(frames(12, (64, 32)), path, fps=fps, count=12) == 12
    told = durations(path)
    assert sum(told) == pytest.approx(total_ms, abs=20)
    assert set(told) <= set(shown)
    if suffix == ".webp" or fps in (30.0, 120.0):
        assert len(told) == len(shown)


def test_a_gif_that_leaves_frames_out_shows_each_at_its_time(tmp_path: Path) -> None:
    """At 120 frames a second every third or second one, and the last not before its time."""
    write_clip(frames(12, (64, 32)), tmp_path / "clip.gif", fps=120.0, count=12)
    with Image.open(tmp_path / "clip.gif") as clip:
        wide = []
        for index in range(clip.n_frames):
            clip.seek(index)
            wide.append(int((np.asarray(clip.convert("RGB"))[16, :, 0] > 110).sum()))
    shown = [(width - 4) // 4 for width in wide]
    begins = [round(0.02 * k * 120.0) for k in range(len(shown))]
    assert np.abs(np.subtract(shown, begins)).max() <= 1 and shown[-1] >= 9


@pytest.mark.parametrize("suffix", [".webp", ".gif"])
def test_frames_of_a_known_number_are_taken_one_by_one(tmp_path: Path, suffix: str) -> None:
    made: list[weakref.ref[np.ndarray]] = []
    most = 0

    def counted() -> Iterator[np.ndarray]:
        nonlocal most
        for frame in frames(11):
            own = frame.copy()
            made.append(weakref.ref(own))
            most = max(most, sum(ref() is not None for ref in made))
            yield own
            del own

    assert write_clip(counted(), tmp_path / f"clip{suffix}", count=11) == 11
    assert most <= 3, "of which one is the first, whose size the others are compared with"
    with Image.open(tmp_path / f"clip{suffix}") as clip:
        assert clip.n_frames == 11


def test_fewer_frames_than_were_said_leave_the_old_clip(tmp_path: Path) -> None:
    write_clip(frames(3), tmp_path / "clip.webp")
    before = (tmp_path / "clip.webp").read_bytes()
    with pytest.raises(ViewError, match="ends after 3 frames of 5"):
        write_clip(frames(3), tmp_path / "clip.webp", count=5)
    assert (tmp_path / "clip.webp").read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 1


def test_a_clip_of_one_frame(tmp_path: Path) -> None:
    for name in ("clip.gif", "clip.webp"):
        assert write_clip(frames(1), tmp_path / name, fps=30.0) == 1
        with Image.open(tmp_path / name) as clip:
            assert clip.n_frames == 1


@pytest.mark.parametrize("fps", [0.0, -1.0, 1e-6, float("inf"), float("nan")])
def test_rates_that_no_clip_can_have(tmp_path: Path, fps: float) -> None:
    with pytest.raises(ViewError, match="cannot run at"):
        write_clip(frames(2), tmp_path / "clip.gif", fps=fps)


@pytest.mark.skipif(shutil.which("ffprobe") is None, reason="needs ffprobe on the PATH: apt install ffmpeg")
def test_mp4_keeps_frames_and_cuts_odd_sizes(tmp_path: Path) -> None:
    path = tmp_path / "clip.mp4"
    assert write_clip(frames(9, (51, 33)), path, fps=25) == 9
    probe = ["ffprobe", "-v", "error", "-count_frames", "-select_streams", "v:0"]
    probe += ["-show_entries", "stream=width,height,nb_read_frames,r_frame_rate", "-of", "csv=p=0", str(path)]
    told = subprocess.run(probe, capture_output=True, text=True, check=True).stdout.strip()
    assert told == "50,32,25/1,9"


def test_mp4_without_ffmpeg(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ffmpeg, "find_ffmpeg", lambda: None)
    with pytest.raises(ViewError, match="ffmpeg") as caught:
        write_clip(frames(2), tmp_path / "clip.mp4")
    assert "apt install ffmpeg" in caught.value.hint
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


def test_an_ffmpeg_that_fails_on_small_pictures_is_quoted_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What it was sent is still in a buffer when it has ended."""
    fake = tmp_path / "ffmpeg"
    fake.write_text("#!/bin/sh\nexec <&-\necho no such encoder >&2\nexit 3\n")
    fake.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")

    def slow() -> Iterator[np.ndarray]:
        yield from frames(1, (16, 16))
        time.sleep(0.5)
        yield from frames(40, (16, 16))

    with pytest.raises(ViewError, match="no such encoder"):
        write_clip(slow(), tmp_path / "clip.mp4")


needs_ffmpeg = pytest.mark.skipif(ffmpeg.find_ffmpeg() is None, reason=f"needs ffmpeg: {ffmpeg.INSTALL}")


def write_tone(path: Path, seconds: float) -> None:
    with wave.open(str(path), "wb") as file:
        file.setparams((1, 2, 16_000, 0, "NONE", ""))
        file.writeframes((9000 * np.sin(np.arange(int(16_000 * seconds)) * 0.1)).astype("<i2").tobytes())


def heard(path: Path) -> np.ndarray:
    """Samples (n,) at 16 kHz of the sound of a file, by ffmpeg."""
    command = [str(ffmpeg.find_ffmpeg()), "-loglevel", "error", "-i", str(path), "-f", "s16le", "-ar", "16000", "-"]
    return np.frombuffer(subprocess.run(command, capture_output=True, check=True, timeout=60).stdout, "<i2")


@needs_ffmpeg
@pytest.mark.parametrize("seconds", [0.5, 3.0])
def test_a_sound_begins_with_the_pictures_and_ends_with_them(tmp_path: Path, seconds: float) -> None:
    write_tone(tmp_path / "a.wav", seconds)
    assert write_clip(frames(10), tmp_path / "clip.mp4", fps=10.0, sound=tmp_path / "a.wav") == 10
    sound = heard(tmp_path / "clip.mp4").astype(float)
    assert 0.8 < len(sound) / 16_000 < 1.3
    loud = np.abs(sound[: len(sound) // 1600 * 1600]).reshape(-1, 1600).max(1) > 3000  # a value for each tenth
    assert loud[1:4].all() and loud[7] == (seconds > 1.0)


@needs_ffmpeg
def test_what_is_no_sound_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.wav").write_bytes(b"no sound")
    with pytest.raises(ViewError, match="ffmpeg failed") as caught:
        write_clip(frames(3), tmp_path / "clip.mp4", sound=tmp_path / "a.wav")
    assert "a.wav" in caught.value.hint and not (tmp_path / "clip.mp4").exists()


def test_a_webp_has_no_sound(tmp_path: Path) -> None:
    with pytest.raises(ViewError, match=r"a \.webp has no sound"):
        write_clip(frames(3), tmp_path / "clip.webp", sound=tmp_path / "a.wav")


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
