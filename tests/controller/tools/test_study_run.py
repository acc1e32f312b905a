"""A study from its file to its folder, through a body's process with simulated servos."""

from __future__ import annotations

import csv
import json
import sys
from pathlib import Path

import pytest

from controller.base.errors import ConfigError, ControllerError
from controller.base.parameters import PARAMETERS as P
from controller.takes.recording import replay
from controller.tools.study_run import measured, run_study
from surface.base.errors import MissingPackage

STUDY = """
name = "two"
stage = "mine.toml"
repeats = 1
before_s = 0.3
pause_s = 0.2
[conditions.jaw]
steps = ["0 SET jawOpen 1", "0.5 RELEASE jawOpen"]
length_s = 0.6
[conditions.brow]
steps = ["0 SET browInnerUp 1", "0.5 RELEASE browInnerUp"]
length_s = 0.6
"""


@pytest.mark.slow
def test_a_study_leaves_events_trials_recording_and_figures(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text('name = "mine"\nrobots = ["head24"]\n')
    (tmp_path / "study.toml").write_text(STUDY)
    report = run_study(tmp_path / "study.toml", tmp_path / "out", seed=5)
    order = report["study"]["trials"]
    with (tmp_path / "out" / "events.csv").open(newline="") as file:
        events = list(csv.DictReader(file))
    marks = [event["text"] for event in events if event["event"] == "mark"]
    assert marks == [f"{n}:{name}:{what}" for n, name in enumerate(order, 1) for what in ("begin", "end")]
    times = [float(event["time_s"]) for event in events]
    assert times == sorted(times) and len([event for event in events if event["event"] == "line"]) == 6
    with (tmp_path / "out" / "trials.csv").open(newline="") as file:
        assert [row["condition"] for row in csv.DictReader(file)] == order
    shown = [values.copy() for _, values in replay(tmp_path / "out" / "run.rec", P)]
    assert max(values[P.index("jawOpen")] for values in shown) > 0.3
    written = json.loads((tmp_path / "out" / "report.json").read_text())
    assert written["study"]["seed"] == 5 and sorted(order) == ["brow", "jaw"]
    (latency,), (error,) = (
        written["study"]["measured"][key].values() for key in ("servo_latency_ms", "pose_error_deg")
    )
    assert latency["p50"] >= 0.0 and error["rms_deg"] >= 0.0
    with pytest.raises(ConfigError, match="holds a study already"):
        run_study(tmp_path / "study.toml", tmp_path / "out")


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text('name = "mine"\n')
    (tmp_path / "study.toml").write_text(STUDY)
    for folder in (tmp_path / "study.toml", tmp_path / "study.toml" / "under", Path("/proc/x")):
        with pytest.raises(ControllerError, match=r"study\.toml: cannot be written"):
            run_study(tmp_path / "study.toml", folder)


def test_what_is_measured_is_taken_from_the_report() -> None:
    face = {"command_to_picture_ms": {"p50": 12.0}}
    bus = {"name": "head", "command_to_wire_ms": {"p50": 3.0}, "face_difference": {"rms_deg": 1.0}}
    assert measured({"face": face, "buses": [bus]}) == {
        "face_latency_ms": {"p50": 12.0}, "servo_latency_ms": {"head": {"p50": 3.0}},
        "pose_error_deg": {"head": {"rms_deg": 1.0}},
    }  # fmt: skip
    assert measured({"face": None, "buses": []})["face_latency_ms"] is None


def test_a_package_that_is_missing_is_told_before_there_is_a_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pylsl", None)
    with pytest.raises(MissingPackage, match="pylsl: not installed") as told:
        run_study(tmp_path / "smiles.toml", tmp_path / "seven", lsl=True)
    assert "omote[lsl]" in told.value.hint and not (tmp_path / "seven").exists()
