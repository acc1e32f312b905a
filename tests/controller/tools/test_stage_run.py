"""What a session leaves behind."""

from __future__ import annotations

import json
from pathlib import Path

from controller.tools.stage_run import REPORT_FORMAT, write_report


def test_a_report_states_the_version_of_its_keys_first(tmp_path: Path) -> None:
    report = {"stage": "demo", "written": []}
    write_report(report, tmp_path / "r.json")
    found = json.loads((tmp_path / "r.json").read_text())
    assert found == {"format": REPORT_FORMAT, **report} and next(iter(found)) == "format"
    assert report == {"stage": "demo", "written": []}
