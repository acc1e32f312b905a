"""Commands turned into parameters."""

from __future__ import annotations

import math
import threading

import numpy as np
import pytest

from controller.base.errors import ParameterError
from controller.base.parameters import PARAMETERS as P
from controller.layers.commands import CommandState
from controller.vocabulary.expression import Expression
from controller.vocabulary.vocabulary import Vocabulary

JAW, SMILE = P.index("jawOpen"), P.index("mouthSmileLeft")
STEP_NS = 10_000_000


class Face:
    """A command state with its own clock."""

    def __init__(self) -> None:
        self.state = CommandState(P)
        self.now = 10**9
        self.values = P.neutral()
        self.stamp = 0

    def run(self, seconds: float) -> np.ndarray:
        for _ in range(round(seconds * 100)):
            self.now += STEP_NS
            self.stamp = self.state.tick(self.now, 0.01, self.values)
        return self.values


@pytest.fixture
def face() -> Face:
    return Face()


def test_set_arrives_eased_and_stays(face: Face) -> None:
    face.state.set_parameters([JAW], [0.8], face.now)
    path = [float(face.run(0.01)[JAW]) for _ in range(100)]
    assert path[0] < 0.2 and path == sorted(path)
    assert face.run(60)[JAW] == pytest.approx(0.8, abs=1e-6)
    assert np.count_nonzero(face.values > 1e-9) == 1
    assert face.state.holder(JAW) == "manual"


def test_the_stamp_of_the_newest_command_comes_out_with_the_next_tick(face: Face) -> None:
    for _ in range(2):
        face.run(0.01)
        assert face.stamp == 0
    face.state.set_parameters([JAW], [0.8], face.now + 5)
    face.state.gaze(0.1, 0.0, face.now + 3)
    face.run(0.01)
    assert face.stamp == face.now - STEP_NS + 5


def test_release_returns_to_the_layer_below(face: Face) -> None:
    face.state.expression("happiness", 1.0, None, face.now)
    face.state.set_parameters([SMILE], [0.0], face.now)
    assert face.run(1.0)[SMILE] == pytest.approx(0.0, abs=1e-6)
    assert face.values[SMILE + 1] > 0.8
    face.state.release([SMILE], face.now)
    assert face.run(2.0)[SMILE] == pytest.approx(0.9, abs=1e-6)
    assert face.state.holder(SMILE) == "expression"


def test_expression_with_duration_returns(face: Face) -> None:
    face.state.expression("happiness", 0.5, 1.0, face.now)
    assert face.run(0.8)[SMILE] == pytest.approx(0.9 * 0.5**0.7, abs=1e-3)
    assert face.run(2.0)[SMILE] == pytest.approx(0.0, abs=1e-3)
    with pytest.raises(ParameterError):
        face.state.expression("nothing", 1.0, None, face.now)


def test_gaze_turns_eyes_and_head_and_off_returns(face: Face) -> None:
    face.state.gaze(math.radians(50), 0.0, face.now)
    values = face.run(3.0)
    head, eye = values[P.index("headYaw")] * 60, values[P.index("leftEyeYaw")] * 35
    assert head + eye == pytest.approx(50, abs=0.05) and head > 25
    assert face.state.status()["gaze"] == "50.0,0.0"
    face.state.gaze_off(face.now)
    assert abs(face.run(3.0)[P.index("headYaw")]) < 1e-3
    face.state.gaze_at(0.0, 0.0, 300.0, face.now)
    assert face.run(1.0)[P.index("leftEyeYaw")] < 0 < face.values[P.index("rightEyeYaw")]


def test_straight_ahead_has_no_sign(face: Face) -> None:
    face.state.gaze(-0.0, -0.0, face.now)
    assert face.state.status()["gaze"] == "0.0,0.0"


def test_neutral_releases_everything(face: Face) -> None:
    face.state.set_parameters(list(range(59)), [0.5] * 59, face.now)
    face.state.expression("anger", 1.0, None, face.now)
    face.state.gaze(0.5, 0.2, face.now)
    face.run(1.0)
    face.state.neutral(0.3, face.now)
    assert np.abs(face.run(3.0)).max() < 1e-3
    assert face.state.status() | {"ticks": 0} == {
        "expression": "neutral", "intensity": 1.0, "gaze": "off", "life": 0.0, "manner": "alone",
        "manual": 0, "capture": 0, "limited": 0, "ticks": 0, "layers": "expression", "failed": "none",
    }  # fmt: skip


