"""Idle life."""

from __future__ import annotations

import math
import random
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS as P
from controller.layers.idle import IdleMotion, IdleSettings

LID = P.index("eyeBlinkLeft")


@pytest.fixture(scope="module")
def settings() -> IdleSettings:
    return IdleSettings.named("natural", P)


def live(
    settings: IdleSettings, seconds: float = 120.0, *, seed: int = 1, amount: float = 1.0, **how: object
) -> np.ndarray:
    """(n, 59) what life adds, 100 times a second."""
    life = IdleMotion(P, settings, seed)
    life.liveliness = amount
    how = {"looking": False, **how}
    return np.array([life.update(50.0 + i * 0.01, **how).copy() for i in range(round(seconds * 100))])  # type: ignore[arg-type]


def blinks(path: np.ndarray) -> np.ndarray:
    """Lengths (s) of the times when the lid is more than half closed."""
    edges = np.flatnonzero(np.diff((path[:, LID] > 0.5).astype(int)))
    return np.diff(edges)[::2] / 100


def test_blink_rate_length_and_sides(settings: IdleSettings) -> None:
    path = live(settings, 300.0)
    lengths = blinks(path)
    assert 8 <= len(lengths) / 5 <= 24  # a minute: conversation and primary gaze
    assert np.all((lengths >= 0.08) & (lengths <= 0.25))
    np.testing.assert_array_equal(path[:, LID], path[:, P.index("eyeBlinkRight")])
    assert path[:, LID].max() == 1.0 and path[:, LID].min() == 0.0


def test_nothing_at_zero_and_less_at_less(settings: IdleSettings) -> None:
    assert not live(settings, 20.0, amount=0.0).any()
    head = P.region("head")
    assert np.ptp(live(settings, amount=0.5)[:, head]) < np.ptp(live(settings)[:, head]) < 0.2


def test_glances_stay_small_return_home_and_stop_when_looking(settings: IdleSettings) -> None:
    yaw = P.index("leftEyeYaw")
    free = live(settings)[:, yaw]
    assert 0.05 < np.abs(free).max() <= 7 / 35 + 1e-9
    assert np.mean(free == 0.0) > 0.2
    assert not live(settings, looking=True)[:, yaw].any()
    life = IdleMotion(P, settings, 1)
    life.liveliness = 1.0
    steps = []
    for i in range(2000):
        life.update(i * 0.01, looking=True)
        steps.append(life.eye_yaw_rad)
    assert 0 < np.degrees(np.abs(steps).max()) <= settings.eyes.micro_deg


def test_expressions_hold_back_blinks_and_glances(settings: IdleSettings) -> None:
    assert not live(settings, blink_block=1.0)[:, LID].any()
    assert live(settings, blink_block=0.5)[:, LID].max() == pytest.approx(0.5)
    assert not live(settings, gaze_block=1.0)[:, P.index("rightEyePitch")].any()


def test_breath_and_sway_never_jump(settings: IdleSettings) -> None:
    path = live(settings)
    still = np.setdiff1d(np.arange(59), [*P.region("lids"), *P.region("eyes")])
    assert np.abs(np.diff(path[:, still], axis=0)).max() < 0.01
    assert np.ptp(path[:, P.index("headPitch")]) > 0.01


def test_fidgets_are_small_and_of_the_listed_parameters(settings: IdleSettings) -> None:
    path = live(settings, 200.0)
    listed = P.indices(settings.fidget.parameters)
    assert (path[:, listed].max(axis=0) > 0.05).sum() >= 5
    assert path[:, listed].max() <= settings.fidget.amount + 1e-12
    others = np.setdiff1d(np.arange(59), [*listed, LID, P.index("eyeBlinkRight"), *P.region("head"), *P.region("eyes")])
    assert not path[:, others].any()


def test_a_large_gaze_shift_often_brings_a_blink(settings: IdleSettings) -> None:
    def blinked(angle_rad: float, seed: int) -> bool:
        life = IdleMotion(P, settings, seed)
        life.liveliness = 1.0
        life.update(0.0, looking=True)
        life.shift(angle_rad, 0.01)
        return any(life.update(0.01 + i * 0.01, looking=True)[LID] > 0.9 for i in range(20))

    share = np.mean([blinked(0.5, seed) for seed in range(200)])
    assert 0.35 < share < 0.65
    assert not any(blinked(0.1, seed) for seed in range(50))


def test_a_shift_of_the_gaze_counts_from_its_angle_on(settings: IdleSettings) -> None:
    blink = settings.blink.model_copy(update={"shift_deg": math.degrees(0.3), "shift_share": 1.0})
    for angle_rad, blinks_soon in ((0.3, True), (-0.3, True), (0.29, False), (-0.29, False)):
        life = IdleMotion(P, settings.model_copy(update={"blink": blink}))
        life.liveliness = 1.0
        life.update(0.0, looking=True)
        life.shift(angle_rad, 0.5)
        assert (life._next_blink_s == 0.5) == blinks_soon
        before = life._next_blink_s
        life.shift(0.3, 1.5)  # one that is due before stays so
        assert life._next_blink_s == min(before, 1.5)


