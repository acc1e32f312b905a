"""Servo positions back to parameters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.base.paths import find_config
from controller.robot.channels import ChannelTable, build_table
from controller.robot.mirror import Mirror
from controller.robot.robot import load_robot
from controller.vocabulary.facs import Facs
from controller.vocabulary.vocabulary import Vocabulary


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