def test_capture_goes_over_expression_and_under_manual_and_ends_with_silence(face: Face) -> None:
    face.state.expression("happiness", 1.0, None, face.now)
    mask = np.ones(59, dtype=bool)
    for _ in range(100):
        face.state.capture(np.full(59, 0.3), mask, face.now)
        face.run(0.01)
    assert face.values[SMILE] == pytest.approx(0.3, abs=1e-3)
    face.state.set_parameters([JAW], [0.9], face.now)
    assert face.run(0.5)[JAW] == pytest.approx(0.9, abs=1e-3)
    assert face.run(3.0)[SMILE] == pytest.approx(0.9, abs=1e-3)


def test_snapshot_is_what_the_last_tick_gave(face: Face) -> None:
    face.state.set_parameters([JAW], [0.8], face.now)
    face.run(0.05)
    out = P.neutral()
    face.state.snapshot(out)
    np.testing.assert_array_equal(out, face.values)


def test_what_is_not_finite_never_gets_through(face: Face) -> None:
    face.state.set_parameters([JAW], [0.5], face.now)
    face.run(1.0)
    face.state.set_parameters([JAW], [math.nan], face.now)
    with pytest.raises(ParameterError, match="finite"):
        face.state.capture(np.full(59, math.inf), np.ones(59, dtype=bool), face.now)
    for refused in (
        lambda: face.state.gaze(math.nan, 0.0, face.now),
        lambda: face.state.gaze_at(0.0, math.inf, 0.0, face.now),
        lambda: face.state.neutral(math.nan, face.now),
        lambda: face.state.live(math.nan, face.now),
        lambda: face.state.expression("happiness", math.inf, None, face.now),
        lambda: face.state.expression("happiness", 1.0, math.nan, face.now),
    ):
        with pytest.raises(ParameterError, match="finite"):
            refused()
    face.state.gaze(0.2, 0.1, face.now)
    values = face.run(1.0)
    assert np.isfinite(values).all() and values[JAW] == pytest.approx(0.5, abs=1e-6)


@pytest.mark.slow
def test_hostile_sources_in_many_threads_keep_every_limit() -> None:
    face = Face()
    stop = threading.Event()

    def hammer(seed: int) -> None:
        random = np.random.default_rng(seed)
        names = face.state.vocabulary.names
        while not stop.is_set():
            face.state.set_parameters(list(range(59)), list(random.normal(0, 5, 59)), face.now)
            face.state.expression(names[random.integers(len(names))], random.random(), None, face.now)
            face.state.gaze(random.normal(), random.normal(), face.now)
            face.state.capture(random.normal(0, 2, 59), random.random(59) < 0.5, face.now)
            face.state.release([int(random.integers(59))], face.now)
            face.state.neutral(random.random(), face.now)

    threads = [threading.Thread(target=hammer, args=(seed,), daemon=True) for seed in range(3)]
    for thread in threads:
        thread.start()
    path = np.array([face.run(0.01).copy() for _ in range(800)])
    stop.set()
    for thread in threads:
        thread.join(30)
    speed = np.diff(path, axis=0) / 0.01
    assert np.all(path >= P.low) and np.all(path <= P.high)
    assert np.all(np.abs(speed) <= P.max_speed * (1 + 1e-9))
    assert np.all(np.abs(np.diff(speed, axis=0)) / 0.01 <= P.max_acceleration * (1 + 1e-9) + 1e-9)


@pytest.mark.slow
def test_life_blinks_by_itself_and_stops(face: Face) -> None:
    face.state.live(1.0, face.now)
    lid = P.index("eyeBlinkLeft")
    closed = [face.run(0.01)[lid] for _ in range(3000)]
    assert 4 <= np.count_nonzero(np.diff(np.array(closed) > 0.5)) / 2 <= 16  # blinks in 30 s
    assert face.state.holder(P.index("headRoll")) == "expression"
    face.state.live(0.0, face.now)
    assert np.abs(face.run(3.0)).max() < 1e-6


def test_the_amount_of_life_stays_between_none_and_all(face: Face) -> None:
    for amount, kept in ((-1.0, 0.0), (0.25, 0.25), (2.0, 1.0)):
        face.state.live(amount, face.now)
        assert face.state.status()["life"] == kept


