"""What would be sent, told without a port."""

from __future__ import annotations

import json
import math
import os
import wave
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from typer.testing import CliRunner

from controller.base.parameters import PARAMETERS
from controller.base.paths import find_config
from controller.cli.app import make_app
from controller.layers.commands import CommandState
from controller.robot.robot import load_robot
from controller.stage.dry_run import OfflineRun, Rehearsal, dry_run
from controller.stage.stage import load_stage
from controller.takes.recording import recorded

HZ = 100
"""Cycles per second of the bus of head24."""


def stage_file(tmp_path: Path, text: str = "") -> Path:
    path = tmp_path / "mine.toml"
    path.write_text(f'name = "mine"\nrobots = ["head24"]\n{text}')
    return path


def test_every_channel_has_a_row_with_its_mix(root: Path) -> None:
    robot = load_robot(root / "configs/robots/head24.toml", PARAMETERS)
    offline = OfflineRun(robot, CommandState(PARAMETERS), lambda now_ns: None)
    offline.run(0.0)
    rows = {row["channel"]: row for row in offline.rows()}
    assert list(rows) == [channel.name for channel in robot.channels]
    assert rows["jawOpen"]["servo"] == "head id 4, xl330-m288"
    assert rows["jawOpen"]["mix"] == "1 jawOpen -0.4 mouthClose"
    assert {row["fastest (deg/s)"].partition(" of ")[0] for row in rows.values()} == {"0"}, "nothing moved"


def test_without_anything_to_play_every_expression_is_shown(tmp_path: Path) -> None:
    found = dry_run(load_stage(str(stage_file(tmp_path)), PARAMETERS), None, 8.0, PARAMETERS)
    rows, report = found.rows, found.buses
    sent = dict(zip(report[0]["channels"], zip(*report[0]["sent_deg"], strict=True), strict=True))
    assert len(report[0]["sent_deg"]) == 8 * HZ + 1
    assert max(sent["lipCornerUpLeft"]) > 20 and max(sent["neckYaw"]) < 10
    row = next(row for row in rows if row["channel"] == "lipCornerUpLeft")
    assert row["limits (deg)"] == "-32 to 38" and row["fastest (deg/s)"].endswith("of 300")


def test_a_script_is_rehearsed_with_rules_and_limits(tmp_path: Path) -> None:
    (tmp_path / "open.toml").write_text('steps = ["0 SET jawOpen 1", "9 NEUTRAL"]')
    path = stage_file(tmp_path, f'[[links]]\nport = "simulated"\nscript = "{tmp_path / "open.toml"}"')
    found = dry_run(load_stage(str(path), PARAMETERS), None, None, PARAMETERS)
    rows, report = found.rows, found.buses
    jaw = next(row for row in rows if row["channel"] == "jawOpen")
    assert "timing" in jaw["held by"]
    fastest, most = map(float, jaw["fastest (deg/s)"].split(" of "))
    assert 0.1 * most < fastest <= most + 0.1
    way = [sent[3] for sent in report[0]["sent_deg"]]
    assert max(way) == pytest.approx(28.0, abs=0.1) and way[int(3.5 * HZ)] == pytest.approx(18.0, abs=0.1)
    assert report[0]["rules"][0]["rule"] == "timing jawOpen toward high"


def test_a_take_is_rehearsed(tmp_path: Path) -> None:
    take = tmp_path / "a.tsv"
    take.write_text("0.0\taa\n0.6\tPP\n1.0\tsil\n")
    rows = dry_run(load_stage(str(stage_file(tmp_path)), PARAMETERS), take, None, PARAMETERS).rows
    sent = next(row for row in rows if row["channel"] == "jawOpen")["sent (deg)"]
    assert float(sent.split()[-1]) > 10