@pytest.mark.parametrize("looking", [False, True])
def test_the_eyes_rest_between_two_glances(settings: IdleSettings, looking: bool) -> None:
    eyes = settings.eyes.model_copy(
        update={"interval_s": (2.0, 2.0), "micro_interval_s": (0.5, 0.5), "home_share": 0.0}
    )
    life = IdleMotion(P, settings.model_copy(update={"eyes": eyes}), 3)
    life.liveliness = 1.0
    seen = []
    for i in range(401):
        life.update(10.0 + i / 100, looking=looking)
        seen.append((life.eye_yaw_rad, life.eye_pitch_rad))
    changes = [i for i in range(1, 401) if seen[i] != seen[i - 1]]
    every = 50 if looking else 200
    assert np.abs(np.diff([0, *changes]) - every).max() <= 2 and len(changes) == 400 // every


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_a_double_blink_comes_after_its_gap(settings: IdleSettings, share: float) -> None:
    figures = {"interval_s": (5.0, 5.0), "double_share": share, "double_gap_s": (0.3, 0.3), "hold_s": (0.05, 0.05)}
    blink = settings.blink.model_copy(update=figures)
    path = live(settings.model_copy(update={"blink": blink}), 20.0)
    closed = (path[:, LID] > 0.5).astype(int)
    begins = np.flatnonzero(np.diff(closed) > 0) / 100
    once = blink.close_s + 0.05 + blink.open_s
    if share:
        assert len(begins) == 6 and np.diff(begins)[::2] == pytest.approx([once + 0.3] * 3, abs=0.021)
        assert np.diff(begins)[1::2] == pytest.approx([once + 5.0] * 2, abs=0.021)
    else:
        assert np.diff(begins) == pytest.approx([once + 5.0] * (len(begins) - 1), abs=0.021) and len(begins) == 3


class Lowest(random.Random):
    """Draws the lowest share every time, and one deviation of a spread."""

    def random(self) -> float:
        return 0.0

    def gauss(self, mu: float = 0.0, sigma: float = 1.0) -> float:
        return mu + sigma


def test_a_share_of_zero_never_happens(settings: IdleSettings) -> None:
    blink = settings.blink.model_copy(update={"shift_share": 0.0, "double_share": 0.0})
    eyes = settings.eyes.model_copy(update={"home_share": 0.0})
    life = IdleMotion(P, settings.model_copy(update={"blink": blink, "eyes": eyes}))
    life.liveliness, life._random = 1.0, Lowest()
    life.update(0.0, looking=False)
    assert life.eye_yaw_rad != 0.0  # not at home
    soon = life._next_blink_s
    life.shift(1.0, 0.01)
    assert life._next_blink_s == soon
    life.update(soon, looking=False)
    assert len(life._blinks) == 1


def test_a_wrong_file_lists_every_fault(tmp_path: Path, root: Path) -> None:
    text = (root / "configs" / "life" / "natural.toml").read_text()
    path = tmp_path / "own.toml"
    path.write_text(text.replace("interval_s = [2.0, 6.0]", "interval_s = [6.0, 2.0]").replace("roll_deg", "rol_deg"))
    with pytest.raises(ConfigError) as caught:
        IdleSettings.named(str(path), P)
    for part in (
        "blink.interval_s: must be [shortest, longest], not [6.0, 2.0]",
        "head.roll_deg: missing",
        "head.rol_deg: unknown key",
    ):
        assert part in str(caught.value)
    path.write_text(text.replace('"mouthPucker"', '"mouthPuker"'))
    with pytest.raises(ConfigError, match="did you mean 'mouthPucker'"):
        IdleSettings.named(str(path), P)


def test_it_goes_on_after_it_was_switched_off(settings: IdleSettings) -> None:
    life = IdleMotion(P, settings, 1)
    life.liveliness = 1.0
    life.update(0.0, looking=False)
    life.liveliness = 0.0
    assert not life.update(1.0, looking=False).any() and not life.head_rad.any()
    assert (life.eye_yaw_rad, life.eye_pitch_rad) == (0.0, 0.0)
    life.liveliness = 1.0
    path = np.array([life.update(2.0 + i * 0.01, looking=False).copy() for i in range(6000)])
    assert 8 <= len(blinks(path)) <= 24  # in a minute
    assert not path[: int(settings.blink.interval_s[0] * 100), LID].any()  # and not at once
    assert len(np.unique(path[:, P.index("leftEyeYaw")])) > 5
    assert (path[:, P.indices(settings.fidget.parameters)].max(axis=0) > 0.05).any()


def test_what_expressions_hold_back_is_given_by_name(settings: IdleSettings) -> None:
    life = IdleMotion(P, settings)
    assert life.liveliness == 0.0 and not life.values.any()
    with pytest.raises(TypeError):
        life.update(0.0, False)  # type: ignore[misc]