def test_a_manner_stays_until_another_is_chosen(face: Face) -> None:
    for manner, shown in (("listen", "listen"), (None, "listen"), ("speak", "speak"), ("auto", "alone")):
        face.state.live(1.0, face.now, manner)
        face.run(0.02)
        assert face.state.status()["manner"] == shown
    with pytest.raises(ParameterError, match="unknown manner 'dance'"):
        face.state.live(0.5, face.now, "dance")
    assert face.state.status()["life"] == 1.0  # what is refused changes nothing


def test_life_goes_along_with_speech_and_listens_after_it(face: Face) -> None:
    mask, mouth = np.zeros(59, dtype=bool), P.neutral()
    mask[JAW], mouth[JAW] = True, 0.4
    face.state.live(1.0, face.now)
    face.run(0.1)
    seen = [face.state.status()["manner"]]
    for i in range(400):
        if i < 100:
            face.state.write_layer("speech", mouth, mask, face.now)
        face.run(0.01)
        if face.state.status()["manner"] != seen[-1]:
            seen.append(face.state.status()["manner"])
    assert seen == ["alone", "speak", "listen"]
    face.state.expression("surprise", 1.0, None, face.now)  # an open mouth is no speech
    face.run(14.0)
    assert face.state.status()["manner"] == "alone"


def test_the_gaze_stays_on_its_target_while_the_head_is_limited(face: Face) -> None:
    """Through the motion limits, too: of what is shown, eyes and head add up to steady fixations."""
    face.state.live(1.0, face.now)
    rows = []
    for _ in range(3000):
        face.run(0.01)
        rows.append(face.values[P.indices(["headYaw", "leftEyeYaw"])] * (60.0, 35.0))
    yaw = np.array(rows)
    slip = np.abs(np.diff(yaw.sum(axis=1))) * 100
    assert np.mean(slip < 4.0) > 0.8 and np.ptp(yaw[:, 0]) > 6.0  # deg/s, deg


def test_life_gives_way_to_set(face: Face) -> None:
    face.state.live(1.0, face.now)
    face.state.set_parameters([0, 7], [0.0, 0.0], face.now)
    assert max(face.run(0.01)[0] for _ in range(1500)) == 0.0


@pytest.mark.slow
def test_life_stirs_around_a_gaze_without_leaving_it(face: Face) -> None:
    face.state.live(1.0, face.now)
    face.state.gaze(math.radians(30), 0.0, face.now)
    face.run(2.0)
    yaw = [face.run(0.01)[P.index("headYaw")] * 60 + face.values[P.index("leftEyeYaw")] * 35 for _ in range(1500)]
    assert abs(np.mean(yaw) - 30) < 0.3 and 0.05 < np.std(yaw) < 0.8


def test_the_same_seed_lives_the_same_life() -> None:
    def lived(seed: int) -> np.ndarray:
        state, out = CommandState(P, seed=seed), P.neutral()
        state.live(1.0, 0)
        return np.array([[*map(float, out)] for i in range(300) if state.tick(i * STEP_NS, 0.01, out) == 0])

    np.testing.assert_array_equal(lived(3), lived(3))
    assert np.abs(lived(3) - lived(4)).max() > 0.01


@pytest.mark.parametrize(("rule", "share"), [("keep", 1.0), ("blend", 0.5), ("block", 0.0)])
def test_an_expression_holds_speech_and_gaze_back(rule: str, share: float) -> None:
    plain, silent = Vocabulary.load(P), P.neutral()
    shown = Expression("stern", silent, mouth=rule, gaze=rule)
    state = CommandState(P, Vocabulary(P, {"neutral": plain["neutral"], "stern": shown}))
    now, values = 10**9, P.neutral()
    state.expression("stern", 0.5, None, now)
    state.gaze(0.8, 0.0, now)
    mouth, mask = P.neutral(), P.indices(["jawOpen"])
    mouth[JAW] = 0.8
    for _ in range(200):
        now += STEP_NS
        state.write_layer("speech", mouth, np.isin(np.arange(len(P)), mask), now)
        state.tick(now, 0.01, values)
    assert values[JAW] == pytest.approx(0.8 * share, abs=0.01)
    assert (values[P.index("headYaw")] > 0.05) == (share > 0.0)
    assert "speech" in state.mixer.active or share == 0.0
