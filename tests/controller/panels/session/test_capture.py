"""controller.panels.session.capture"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from controller.base.parameters import PARAMETERS
from controller.panels.session.capture import MAX_S, Capture
from controller.takes.plain import plain_take
from surface.view.docks import PictureArea

JAW = PARAMETERS.index("jawOpen")


class Bench:
    """A capture whose clock and face a test sets."""

    def __init__(self, folder: Path) -> None:
        self.area, self.values, self.now_s = PictureArea(), PARAMETERS.neutral(), 5.0
        self.capture = Capture(self.area, lambda: self.values, folder, lambda: self.now_s)

    def frame(self, seconds: float, jaw: float) -> None:
        self.now_s += seconds
        self.values[JAW] = jaw
        self.capture()


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def test_a_recording_is_a_take_of_what_was_shown(bench: Bench, tmp_path: Path) -> None:
    bench.frame(1.0, 0.9)  # nothing is recorded yet
    bench.capture.toggle()
    for jaw in (0.0, 0.5, 1.0):
        bench.frame(0.1, jaw)
    assert bench.capture.recording and bench.capture.seconds == pytest.approx(0.3)
    bench.capture.toggle()
    assert not bench.capture.recording and bench.capture.seconds == 0.0
    path = tmp_path / "recording1.csv"
    assert bench.capture.message == f"wrote {path}"
    take = plain_take(path, PARAMETERS)
    assert take.values[:, JAW] == pytest.approx([0.0, 0.5, 1.0])
    assert np.diff(take.times_s) == pytest.approx([0.1, 0.1])


def test_a_recording_without_a_frame_writes_nothing(bench: Bench, tmp_path: Path) -> None:
    bench.capture.toggle()
    bench.capture.toggle()
    assert not list(tmp_path.iterdir()) and bench.capture.message == ""


def test_a_recording_ends_by_itself(bench: Bench, tmp_path: Path) -> None:
    bench.capture.toggle()
    bench.frame(MAX_S - 1.0, 0.1)
    assert bench.capture.recording
    bench.frame(2.0, 0.2)
    assert not bench.capture.recording and (tmp_path / "recording1.csv").is_file()


def test_no_file_is_written_over(bench: Bench, tmp_path: Path) -> None:
    picture = np.zeros((4, 6, 3), np.uint8)
    picture[1, 2] = 250, 20, 30
    (tmp_path / "face1.png").write_bytes(b"mine")
    bench.capture.take_picture()
    assert bench.area.wanted is not None
    bench.area.wanted(picture)
    assert (tmp_path / "face1.png").read_bytes() == b"mine"
    read = cv2.imread(str(tmp_path / "face2.png"))
    assert read is not None and (read[:, :, ::-1] == picture).all()


def test_a_folder_that_is_a_file_is_a_message(tmp_path: Path) -> None:
    (tmp_path / "gone").write_text("a file")
    bench = Bench(tmp_path / "gone")
    bench.capture.toggle()
    bench.frame(0.1, 0.3)
    bench.capture.toggle()
    assert "gone" in bench.capture.message and not bench.capture.message.startswith("wrote")


def test_a_clip_has_the_pictures_of_its_time_at_the_rate_they_came(bench: Bench, tmp_path: Path) -> None:
    jobs = bench.capture._jobs
    bench.capture.toggle_clip()
    times_s = []
    for grey in range(40):
        bench.frame(0.05, 0.0)
        if bench.area.wanted is not None:
            take, bench.area.wanted = bench.area.wanted, None
            times_s.append(0.05 * grey)
            take(np.full((96, 128, 3), 6 * grey, np.uint8))
    assert bench.capture.filming
    bench.capture.toggle_clip()
    assert not bench.capture.filming
    jobs.running[0].join(60.0)
    jobs()
    path = tmp_path / "clip1.webp"
    with Image.open(path) as clip:
        frames = getattr(clip, "n_frames", 1)
        clip.seek(frames - 1)
        clip.load()
        assert clip.size == (128, 96) and 15 <= frames <= 27
        assert abs(frames * clip.info["duration"] / 1000.0 - 2.0) < 0.3
        assert frames == len(times_s)
        assert clip.info["duration"] == pytest.approx(1e3 * np.diff(times_s).mean(), abs=1.5)
    assert bench.capture.message == f"wrote {path}, {frames} pictures"


def test_a_clip_without_pictures_says_so(bench: Bench, tmp_path: Path) -> None:
    bench.capture.toggle_clip()
    bench.capture.toggle_clip()
    assert "two pictures" in bench.capture.message and not list(tmp_path.iterdir())


def film(bench: Bench, sizes: list[tuple[int, int]]) -> None:
    """Begin a clip and take pictures of these heights and widths, one a quarter of a second."""
    bench.capture.toggle_clip()
    for size in sizes:
        bench.frame(0.25, 0.0)
        if bench.area.wanted is not None:
            take, bench.area.wanted = bench.area.wanted, None
            take(np.zeros((*size, 3), np.uint8))


def test_two_clips_in_quick_succession_are_two_files(bench: Bench, tmp_path: Path) -> None:
    for count in (4, 2):
        film(bench, [(96, 128)] * count)
        bench.capture.toggle_clip()
    jobs = bench.capture._jobs
    for job in list(jobs.running):
        job.join(60.0)
    jobs()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["clip1.webp", "clip2.webp"]
    assert not jobs.running and bench.capture.message.startswith("wrote")


def test_a_clip_ends_where_the_window_is_resized(bench: Bench, tmp_path: Path) -> None:
    film(bench, [(96, 128)] * 3 + [(80, 120)] * 2)
    assert not bench.capture.filming
    (job,) = bench.capture._jobs.running
    job.join(60.0)
    bench.capture._jobs()
    assert bench.capture.message == f"wrote {tmp_path / 'clip1.webp'}, 3 pictures"


def test_a_clip_that_cannot_be_written_says_why(bench: Bench, tmp_path: Path) -> None:
    film(bench, [(96, 128)] * 3)
    bench.capture._folder = tmp_path / "file" / "beside"
    (tmp_path / "file").write_text("")
    bench.capture.toggle_clip()
    (job,) = bench.capture._jobs.running
    job.join(60.0)
    assert not bench.capture.message.startswith("writing")
