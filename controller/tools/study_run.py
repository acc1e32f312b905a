"""Runs a study: plays its conditions on a stage, and writes an event log, a recording and the measured latencies."""

from __future__ import annotations

import csv
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from controller.base.errors import ConfigError
from controller.base.files import replacing
from controller.base.parameters import PARAMETERS
from controller.base.paths import find_config
from controller.body.messages import RunOptions
from controller.stage.study import Study, load_study, write_script
from controller.tools.stage_run import StageRun, write_report
from surface.base.extras import require

_SETTLE_S = 0.5  # the run goes on after the last trial


def run_study(
    path: Path,
    folder: Path,
    *,
    seed: int | None = None,
    lsl: bool = False,
    show: Callable[[StageRun, float], dict[str, Any]] = StageRun.run_without_face,
    status: Callable[[str], object] = lambda _: None,
) -> dict[str, Any]:
    """Run a study, and return the report.

    Writes ``trials.csv``, ``events.csv``, ``run.rec``, ``report.json`` and ``study.toml`` to ``folder``.

    seed : replaces the file's. lsl : also send the marks as LSL markers. show : runs a stage for a number of seconds.
    status : called with a short text about the present step.

    Raises ConfigError: the study is wrong, or the folder already has a study. MissingPackage: ``lsl`` without pylsl.
    Also raises what the stage raises.
    """
    if lsl:  # checked before the folder is made, because a second attempt with that folder would be refused
        require("sending markers of LSL", "pylsl")
    study = load_study(path, PARAMETERS, seed)
    if os.path.exists(folder / "run.rec"):  # Path.exists raises where the folder cannot be read
        raise ConfigError(f"{folder}: holds a study already", hint="choose another folder: -o participant-7")
    script = folder / "study.toml"
    write_script(study, script)  # makes the folder
    _write_trials(study, folder / "trials.csv")
    options = RunOptions(record=folder / "run.rec", show=script, events=folder / "events.csv", lsl=lsl)
    stage = find_config("stages", study.settings.stage, beside=path)
    report = show(StageRun(str(stage), options, status=status), study.length_s + _SETTLE_S)
    report["study"] = {
        "name": study.settings.name,
        "seed": study.settings.seed if seed is None else seed,
        "trials": [trial.condition for trial in study.trials],
        "measured": measured(report),
    }
    write_report(report, folder / "report.json")
    return report


def measured(report: dict[str, Any]) -> dict[str, Any]:
    """Extract from a run's report the latency of the face and of the servos, and the pose error of the servos."""
    face = report.get("face") or {}
    buses = report.get("buses", [])
    return {
        "face_latency_ms": face.get("command_to_picture_ms"),
        "servo_latency_ms": {bus["name"]: bus["command_to_wire_ms"] for bus in buses},
        "pose_error_deg": {bus["name"]: bus.get("face_difference", {}) for bus in buses},
    }


def _write_trials(study: Study, path: Path) -> None:
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["trial", "condition", "begin_s", "end_s"])
        rows.writerows([t.number, t.condition, f"{t.begin_s:.3f}", f"{t.end_s:.3f}"] for t in study.trials)