def test_of_several_heads_the_first_plays_the_take(tmp_path: Path) -> None:
    take = tmp_path / "a.tsv"
    take.write_text("0.0\tsil\n4.0\tsil\n")
    path = tmp_path / "two.toml"
    path.write_text("".join(f'[[heads]]\nname = "{name}"\nrobots = ["head24"]\n' for name in ("maple", "oak")))
    rows = dry_run(load_stage(str(path), PARAMETERS), take, None, PARAMETERS).rows
    corners = {row["servo"].partition("/")[0]: row["sent (deg)"] for row in rows if row["channel"] == "lipCornerUpLeft"}
    assert list(corners) == ["maple", "oak"]
    assert corners["maple"].split()[0] == corners["maple"].split()[-1], "silence moves no corner of the mouth"
    assert float(corners["oak"].split()[-1]) > 20.0, "the second head shows every expression"


def test_the_voice_of_a_stage_is_rehearsed_where_it_is_a_file(tmp_path: Path) -> None:
    with wave.open(str(tmp_path / "a.wav"), "wb") as file:
        file.setparams((1, 2, 16000, 0, "NONE", ""))
        file.writeframes((9000 * np.sin(np.arange(16000) / 16)).astype("<i2").tobytes())
    for more, moves in (("", True), ("voice_hz = 16000\n", False)):
        stage = load_stage(str(stage_file(tmp_path, f'voice = "a.wav"\n{more}')), PARAMETERS)
        rows = dry_run(stage, None, 1.0, PARAMETERS).rows
        jaw = next(row for row in rows if row["channel"] == "jawOpen")["sent (deg)"]
        assert (float(jaw.split()[-1]) > 4) == moves


def test_the_command_opens_no_port_and_writes_every_angle(tmp_path: Path) -> None:
    report = tmp_path / "r.json"
    path = stage_file(tmp_path, '[[links]]\nport = "/dev/none"')
    words = ["run", str(path), "--dry-run", "--seconds", "0.5", "--report", str(report)]
    result = CliRunner().invoke(make_app(), words)
    assert result.exit_code == 0, result.output
    assert "no port was opened" in result.output
    written = json.loads(report.read_text())
    assert written["dry_run"] and len(written["buses"][0]["sent_deg"]) == 51


def test_a_stage_without_a_robot_sends_nothing() -> None:
    assert dry_run(load_stage("serial", PARAMETERS), None, None, PARAMETERS) == Rehearsal()


def test_the_show_of_a_stage_lies_beside_it_and_is_played(tmp_path: Path) -> None:
    (tmp_path / "act.toml").write_text('name = "act"\nloop_s = 2.0\nsteps = ["0.0 SET headYaw 0.5"]\n')
    stage = load_stage(str(stage_file(tmp_path, 'show = "act.toml"\n')), PARAMETERS)
    report = dry_run(stage, None, 2.0, PARAMETERS).buses
    sent = dict(zip(report[0]["channels"], zip(*report[0]["sent_deg"], strict=True), strict=True))
    assert sent["neckYaw"][-1] == pytest.approx(30.0, abs=0.1)
    assert max(sent["lipCornerUpLeft"]) < 0.1


