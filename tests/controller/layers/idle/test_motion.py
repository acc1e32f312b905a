"""Idle motion as a whole."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.layers.idle.motion import IdleMotion, _lag_s
from controller.layers.idle.settings import IdleSettings, Manner

Live = Callable[..., np.ndarray]
LID, OTHER_LID = P.index("eyeBlinkLeft"), P.index("eyeBlinkRight")
HEAD = P.indices(["headYaw", "headPitch"])
EYES = P.indices(["leftEyeYaw", "leftEyePitch"])
DEG = np.degrees(P.full_scale_rad)


def gaze_of(path: np.ndarray) -> np.ndarray:
    """(n, 2) direction of the gaze in space, degrees."""
    return path[:, HEAD] * DEG[HEAD] + path[:, EYES] * DEG[EYES]


def on_face(gaze: np.ndarray) -> np.ndarray:
    """(n,) whether the gaze is on the listener's face, which is 20 cm high at 1 m."""
    return np.asarray(np.linalg.norm(gaze - (0.0, 1.0), axis=1) < 5.2)


def speed_of(degrees: np.ndarray, rate_hz: float) -> np.ndarray:
    """(n - 1,) deg/s."""
    return np.linalg.norm(np.diff(degrees, axis=0), axis=1) * rate_hz


def test_blinks_are_as_many_as_published(live: Live, voice: Callable[[float], float]) -> None:
    """17 a minute at rest, 26 in talk: Bentivoglio et al. 1997."""

    def a_minute(path: np.ndarray) -> float:
        return np.count_nonzero(np.diff((path[:, LID] > 0.03).astype(int)) > 0) / (len(path) / 7 / 60)

    alone = [a_minute(live(160.0, seed=seed, rate_hz=7.0)) for seed in (1, 2)]
    assert np.mean(alone) == pytest.approx(17.0, abs=2.5)
    talking = [a_minute(live(160.0, seed=seed, rate_hz=7.0, voice=voice, manner="speak")) for seed in (1, 2)]
    assert np.mean(talking) == pytest.approx(26.0, abs=3.5)


def test_the_eyes_move_as_often_as_peoples(live: Live) -> None:
    """In saccades 4 to 12 % of the time: two to three a second of 30 to 45 ms (Henderson 2003); it was 1.9 %."""
    path = live(25.0)
    moving = np.mean(speed_of(path[:, EYES] * DEG[EYES], 100.0) > 30.0)
    assert 0.04 < moving < 0.12


def test_the_gaze_stays_where_it_is_while_the_head_moves(settings: IdleSettings) -> None:
    """Eyes turn back by what the head does, when it arrives: the angles of an ideal head that is late by the lag."""
    life = IdleMotion(P, settings, 1)
    life.liveliness = 1.0
    late, rows, heads = life._lag_s, [], []
    assert 0.05 < late < 0.15
    for i in range(2000):
        rows.append(life.update(i * 0.01, looking=False).copy())
        heads.append(np.degrees(life._head_at(i * 0.01 - late, 1.0, life._sway.at(i * 0.01 - late))[:2]))
    path = np.array(rows)
    gaze = np.array(heads) + path[:, EYES] * DEG[EYES]
    speed = speed_of(gaze, 100.0)
    assert np.mean(speed < 2.0) > 0.85  # deg/s: fixations, but for saccades and drift
    assert np.ptp(np.array(heads)[:, 0]) > 8.0


@pytest.mark.parametrize(("manner", "share"), [("alone", 0.61), ("listen", 0.86), ("speak", 0.53)])
def test_the_share_of_gaze_on_the_listener(live: Live, manner: Manner, share: float) -> None:
    """Argyle and Cook 1976; Andrist et al. 2013; Kendon 1967."""
    gaze = gaze_of(np.concatenate([live(300.0, seed=seed, rate_hz=1.0, manner=manner) for seed in (1, 2, 3)]))
    assert np.mean(on_face(gaze)) == pytest.approx(share, abs=0.07)


def test_the_head_moves_more_than_it_sways(live: Live) -> None:
    degrees = live(120.0, rate_hz=10.0)[:, P.region("head")] * DEG[P.region("head")]
    assert np.all(np.ptp(degrees, axis=0) > (8.0, 4.0, 4.0)) and np.all(np.abs(degrees).max(axis=0) < (22.0, 12.0, 8.0))
    assert speed_of(degrees, 10.0).max() < 80.0


def test_left_and_right_differ_a_little(live: Live) -> None:
    path = live(100.0, rate_hz=20.0)
    difference = np.abs(path[:, LID] - path[:, OTHER_LID])
    assert 0.02 < difference.max() < 0.25
    for name in ("mouthPress", "browOuterUp", "eyeSquint"):
        assert not np.array_equal(path[:, P.index(f"{name}Left")], path[:, P.index(f"{name}Right")])


