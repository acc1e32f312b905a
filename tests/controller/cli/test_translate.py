"""``omote translate`` as a user types it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

OMOTE = [sys.executable, "-c", "from controller.cli.app import main; main()"]


def test_a_take_is_translated_and_counted(tmp_path: Path, root: Path) -> None:
    take = tmp_path / "take.csv"
    take.write_text("Timecode,JawOpen\n0:0:0:0,0.1\n0:0:0:6,0.4\n")
    done = subprocess.run(
        [*OMOTE, "translate", str(take), "vmc:127.0.0.1:27391"],
        cwd=root, capture_output=True, text=True, timeout=60, env={**os.environ, "FORCE_COLOR": "1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr  # and figures have no colours of their own
    assert done.stdout == "" and "2 frames received" in done.stderr and "2 messages sent" in done.stderr


def test_a_wrong_end_is_one_message(root: Path) -> None:
    done = subprocess.run(
        [*OMOTE, "translate", "vcm:127.0.0.1:5", "livelink"],
        cwd=root, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert done.returncode == 1 and "error: vcm:127.0.0.1:5: unknown format 'vcm'" in done.stderr
    assert "Traceback" not in done.stderr
