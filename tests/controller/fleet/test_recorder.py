"""Recordings of the faces of one head, as a table that plays again."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ControllerError
from controller.base.parameters import PARAMETERS as P
from controller.fleet.recorder import Recording
from controller.takes.reader import load_take


def test_what_was_added_plays_again_from_its_first_face_on(tmp_path: Path) -> None:
    recording, face = Recording(tmp_path, "show", "maple", P), P.neutral()
    for time_s, jaw in ((100.0, 0.1), (100.25, 1 / 3)):
        face[P.index("jawOpen")] = jaw
        recording.add(round(time_s * 1e9), face)
    recording.close()
    recording.close()
    recording.add(0, face)  # nothing is written once it is closed
    assert recording.path == tmp_path / "show-maple.csv"
    head, *rows = recording.path.read_text().splitlines()
    assert head.split(",") == ["time", *P.names]
    assert [row.split(",")[0] for row in rows] == ["0.000000", "0.250000"]
    values = np.array([row.split(",")[1:] for row in rows], float)
    assert values[:, P.index("jawOpen")].tolist() == [0.1, 1 / 3]  # to the last digit
    take = load_take(recording.path, P)
    assert take.duration_s == pytest.approx(0.25)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full, a device that is always full")
def test_a_full_disk_ends_the_recording_with_one_message(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "show-maple.csv").symlink_to("/dev/full")
    recording = Recording(tmp_path, "show", "maple", P)
    for at in range(5):
        recording.add(at, P.neutral())
        time.sleep(0.3)
    recording.close()
    (said,) = [record.getMessage() for record in caplog.records]
    assert said.startswith(str(tmp_path / "show-maple.csv")) and "No space left on device" in said


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(ControllerError, match=r"show-maple\.csv: cannot be written: No such file") as caught:
        Recording(tmp_path / "none", "show", "maple", P)
    assert "record =" in str(caught.value.hint)