def test_brows_and_cheeks_go_along_with_a_blink(live: Live, settings: IdleSettings) -> None:
    own = settings.model_copy(update={"fidget": settings.fidget.model_copy(update={"poses": {}})})
    path = live(40.0, rate_hz=50.0, own=own)
    closed = path[:, LID] > 0.95
    assert closed.any()
    for name, weight in (("browDownLeft", 0.06), ("cheekSquintRight", 0.08), ("eyeSquintLeft", 0.12)):
        assert path[closed, P.index(name)].max() == pytest.approx(weight, rel=0.05)
        assert not path[path[:, LID] + path[:, OTHER_LID] == 0.0, P.index(name)].any()


def test_speech_raises_brows_and_nods_and_looks_away_and_back(live: Live, voice: Callable[[float], float]) -> None:
    brows = P.indices(["browInnerUp", "browOuterUpLeft", "browOuterUpRight"])
    path = live(120.0, rate_hz=12.5, voice=voice)
    within = np.arange(len(path)) / 12.5 % 8.0
    speaking = within < 6.0
    raised = path[:, brows].max(axis=1) > 0.12
    begun = np.count_nonzero(np.diff((raised & speaking).astype(int)) > 0) / 1.5
    assert 4 < begun < 20  # a minute of speech
    on = on_face(gaze_of(path))
    beginning, end = (within > 0.2) & (within < 0.8), (within > 7.0) & (within < 7.9)
    assert on[end].mean() > 0.85 > 0.65 > on[beginning].mean()
    assert np.std(np.diff(path[speaking][:, HEAD[1]])) > 1.3 * np.std(np.diff(live(60.0, rate_hz=12.5)[:, HEAD[1]]))


def test_it_speaks_then_listens_and_then_is_alone_unless_it_is_told(settings: IdleSettings) -> None:
    life, seen = IdleMotion(P, settings, 1), []
    life.liveliness = 1.0
    for i in range(800):
        t = i * 0.05
        life.update(t, looking=False, loudness=0.4 if 2.0 <= t < 5.0 else 0.0)
        if not seen or seen[-1][1] != life.manner:
            seen.append((t, life.manner))
    assert [manner for _, manner in seen] == ["alone", "speak", "listen", "alone"]
    assert [t for t, _ in seen] == pytest.approx([0.0, 2.0, 5.6, 17.6], abs=0.11)
    life.chosen = "listen"
    life.update(40.0, looking=False, loudness=0.4)
    assert life.manner == "listen"


def test_a_listener_nods_and_smiles(live: Live) -> None:
    smile = P.indices(["mouthSmileLeft", "mouthSmileRight"])
    listening, alone = (live(90.0, rate_hz=20.0, manner=manner) for manner in ("listen", "alone"))
    assert np.mean(listening[:, smile].min(axis=1) > 0.08) > 2 * np.mean(alone[:, smile].min(axis=1) > 0.08)
    nods = [np.count_nonzero(np.abs(np.diff(path[:, HEAD[1]] * 40, n=2)) > 0.5) for path in (listening, alone)]
    assert nods[0] > 2 * nods[1]


def test_a_listener_nods_downwards(live: Live) -> None:
    """A nod is the fastest motion of a listener's head; a positive pitch looks down."""
    pitch = live(90.0, rate_hz=20.0, manner="listen")[:, HEAD[1]]
    slow = np.convolve(pitch, np.full(41, 1 / 41), "same")
    away = (pitch - slow)[40:-40]
    assert away.max() > 1.5 * -away.min()


@pytest.mark.parametrize("manner", ["alone", "listen", "speak"])
def test_the_rate_of_frames_changes_nothing(live: Live, manner: Manner) -> None:
    fine = live(12.0, manner=manner)
    np.testing.assert_allclose(live(12.0, manner=manner, rate_hz=25.0), fine[::4], atol=1e-9)
    np.testing.assert_allclose(live(12.0, manner=manner, rate_hz=1.0), fine[::100], atol=1e-9)


