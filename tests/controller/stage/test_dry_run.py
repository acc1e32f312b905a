"""What would be sent, told without a port."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from controller.base.parameters import PARAMETERS
from controller.cli.app import make_app
from controller.robot.robot import load_robot
from controller.stage.dry_run import dry_run, plan_rows
from controller.stage.stage import load_stage
from controller.tools.stage_run import StageRun


def stage_file(tmp_path: Path, text: str = "") -> Path:
    path = tmp_path / "mine.toml"
    path.write_text(f'name = "mine"\nrobots = ["head24"]\n{text}')
    return path


def test_every_channel_has_a_row_with_its_mix(root: Path) -> None:
    robot = load_robot(root / "configs/robots/head24.toml", PARAMETERS)
    rows = {row["channel"]: row for row in plan_rows(robot, PARAMETERS)}
    assert list(rows) == [channel.name for channel in robot.channels]
    assert rows["jawOpen"]["servo"] == "head id 4, xl330-m288"
    assert rows["jawOpen"]["mix"] == "1 jawOpen -0.4 mouthClose"


def test_without_anything_to_play_every_expression_is_shown(tmp_path: Path) -> None:
    rows, report = dry_run(load_stage(str(stage_file(tmp_path)), PARAMETERS), None, 8.0, PARAMETERS)
    sent = dict(zip(report[0]["channels"], zip(*report[0]["sent_deg"], strict=True), strict=True))
    assert len(report[0]["sent_deg"]) == 8 * 50 + 1
    assert max(sent["lipCornerUpLeft"]) > 20 and max(sent["neckYaw"]) < 10
    row = next(row for row in rows if row["channel"] == "lipCornerUpLeft")
    assert row["limits (deg)"] == "-32 to 38" and row["fastest (deg/s)"].endswith("of 300")


def test_a_script_is_rehearsed_with_rules_and_limits(tmp_path: Path) -> None:
    (tmp_path / "open.toml").write_text('steps = ["0 SET jawOpen 1", "9 NEUTRAL"]')
    path = stage_file(tmp_path, f'[[links]]\nport = "simulated"\nscript = "{tmp_path / "open.toml"}"')
    rows, report = dry_run(load_stage(str(path), PARAMETERS), None, None, PARAMETERS)
    jaw = next(row for row in rows if row["channel"] == "jawOpen")
    assert "timing" in jaw["held by"]
    way = [sent[3] for sent in report[0]["sent_deg"]]
    assert max(way) == pytest.approx(28.0, abs=0.1) and way[int(3.5 * 50)] == pytest.approx(18.0, abs=0.1)
    assert report[0]["rules"][0]["rule"] == "timing jawOpen toward high"


def test_a_take_is_rehearsed(tmp_path: Path) -> None:
    take = tmp_path / "a.tsv"
    take.write_text("0.0\taa\n0.6\tPP\n1.0\tsil\n")
    rows, _ = dry_run(load_stage(str(stage_file(tmp_path)), PARAMETERS), take, None, PARAMETERS)
    sent = next(row for row in rows if row["channel"] == "jawOpen")["sent (deg)"]
    assert float(sent.split()[-1]) > 10


def test_the_command_opens_no_port_and_writes_every_angle(tmp_path: Path) -> None:
    report = tmp_path / "r.json"
    path = stage_file(tmp_path, '[[links]]\nport = "/dev/none"')
    words = ["run", str(path), "--dry-run", "--seconds", "0.5", "--report", str(report)]
    result = CliRunner().invoke(make_app(), words)
    assert result.exit_code == 0, result.output
    assert "no port was opened" in result.output
    written = json.loads(report.read_text())
    assert written["dry_run"] and len(written["buses"][0]["sent_deg"]) == 26


def test_a_stage_without_a_robot_sends_nothing() -> None:
    assert StageRun.load("serial").plan() == ([], [])


def test_the_show_of_a_stage_lies_beside_it_and_is_played(tmp_path: Path) -> None:
    (tmp_path / "act.toml").write_text('name = "act"\nloop_s = 2.0\nsteps = ["0.0 SET headYaw 0.5"]\n')
    _, report = dry_run(load_stage(str(stage_file(tmp_path, 'show = "act.toml"\n')), PARAMETERS), None, 2.0, PARAMETERS)
    sent = dict(zip(report[0]["channels"], zip(*report[0]["sent_deg"], strict=True), strict=True))
    assert sent["neckYaw"][-1] == pytest.approx(30.0, abs=0.1)
    assert max(sent["lipCornerUpLeft"]) < 0.1