def test_blocks_scale_blinks_and_glances_and_nothing_else(settings: IdleSettings) -> None:
    free = live(settings, 60.0)
    half = live(settings, 60.0, blink_block=0.5, gaze_block=0.25)
    lids, eyes = P.indices(["eyeBlinkLeft", "eyeBlinkRight"]), P.indices(
        ["leftEyeYaw", "rightEyeYaw", "leftEyePitch", "rightEyePitch"]
    )  # fmt: skip
    np.testing.assert_allclose(half[:, lids], 0.5 * free[:, lids])
    np.testing.assert_allclose(half[:, eyes], 0.75 * free[:, eyes])
    others = np.setdiff1d(np.arange(len(P)), [*lids, *eyes])
    np.testing.assert_array_equal(half[:, others], free[:, others])
    assert free[:, lids].any() and free[:, eyes].any()


def test_angles_of_eyes_and_head_are_the_values_in_rad(settings: IdleSettings) -> None:
    life = IdleMotion(P, settings, 3)
    life.liveliness = 0.5
    for i in range(2000):
        values = life.update(i * 0.02, looking=False)
        for name, angle in (
            ("leftEyeYaw", 0.5 * life.eye_yaw_rad), ("rightEyeYaw", 0.5 * life.eye_yaw_rad),
            ("leftEyePitch", 0.5 * life.eye_pitch_rad), ("rightEyePitch", 0.5 * life.eye_pitch_rad),
            ("headYaw", life.head_rad[0]), ("headPitch", life.head_rad[1]), ("headRoll", life.head_rad[2]),
        ):  # fmt: skip
            index = P.index(name)
            assert values[index] == pytest.approx(angle / P.full_scale_rad[index])
        assert abs(life.eye_yaw_rad) <= np.radians(settings.eyes.yaw_deg) + 1e-12
        assert abs(life.eye_pitch_rad) <= np.radians(settings.eyes.pitch_deg) + 1e-12
    life.liveliness = 0.0
    assert not life.update(41.0, looking=False).any()
    assert (life.eye_yaw_rad, life.eye_pitch_rad, life.head_rad.tolist()) == (0.0, 0.0, [0.0] * 3)


def test_breath_follows_its_four_parts(settings: IdleSettings) -> None:
    breath = settings.breath.model_copy(
        update={"inhale_s": 2.0, "hold_s": 1.0, "exhale_s": 4.0, "pause_s": 3.0, "pitch_deg": 5.0}
    )
    still = settings.head.model_copy(update={"yaw_deg": 0.0, "pitch_deg": 0.0, "roll_deg": 0.0})
    life = IdleMotion(P, settings.model_copy(update={"breath": breath, "head": still}))
    life.liveliness = 1.0
    full = {0.0: 0.0, 1.0: 0.5, 2.0: 1.0, 2.9: 1.0, 3.0: 1.0, 5.0: 0.5, 7.0: 0.0, 9.9: 0.0, 10.0: 0.0, 11.0: 0.5}
    for time_s, share in full.items():
        life.update(time_s, looking=False)
        assert life.head_rad == pytest.approx([0.0, -np.radians(5.0) * share, 0.0]), time_s


def test_the_head_sways_by_three_waves_of_its_periods(settings: IdleSettings) -> None:
    breath = settings.breath.model_copy(update={"pitch_deg": 0.0})
    head = settings.head.model_copy(
        update={"yaw_deg": 8.0, "pitch_deg": 4.0, "roll_deg": 2.0, "period_s": (5.0, 5.0)}
    )  # fmt: skip
    life = IdleMotion(P, settings.model_copy(update={"breath": breath, "head": head}), 5)
    life.liveliness = 1.0
    times = np.arange(0.0, 5.0, 0.25)
    path = np.array([(life.update(t, looking=True), life.head_rad.copy())[1] for t in times])
    for axis, reach in enumerate((8.0, 4.0, 2.0)):
        wave = np.exp(2j * np.pi * times / 5.0)
        size = 2 * np.mean(path[:, axis] * wave)
        np.testing.assert_allclose(path[:, axis], (size * wave.conj()).real, atol=1e-12)  # one period, no offset
        assert 0.0 < abs(size) <= np.radians(reach) + 1e-12
    life.update(100.0, looking=True)
    np.testing.assert_allclose(life.head_rad, path[0], atol=1e-12)


def test_each_axis_has_three_waves_of_its_own(settings: IdleSettings) -> None:
    breath = settings.breath.model_copy(update={"pitch_deg": 0.0})
    head = settings.head.model_copy(update={"yaw_deg": 8.0, "pitch_deg": 4.0, "roll_deg": 2.0, "period_s": (3.0, 9.0)})
    life = IdleMotion(P, settings.model_copy(update={"breath": breath, "head": head}), 5)
    life.liveliness = 0.5
    draw = random.Random(5)
    waves = [(draw.uniform(3.0, 9.0), draw.uniform(0.0, 2 * np.pi)) for _ in range(9)]
    for time_s in (0.0, 1.7, 44.0):
        life.update(time_s, looking=True)
        shares = [np.sin(2 * np.pi * time_s / period + phase) for period, phase in waves]
        means = np.mean(np.reshape(shares, (3, 3)), axis=1)
        np.testing.assert_allclose(life.head_rad, 0.5 * np.radians([8.0, 4.0, 2.0]) * means, atol=1e-12)
