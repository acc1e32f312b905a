"""The face's side of a run: values in the head's order, pictures kept along the way, frames counted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ControllerError
from controller.base.mailboxes import Mailbox
from controller.base.parameters import PARAMETERS
from controller.face.face import FrameLog, HeadValues, Recorder
from controller.stage.stage import FaceSettings


def test_values_come_in_the_heads_order() -> None:
    with Mailbox.create(len(PARAMETERS.names)) as mailbox:
        values = HeadValues(mailbox, PARAMETERS, ("jawOpen", "unheardOf", "headYaw"))
        mailbox.publish(np.linspace(0.0, 1.0, len(PARAMETERS.names)), 7)
        jaw, yaw = (PARAMETERS.index(name) / (len(PARAMETERS.names) - 1) for name in ("jawOpen", "headYaw"))
        assert values() == pytest.approx([jaw, 0.0, yaw])


def test_a_recorder_keeps_the_middle_at_its_own_rate() -> None:
    recorder = Recorder(clip_hz=10.0, height=4)
    picture = np.zeros((8, 16, 3), dtype=np.uint8)
    picture[:, 4:12] = 200  # the middle square
    kept = [t for t in np.arange(0.0, 1.0, 0.03) if recorder.wants(t) and recorder.keep(picture, t) is None]
    assert len(kept) == 10
    assert np.diff(kept).min() > 0.05
    assert recorder.frames[0].shape == (4, 4, 3)
    assert (recorder.frames[0] == 200).all()


def test_a_long_recording_keeps_all_of_its_time_in_no_more_pictures() -> None:
    recorder, picture = Recorder(clip_hz=10.0, height=4, most=16), np.zeros((4, 4, 3), dtype=np.uint8)
    for t in np.arange(0.0, 20.0, 0.05):
        if recorder.wants(t):
            recorder.keep(picture, t)
    assert 8 <= len(recorder.frames) <= 17 and len(recorder.times_s) == len(recorder.frames)
    assert recorder.times_s[0] == 0.0 and recorder.times_s[-1] > 18.0
    assert np.diff(recorder.times_s) == pytest.approx(1 / recorder.clip_hz, abs=0.06)


def test_a_folder_for_pictures_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    recorder = Recorder()
    recorder.keep(np.zeros((4, 4, 3), dtype=np.uint8), 0.0)
    (tmp_path / "file").touch()
    with pytest.raises(ControllerError, match=r"file: cannot be made: File exists") as told:
        recorder.write(tmp_path / "file")
    assert told.value.hint


def test_frames_with_motion_are_counted() -> None:
    log = FrameLog()
    for k, value in enumerate([0.0, 0.0, 1.0, 1.0, 2.0]):
        log.add(np.array([value]), k * 20_000_000, k * 20_000_000 + 5_000_000)
    report = log.report(FaceSettings(), "llvmpipe")
    assert report["frames"] == 5
    assert report["frames_with_motion"] == 2
    assert report["seconds"] == pytest.approx(0.085)
    assert report["frame_ms"]["p50"] == pytest.approx(5.0)  # type: ignore[index]
