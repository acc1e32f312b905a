"""Head and picture following each other."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

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
from controller.robot.channels import ChannelTable, build_table
from controller.robot.following import FollowingStatistics, MeasuredFace, Mirror
from controller.robot.robot import load_robot
from controller.stage.stage import load_stage
from controller.tools.stage_run import StageRun
from controller.vocabulary.facs import Facs
from controller.vocabulary.vocabulary import Vocabulary
from drivers.base.bus import BusState
from drivers.sim import SimulatedBus

JAW_ID = 4


def measured(position: np.ndarray, fresh: np.ndarray) -> BusState:
    n = len(position)
    none, flags = np.zeros(n), np.zeros(n, bool)
    return BusState(0.0, position, none, none, fresh, none, none.astype(np.uint8), flags, none, none,
                    none.astype(np.uint8), flags)  # fmt: skip


def test_the_difference_counts_only_what_was_measured() -> None:
    names = ("jawOpen", "headYaw", "headPitch")
    following = FollowingStatistics(SimpleNamespace(names=names, linear=np.eye(len(P))[[P.index(n) for n in names]]), P)
    assert following.report() == {}
    away = measured(np.radians([3.0, 50.0, 0.0]), np.array([True, False, True]))
    for _ in range(4):
        following.add(np.zeros(3), away)
    report = following.report()
    assert report["rms_deg"] == pytest.approx(np.sqrt(4.5))
    assert report["worst"][0] == {"channel": "jawOpen", "rms_deg": pytest.approx(3.0), "max_deg": pytest.approx(3.0)}


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
    following = FollowingStatistics(table, P)
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
                end, jaw = time.monotonic() + 60.0, P.index("jawOpen")
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
        StageRun("serial", RunOptions(mirror=True))


@pytest.fixture(scope="module")
def table() -> ChannelTable:
    return build_table(load_robot(find_config("robots", "head24"), P).channels, P)


def show(**values: float) -> np.ndarray:
    face = P.neutral()
    for name, value in values.items():
        face[P.index(name)] = value
    return face


@pytest.mark.parametrize(
    "values",
    [
        {"jawOpen": 0.8},
        {"headYaw": -0.5, "headPitch": 0.3, "headRoll": 0.2},
        {"leftEyeYaw": 0.6, "rightEyeYaw": 0.6},
        {"eyeBlinkLeft": 0.9},
        {"mouthSmileLeft": 0.7, "mouthSmileRight": 0.7},
        {"browInnerUp": 0.8},
    ],
)
def test_what_a_head_can_show_is_read_back(table: ChannelTable, values: dict[str, float]) -> None:
    read = Mirror(table, P).read(table.angles(show(**values))[0])
    for name, value in values.items():
        assert read[P.index(name)] == pytest.approx(value, abs=0.15), name


def test_the_face_that_is_read_stands_where_the_servos_are(table: ChannelTable) -> None:
    mirror = Mirror(table, P)
    random = np.random.default_rng(1)
    for _ in range(50):
        angles = table.angles(random.uniform(P.low, P.high) * (random.random(59) < 0.3) * 0.6)[0]
        left = np.abs(angles - table.angles(mirror.read(angles))[0])
        assert np.degrees(left.max()) < 3.0


def test_emotions_survive_the_way_over_the_servos(table: ChannelTable) -> None:
    mirror, facs, vocabulary = Mirror(table, P), Facs.load(P), Vocabulary.load(P)
    for name in ("happiness", "sadness", "surprise"):
        read = mirror.read(table.angles(vocabulary[name].weights)[0])
        assert facs.read_emotion(read)[0] == name


def test_stale_and_missing_angles_do_not_count(table: ChannelTable) -> None:
    mirror = Mirror(table, P)
    angles = table.angles(P.neutral())[0]
    jaw = table.names.index("jawOpen")
    angles[jaw] += 0.3
    fresh = np.ones(len(angles), dtype=bool)
    assert mirror.read(angles, fresh)[P.index("jawOpen")] > 0.3
    fresh[jaw] = False
    assert mirror.read(angles, fresh)[P.index("jawOpen")] < 0.05
    angles[jaw] = np.nan
    assert np.isfinite(mirror.read(angles)).all()


def test_values_stay_in_range_whatever_is_measured(table: ChannelTable) -> None:
    mirror = Mirror(table, P)
    for angle in (-9.0, 9.0):
        values = mirror.read(np.full(len(table.names), angle))
        assert np.all(values >= P.low) and np.all(values <= P.high)
        looks = [i for i, name in enumerate(P.names) if name.startswith("eyeLook")]
        assert not values[looks].any()


def test_a_map_that_falls_is_read_and_one_that_turns_back_is_not(table: ChannelTable) -> None:
    slopes = table.curves.slopes.copy()
    jaw = table.names.index("jawOpen")
    slopes[jaw] = -slopes[jaw]
    falling = replace(table, curves=replace(table.curves, slopes=slopes), low_rad=table.low_rad - 9)
    mirror = Mirror(falling, P)
    assert mirror.readable[jaw]
    assert mirror.read(falling.angles(show(jawOpen=0.8))[0])[P.index("jawOpen")] == pytest.approx(0.8, abs=0.1)
    slopes[jaw] = 0.0
    assert not Mirror(replace(table, curves=replace(table.curves, slopes=slopes)), P).readable[jaw]
