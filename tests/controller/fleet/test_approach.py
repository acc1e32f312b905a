"""controller.fleet.approach: a face that moves all the time is met, within the limits, whatever the steps are."""

from __future__ import annotations

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.fleet.approach import Approach

DT = 0.01


def swaying(t: float, share: float = 0.3) -> np.ndarray:
    """A face whose every parameter accelerates all the time, by up to ``share`` of its limits."""
    middle, k = 0.5 * (P.low + P.high), np.arange(len(P))
    pace = 3.0 + 0.37 * k
    size = np.minimum(0.2 * (P.high - P.low), share * np.minimum(P.max_acceleration / pace**2, P.max_speed / pace))
    swayed: np.ndarray = middle + size * np.sin(pace * t + k)
    return swayed


def check_limits(rows: np.ndarray, steps: np.ndarray) -> None:
    """Rows (n, P), and the (n - 1,) s between them: within speed, acceleration and range, but for rounding."""
    speed = np.diff(rows, axis=0) / steps[:, None]
    assert (np.abs(speed) <= P.max_speed * 1.000001).all()
    between = 0.5 * (steps[1:] + steps[:-1])[:, None]
    over = np.abs(np.diff(speed, axis=0)) / between / P.max_acceleration
    assert over.max() < 1.000001, P.names[int(np.unravel_index(over.argmax(), over.shape)[1])]
    assert (rows >= P.low).all() and (rows <= P.high).all()


def play(
    steps: np.ndarray, face: np.ndarray, begin: np.ndarray, stay: bool, passed: np.ndarray | None = None
) -> np.ndarray:
    """What is shown, (n, P), on the way to ``face`` : (n, P), which moved for ``passed`` : (n,) s in each step."""
    way, rows = Approach(P), [begin]
    way.begin(begin)
    way.follow(face[0])
    for dt, row, passed_s in zip(steps, face, steps if passed is None else passed, strict=True):
        out = P.neutral()
        way.step(dt, row, out, stay=stay, passed_s=passed_s)
        rows.append(out)
    return np.array(rows)


def any_steps(rng: np.random.Generator, kind: int) -> np.ndarray:
    """(300,) s: of one length, of whole ticks, or from half a tick to the longest pause in any order."""
    even, whole = np.full(300, rng.uniform(0.005, 0.02)), 0.01 * rng.integers(1, 31, 300)
    return (even, whole, rng.choice([0.005, 0.01, rng.uniform(0.005, 0.3)], 300))[kind]


def test_a_face_that_never_rests_is_met_by_every_parameter_and_is_exactly_that_from_then_on() -> None:
    steps = np.full(150, DT)
    face = np.array([swaying(t) for t in np.cumsum(steps)])
    rows = play(steps, face, P.neutral(), stay=True)
    check_limits(rows, steps)
    same = rows[1:] == face
    assert same[-1].all()
    assert (np.diff(same.astype(int), axis=0) >= 0).all()  # what was met stays met
    met = same.all(axis=1).argmax() * DT
    assert met < 1.0


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("stay", [False, True])
def test_the_limits_hold_with_any_steps_and_faces(seed: int, stay: bool) -> None:
    """Faces leap from one end of the range to the other, the hardest place to brake at, and to anywhere between."""
    rng = np.random.default_rng(seed)
    steps, ends = any_steps(rng, seed % 3), rng.choice([P.low, P.high], (30, 1))[:, 0]
    leaps = np.where(rng.random((30, len(P))) < 0.5, ends, rng.uniform(P.low, P.high, (30, len(P))))
    rows = play(steps, np.repeat(leaps, 10, axis=0), rng.uniform(P.low, P.high), stay)
    check_limits(rows, steps)
    if stay:
        assert (rows[1:] == np.repeat(leaps, 10, axis=0)).any(axis=0).mean() > 0.5


def test_a_face_that_is_late_now_and_then_is_exactly_shown_again_soon() -> None:
    """What brakes for one tick is ahead of the face it had, by about the step that it lacks."""
    steps = np.full(200, DT)
    face = np.array([swaying(t) for t in np.cumsum(steps)])
    late = np.arange(100, 190, 10)
    seen, passed = face.copy(), steps.copy()
    seen[late], passed[late], passed[late + 1] = face[late - 1], 0.0, 2.0 * DT
    rows = play(steps, seen, face[0], stay=True, passed=passed)
    check_limits(rows, steps)
    assert not (rows[1:][late] == seen[late]).all()  # what is fast brakes
    assert (rows[1:][late + 6] == face[late + 6])[:-1].all()


def test_a_face_that_stands_is_met_without_passing_it() -> None:
    steps, face = np.full(100, DT), np.tile(0.5 * (P.low + P.high) + 0.2, (100, 1))
    rows = play(steps, face, P.low.copy(), stay=True)
    assert (np.diff(rows, axis=0) >= -1e-12).all() and (rows[-1] == face[-1]).all()


def test_after_a_pause_of_the_machine_a_face_does_not_leap() -> None:
    way, out = Approach(P), P.neutral()
    way.begin(P.neutral())
    way.step(10.0, P.high, out, stay=True)
    assert (np.abs(out) <= 0.1 * P.max_speed + 1e-12).all() and np.abs(out).max() > 0.0


def test_no_time_is_no_motion() -> None:
    way, out = Approach(P), P.neutral()
    way.begin(P.neutral())
    way.step(0.0, P.high, out, stay=True)
    assert (out == P.neutral()).all() and not way.met.any()


def test_in_no_time_only_what_the_face_shows_already_stays_met() -> None:
    way, out, jaw = Approach(P), P.neutral(), P.index("jawOpen")
    way.begin(P.neutral())
    way.step(DT, P.neutral(), out, stay=True)
    assert way.met.all()
    face = P.neutral()
    face[jaw] = 0.1
    way.step(0.0, face, out, stay=True)
    assert out[jaw] == 0.0 and not way.met[jaw] and way.met.sum() == len(P) - 1


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
def test_a_value_that_is_no_finite_number_moves_nothing_and_the_next_one_is_met(wrong: float) -> None:
    steps, face, jaw = np.full(100, DT), np.tile(0.5 * (P.low + P.high), (100, 1)), P.index("jawOpen")
    face[20:30, jaw] = wrong
    rows = play(steps, face, P.neutral(), stay=True)
    check_limits(rows, steps)
    assert (rows[-1] == face[-1]).all()
    way, out = Approach(P), P.neutral()
    way.begin(P.neutral())
    way.step(DT, face[20], out, stay=True)
    assert out[jaw] == 0.0 and not way.met[jaw]
