"""The window with its panel, under a virtual display: it draws, obeys its time and leaves the servos limp."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(
    shutil.which("xvfb-run") is None, reason="needs xvfb-run (apt-get install xvfb): a display to open a window on"
)


def test_a_run_with_a_window_draws_and_reports(tmp_path: Path) -> None:
    report = tmp_path / "r.json"
    program = "from controller.cli import main; main()"
    command = [
        "xvfb-run",
        "-a",
        sys.executable,
        "-c",
        program,
        "run",
        "demo",
        "--seconds",
        "3",
        "--report",
        str(report),
    ]
    environment = os.environ | {"LIBGL_ALWAYS_SOFTWARE": "1"}
    result = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=90, check=False)
    assert result.returncode == 0, result.stderr
    measured = json.loads(report.read_text())
    assert measured["face"]["renderer"] == "window"
    assert measured["face"]["frames"] > 3
    assert measured["buses"][0]["bus"]["writes"] > 20
