"""Head and picture following each other."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ConfigError
from controller.base.mailboxes import Mailbox
from controller.base.parameters import PARAMETERS as P
from controller.base.paths import find_config
from controller.body.body import Body
from controller.body.messages import RunOptions
from controller.layers.commands import CommandState
from controller.links.line.session import LineSession
from controller.robot.channels import build_table
from controller.robot.following import FollowingStatistics, MeasuredFace, regions_of
from controller.robot.robot import load_robot
from controller.stage.stage import load_stage
from controller.tools.stage_run import StageRun
from drivers.base.bus import BusState
from drivers.sim import SimulatedBus

JAW_ID = 4


def measured(position: np.ndarray, fresh: np.ndarray) -> BusState:
    n = len(position)
    none, flags = np.zeros(n), np.zeros(n, bool)
    return BusState(0.0, position, none, none, fresh, none, none.astype(np.uint8), flags, none, none,
                    none.astype(np.uint8), flags)  # fmt: skip


def test_the_difference_counts_only_what_was_measured() -> None:
    following = FollowingStatistics(["a", "b", "c"])
    assert following.report() == {}
    away = measured(np.radians([3.0, 50.0, 0.0]), np.array([True, False, True]))
    for _ in range(4):
        following.add(np.zeros(3), away)
    report = following.report()
    assert report["rms_deg"] == pytest.approx(np.sqrt(4.5))
    assert report["worst"][0] == {"channel": "a", "rms_deg": pytest.approx(3.0), "max_deg": pytest.approx(3.0)}


def test_a_puppet_writes_what_its_channels_show_and_leaves_the_rest() -> None:
    table = build_table(load_robot(find_config("robots", "head24"), P).channels, P)
    face = P.neutral()
    face[P.index("jawOpen")] = 0.7
    state, out = CommandState(P), P.neutral()
    angles = table.angles(face)[0]
    face_of_servos = MeasuredFace([table], [lambda: measured(angles, np.ones(len(angles), bool))], P)
    for i in range(100):
        face_of_servos.capture(state, i * 10_000_000)
        state.tick(i * 10_000_000, 0.01, out)
    assert out[P.index("jawOpen")] == pytest.approx(0.7, abs=0.15)
    assert state.holder(P.index("jawOpen")) == "capture"
    assert state.holder(P.index("tongueOut")) != "capture"  # this head has no servo for it


def test_a_head_that_was_not_read_yet_moves_nothing() -> None:
    table = build_table(load_robot(find_config("robots", "head24"), P).channels, P)
    state, out = CommandState(P), P.neutral()
    silent = measured(np.full(24, np.nan), np.zeros(24, bool))
    for read in (lambda: None, lambda: silent):
        MeasuredFace([table], [read], P).capture(state, 0)
        state.tick(10_000_000, 0.01, out)
        assert not out.any()


def test_a_driven_head_says_what_it_shows_and_how_far_each_region_is_away() -> None:
    table = build_table(load_robot(find_config("robots", "head24"), P).channels, P)
    wanted = table.angles(P.neutral())[0]
    there = wanted.copy()
    there[table.names.index("jawOpen")] += np.radians(8.0)
    state = measured(there, np.ones(24, bool))
    following = FollowingStatistics(table.names, regions_of(table, P))
    reflection = MeasuredFace([table], [lambda: state], P, [following])
    assert reflection.status() == {"away_deg": "unknown"}
    following.add(wanted, state)
    away = reflection.differences()
    assert away["jaw"] == pytest.approx(8.0 / np.sqrt(2)) and away["brows"] == 0.0  # two servos move the jaw
    assert {"brows", "lids", "eyes", "jaw", "mouth", "head"} <= set(away)
    assert reflection.status()["away_deg"] == pytest.approx(8.0 / np.sqrt(24), abs=0.01)
    assert following.report()["regions_rms_deg"]["jaw"] == pytest.approx(away["jaw"])
    face = np.full(len(P), np.nan)
    assert reflection.measured(face) and face[P.index("jawOpen")] > 0.15
    assert face[P.index("tongueOut")] == 0.0


def test_a_limp_head_moved_by_hand_moves_the_face(tmp_path: Path, root: Path) -> None:
    with SimulatedBus(range(1, 25)) as servos:
        robot = (root / "configs/robots/head24.toml").read_text()
        (tmp_path / "robot.toml").write_text(
            robot.replace('kind = "simulated"', f'kind = "dynamixel"\nport = "{servos.path}"')
        )
        (tmp_path / "stage.toml").write_text('name = "puppet"\nrobots = ["robot.toml"]\n')
        stage = load_stage(str(tmp_path / "stage.toml"), P)
        with Mailbox.create(len(P.names)) as mailbox:
            body = Body(stage, P, mailbox, RunOptions(mirror=True))
            body.start()
            body.begin()
            try:
                assert not servos.servo(JAW_ID).torque
                goal = servos.servo(JAW_ID).goal
                servos.servo(JAW_ID).place(2048 + round(0.6 * 28 / 360 * 4096))
                end, jaw = time.monotonic() + 10.0, P.index("jawOpen")
                while abs(body.newest()[0][jaw] - 0.6) > 0.1 and time.monotonic() < end:
                    time.sleep(0.02)
                assert body.newest()[0][jaw] == pytest.approx(0.6, abs=0.1)
                assert servos.servo(JAW_ID).goal == goal  # nothing was asked of it
                session = LineSession(body.state, 0)
                said = session.feed(b"MEASURED jawOpen\nREAD UNITS MEASURED\n", 0).decode().split()
                assert float(said[2].removeprefix("jawOpen=")) == pytest.approx(0.6, abs=0.1)
                assert said[3:6] == ["OK", "READ", "UNITS"] and any(word.startswith("26=") for word in said)
                body.check()
            finally:
                body.stop()


def test_a_stage_without_a_robot_has_nothing_to_mirror() -> None:
    with pytest.raises(ConfigError, match="nothing to mirror"):
        StageRun.load("serial", RunOptions(mirror=True))