def test_a_long_take_says_how_much_of_it_was_played(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    take, report = tmp_path / "a.tsv", tmp_path / "r.json"
    take.write_text("0.0\taa\n2.0\tsil\n")
    whole = dry_run(load_stage(str(stage_file(tmp_path)), PARAMETERS), take, None, PARAMETERS)
    assert whole.seconds == whole.length_s >= 2.0
    monkeypatch.setattr("controller.stage.dry_run._MAX_S", 1.0)
    words = ["play", str(take), "--stage", str(stage_file(tmp_path)), "--dry-run", "--report", str(report)]
    said = " ".join(CliRunner().invoke(make_app(), words).output.split())
    assert f"dry run: no port was opened; computed the first 1.0 s of {whole.length_s:.1f} s" in said
    assert f"--seconds {math.ceil(whole.length_s)} computes all" in said
    written = json.loads(report.read_text())
    assert (written["played_s"], written["length_s"]) == (1.0, whole.length_s)


@pytest.mark.parametrize(("limit", "held"), [(28.0, False), (20.0, True)])
def test_resting_at_a_limit_on_purpose_is_not_held_by_it(root: Path, limit: float, held: bool) -> None:
    robot, jaw = load_robot(root / "configs/robots/head24.toml", PARAMETERS), PARAMETERS.index("jawOpen")
    channels = list(robot.channels)
    assert channels[3].map.deg[-1] == 28.0  # where an open jaw rests
    channels[3] = channels[3].model_copy(update={"limit_deg": (channels[3].limit_deg[0], limit)})
    robot = robot.model_copy(update={"rules": type(robot.rules)(), "channels": channels})
    state = CommandState(PARAMETERS)
    offline = OfflineRun(robot, state, lambda now_ns: state.set_parameters([jaw], [1.0], now_ns))
    offline.run(1.0)
    (row,) = (row for row in offline.rows() if row["channel"] == "jawOpen")
    assert ("limit" in row["held by"]) == held, row


def test_buses_of_two_robots_have_different_names(tmp_path: Path, root: Path) -> None:
    robot = (root / "configs/robots/head24.toml").read_text()
    (tmp_path / "other.toml").write_text(robot.replace('name = "head24"', 'name = "other"'))
    path = tmp_path / "two.toml"
    path.write_text('name = "two"\nrobots = ["head24", "other.toml"]\n')
    found = dry_run(load_stage(str(path), PARAMETERS), None, 0.1, PARAMETERS)
    assert {row["servo"].split()[0] for row in found.rows} == {"head24/head", "other/head"}


@pytest.fixture(scope="module")
def ticks(benchmark: Callable[[str], ModuleType]) -> ModuleType:
    """benchmarks/control_tick.py: the chain with 8 layers and what attacks it; a million ticks with --soak."""
    return benchmark("control_tick")


@pytest.mark.slow
def test_no_hostile_layer_breaks_a_limit_at_the_bus(ticks: ModuleType) -> None:
    chain = ticks.Chain(0)
    counts = ticks.faults(chain, range(3800))
    assert counts == dict.fromkeys(("not a number", "position", "speed", "acceleration", "jerk"), 0)
    assert len(chain.goals.guard.report()) >= 3  # rules came to act
    assert np.ptp(chain.sent) > 0.0


def test_the_check_of_limits_finds_broken_ones(ticks: ModuleType) -> None:
    chain = ticks.Chain(0)
    chain.table.max_speed_rad_s[:] /= 4
    chain.table.max_accel_rad_s2[:] /= 4
    counts = ticks.faults(chain, range(2000, 2600))
    assert counts["acceleration"] > 0 and counts["speed"] > 0


@pytest.mark.slow
def test_eight_layers_are_active_and_memory_does_not_grow(ticks: ModuleType) -> None:
    chain = ticks.Chain(1)
    assert ticks.growth(chain, 400) < 4096
    assert len(chain.state.mixer.active) == 8


def test_a_command_reaches_the_bus_with_the_next_tick(ticks: ModuleType) -> None:
    assert ticks.ticks_to_output(ticks.Chain(2)) == 1


def test_each_bus_has_its_own_pace() -> None:
    robot = load_robot(find_config("robots", "head24"), PARAMETERS)
    robot.buses[0] = robot.buses[0].model_copy(update={"rate_hz": 50.0})
    state = CommandState(PARAMETERS)
    jaw = PARAMETERS.index("jawOpen")
    offline = OfflineRun(robot, state, lambda now_ns: state.set_parameters([jaw], [0.5], now_ns))
    offline.run(1.0)
    sent = offline.sent_rad["head"]
    assert sent.shape == (51, 24)
    assert np.degrees(sent[-1, 3]) == pytest.approx(14.0, abs=0.05)
    assert next(iter(offline.rows()))["held by"] == "nothing"


def sent_of(report: list[dict[str, object]], name: str) -> list[float]:
    bus = report[0]
    return [row[bus["channels"].index(name)] for row in bus["sent_deg"]]  # type: ignore[attr-defined, index, union-attr]


def test_a_script_without_a_loop_runs_a_moment_longer_than_its_last_step(tmp_path: Path) -> None:
    (tmp_path / "act.toml").write_text('steps = ["0 SET jawOpen 0.5", "1 NEUTRAL"]')
    stage = load_stage(str(stage_file(tmp_path, 'show = "act.toml"\n')), PARAMETERS)
    report = dry_run(stage, None, None, PARAMETERS).buses
    assert len(sent_of(report, "jawOpen")) == round(2.5 * HZ) + 1


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_time_at_a_limit_of_position_is_told_on_both_sides(tmp_path: Path, side: float) -> None:
    stage = load_stage(str(stage_file(tmp_path)), PARAMETERS)
    channels = [
        channel.model_copy(update={"limit_deg": (-10.0, 10.0)}) if channel.name == "neckYaw" else channel
        for channel in stage.robots[0].channels
    ]
    robot, state = stage.robots[0].model_copy(update={"channels": channels}), stage.state(PARAMETERS)
    yaw = PARAMETERS.index("headYaw")
    offline = OfflineRun(robot, state, lambda now_ns: state.set_parameters([yaw], [side], now_ns))
    offline.run(3.0)
    rows = {row["channel"]: row for row in offline.rows()}
    kind, seconds, unit = rows["neckYaw"]["held by"].split()
    assert (kind, unit) == ("limit", "s") and 1.5 < float(seconds) < 3.0
    assert rows["jawOpen"]["held by"] == "nothing"
    low, _, high = map(str, rows["neckYaw"]["sent (deg)"].split())
    assert sorted([abs(float(low)), abs(float(high))]) == [0.0, 10.0]


def test_a_recording_is_played_from_its_first_face(tmp_path: Path) -> None:
    stage = load_stage(str(stage_file(tmp_path)), PARAMETERS)
    with recorded(stage.state(PARAMETERS), tmp_path / "a.rec") as state:
        for i in range(150):
            if i == 50:
                state.set_parameters([PARAMETERS.index("jawOpen")], [1.0], 10**9 + i * 10_000_000)
            state.tick(10**9 + i * 10_000_000, 0.01, PARAMETERS.neutral())
    report = dry_run(stage, tmp_path / "a.rec", None, PARAMETERS).buses
    jaw = sent_of(report, "jawOpen")
    assert len(jaw) == pytest.approx(1.5 * HZ, abs=2)
    assert max(jaw[:20]) < 0.1 and jaw[-1] == pytest.approx(28.0, abs=0.5)


@pytest.mark.slow
def test_a_lively_stage_moves_by_itself(tmp_path: Path) -> None:
    (tmp_path / "act.toml").write_text('steps = ["0 NEUTRAL"]')
    still = 'show = "act.toml"\n'
    moved = []
    for text in (still, f"liveliness = 1.0\n{still}"):
        report = dry_run(load_stage(str(stage_file(tmp_path, text)), PARAMETERS), None, 6.0, PARAMETERS).buses
        moved.append(max(np.ptp(np.array(report[0]["sent_deg"]), axis=0)))
    assert moved[0] < 0.01 < 1.0 < moved[1]


def test_a_voice_on_standard_input_is_computed_without_a_port(tmp_path: Path) -> None:
    far, near = os.openpty()
    os.set_blocking(far, False)
    robot = find_config("robots", "head24").read_text(encoding="utf-8")
    simulated = '[[buses]]\nname = "head"\nkind = "simulated"'
    assert simulated in robot
    real = simulated.replace("simulated", "dynamixel") + f'\nport = "{os.ttyname(near)}"'
    (tmp_path / "real.toml").write_text(robot.replace(simulated, real))
    stage = tmp_path / "mine.toml"
    stage.write_text(f'name = "mine"\nrobots = ["{tmp_path / "real.toml"}"]\n')
    sound = (12_000 * np.sin(np.arange(22_050) * 2 * np.pi * 300 / 22_050)).astype("<i2").tobytes()
    for words in (["play", "-", "--voice-rate", "22050"], ["run", str(stage), "--voice", "-", "--voice-rate", "22050"]):
        more = ["--stage", str(stage)] if words[0] == "play" else []
        report = tmp_path / "r.json"
        command = [*words, *more, "--dry-run", "--report", str(report)]
        result = CliRunner().invoke(make_app(), command, input=sound)
        assert result.exit_code == 0, result.output
        assert "dry run: no port was opened" in result.output
        found = json.loads(report.read_text())["buses"][0]
        jaw = [row[found["channels"].index("jawOpen")] for row in found["sent_deg"]]
        assert len(jaw) == pytest.approx(HZ, abs=2) and max(jaw) - min(jaw) > 2.0
    with pytest.raises(BlockingIOError):
        os.read(far, 1)
    os.close(far)
    os.close(near)


@pytest.mark.slow
def test_a_long_take_is_computed_to_its_end(tmp_path: Path) -> None:
    (tmp_path / "long.tsv").write_text("0.0\taa\n40.0\tsil\n")
    stage = load_stage(str(stage_file(tmp_path)), PARAMETERS)
    report = dry_run(stage, tmp_path / "long.tsv", None, PARAMETERS).buses
    assert len(sent_of(report, "jawOpen")) > 40 * HZ


def test_the_stages_own_take_and_voice_are_played_too(tmp_path: Path) -> None:
    (tmp_path / "own.tsv").write_text("0.0\taa\n2.0\tsil\n")
    stage = load_stage(str(stage_file(tmp_path, 'take = "own.tsv"\n')), PARAMETERS)
    report = dry_run(stage, None, None, PARAMETERS).buses
    jaw = sent_of(report, "jawOpen")
    assert len(jaw) == pytest.approx(2.15 * HZ, abs=10) and max(jaw) > 10.0


@pytest.mark.parametrize(("seconds", "control_hz", "cycles"), [(0.0, 100.0, 1), (0.05, 100.0, 6), (0.1, 50.0, 11)])
def test_every_cycle_of_a_bus_has_a_row_of_angles_to_a_thousandth_of_a_degree(
    root: Path, seconds: float, control_hz: float, cycles: int
) -> None:
    robot = load_robot(root / "configs/robots/head24.toml", PARAMETERS)
    offline = OfflineRun(robot, CommandState(PARAMETERS), lambda now_ns: None, control_hz)
    offline.run(seconds)
    (bus,) = offline.report()
    assert (bus["bus"], bus["period_s"]) == ("head", 1 / HZ) and len(bus["sent_deg"]) == cycles  # type: ignore[arg-type]
    offline.sent_rad["head"] = np.radians(np.full((3, 24), 12.34567))
    offline.sent_rad["head"][1] = np.radians(12.39567)
    offline.sent_rad["head"][2] = np.radians(11.34567)
    (bus,) = offline.report()
    assert bus["sent_deg"] == [[12.346] * 24, [12.396] * 24, [11.346] * 24]
    row = next(iter(offline.rows()))
    assert row["sent (deg)"] == "11.3 to 12.4"
    assert row["fastest (deg/s)"].startswith("105 of ")  # 1.05 degrees in one cycle


def test_a_source_ends_a_moment_after_its_last_step_or_where_it_begins_again(tmp_path: Path) -> None:
    for text, length_s in (
        ('steps = ["0 SET jawOpen 1", "9 NEUTRAL"]', 10.5),
        ('loop_s = 2.0\nsteps = ["0 SET jawOpen 1"]', 2.0),
    ):
        (tmp_path / "act.toml").write_text(f'name = "act"\n{text}\n')
        stage = load_stage(str(stage_file(tmp_path, 'show = "act.toml"\n')), PARAMETERS)
        found = dry_run(stage, None, 0.1, PARAMETERS)
        assert (found.seconds, found.length_s) == (0.1, length_s)
    stage = load_stage(str(stage_file(tmp_path)), PARAMETERS)
    found = dry_run(stage, None, 0.0, PARAMETERS)
    assert found.length_s == 1.5 * (len(stage.vocabulary.names) + 1)  # each expression, then neutral