def test_the_same_seed_lives_the_same_life(live: Live, voice: Callable[[float], float]) -> None:
    first, again, other = (live(10.0, seed=seed, voice=voice, rate_hz=50.0) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 0.1


def test_nothing_at_zero_and_less_at_less(live: Live, voice: Callable[[float], float]) -> None:
    assert not live(20.0, amount=0.0, voice=voice).any()
    whole, half, none = (live(60.0, amount=amount, rate_hz=10.0) for amount in (1.0, 0.5, 1e-9))
    moved = np.setdiff1d(np.flatnonzero(whole.any(axis=0)), P.region("lids"))
    upper = np.setdiff1d(moved, P.indices(["browDownLeft", "browDownRight", "cheekSquintLeft", "cheekSquintRight"]))
    np.testing.assert_allclose(half[:, upper], 0.5 * whole[:, upper], atol=1e-12)
    assert np.abs(none).max() < 1e-8


@pytest.mark.parametrize("manner", ["alone", "listen", "speak"])
def test_values_stay_in_their_ranges_and_only_lids_and_eyes_are_fast(
    live: Live, manner: Manner, voice: Callable[[float], float]
) -> None:
    path = live(12.0, manner=manner, voice=voice, seed=5)
    assert np.isfinite(path).all()
    lids = P.indices(["eyeSquintLeft", "eyeSquintRight"])
    assert np.all(path[:, lids] >= 0.0) and np.all(path <= P.high) and np.all(path >= P.low)
    slow = np.setdiff1d(np.arange(len(P)), [*P.region("lids"), *P.region("eyes")])
    assert np.all(np.abs(np.diff(path[:, slow], axis=0)).max(axis=0) < 0.5 * P.max_speed[slow] * 0.01)


def test_expressions_hold_back_blinks_and_glances_and_nothing_else(live: Live) -> None:
    free = live(60.0, rate_hz=10.0)
    lids = P.indices(["eyeBlinkLeft", "eyeBlinkRight"])
    half = live(60.0, rate_hz=10.0, blink_block=0.5)
    np.testing.assert_allclose(half[:, lids], 0.5 * free[:, lids])
    others = np.setdiff1d(np.arange(len(P)), [*P.region("lids"), *P.indices(["browDownLeft", "browDownRight",
                                              "cheekSquintLeft", "cheekSquintRight"])])  # fmt: skip
    np.testing.assert_array_equal(half[:, others], free[:, others])
    held = live(60.0, rate_hz=10.0, gaze_block=1.0)
    assert np.abs(gaze_of(held)).max() < 3.0 < np.abs(gaze_of(free)).max()
    np.testing.assert_array_equal(held[:, lids], free[:, lids])
    assert not live(60.0, rate_hz=10.0, blink_block=1.0)[:, lids].any()


def test_where_something_is_looked_at_eyes_stir_and_head_sways_and_no_more(settings: IdleSettings) -> None:
    life, stirs = IdleMotion(P, settings, 1), []
    life.liveliness = 0.5
    for i in range(1500):
        values = life.update(i * 0.01, looking=True)
        assert not values[P.region("eyes")].any()
        np.testing.assert_allclose(values[P.region("head")[:3]] * P.full_scale_rad[P.region("head")[:3]],
                                   life.head_rad, atol=0.02)  # fmt: skip
        stirs.append((life.eye_yaw_rad, life.eye_pitch_rad))
    most = 0.5 * (settings.eyes.micro_deg + settings.eyes.drift_deg)
    assert 0.1 < np.degrees(np.abs(stirs).max()) <= most


def test_it_goes_on_after_it_was_switched_off_and_after_a_long_pause(settings: IdleSettings) -> None:
    life = IdleMotion(P, settings, 1)
    life.liveliness = 1.0
    life.update(0.0, looking=False)
    life.liveliness = 0.0
    assert not life.update(1.0, looking=False).any() and not life.head_rad.any()
    assert (life.eye_yaw_rad, life.eye_pitch_rad) == (0.0, 0.0)
    life.liveliness = 1.0
    for start in (2.0, 1e6, 5.0):  # the clock may even go back
        path = np.array([life.update(start + i * 0.05, looking=False).copy() for i in range(1200)])
        assert 8 <= np.count_nonzero(np.diff((path[:, LID] > 0.2).astype(int)) > 0) <= 30
        assert not path[:15, LID].any()  # and not at once
        assert np.ptp(path[:, EYES[0]]) > 0.2


def test_what_expressions_hold_back_is_given_by_name(settings: IdleSettings) -> None:
    life = IdleMotion(P, settings)
    assert life.liveliness == 0.0 and not life.values.any()
    with pytest.raises(TypeError):
        life.update(0.0, False)  # type: ignore[misc]


def test_a_commanded_shift_of_the_gaze_often_brings_a_blink(settings: IdleSettings) -> None:
    def blinked(angle_rad: float, seed: int) -> bool:
        life = IdleMotion(P, settings, seed)
        life.liveliness = 1.0
        life.update(0.0, looking=True)
        life.shift(angle_rad, 0.01)
        return any(life.update(0.02 + i * 0.01, looking=True)[LID] > 0.3 for i in range(0, 15, 3))

    assert 0.2 < np.mean([blinked(0.5, seed) for seed in range(100)]) < 0.6
    assert not any(blinked(0.1, seed) for seed in range(30))


@pytest.mark.parametrize(
    ("head_s", "eye_s", "acceleration", "jerk", "lag_s"),
    [
        (0.25, 0.1, 4.0, 40.0, 0.2),  # 0.15 s slower, and 0.05 s of smoothing by the limit of jerk
        (0.1, 0.3, 4.0, 40.0, 0.0),  # a head is never ahead of the eyes
        (0.9, 0.1, 4.0, 40.0, 0.4),
    ],
)
def test_the_head_lags_the_eyes_by_how_much_slower_its_motion_limits_let_it_be(
    head_s: float, eye_s: float, acceleration: float, jerk: float, lag_s: float
) -> None:
    parameters: Any = SimpleNamespace(
        index=["headYaw", "leftEyeYaw"].index, response_s=[head_s, eye_s],
        max_acceleration=[acceleration, 1.0], max_jerk=[jerk, 1.0],
    )  # fmt: skip
    assert _lag_s(parameters) == pytest.approx(lag_s)
