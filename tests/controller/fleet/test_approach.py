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
    """Rows (n, P), and the (n - 1,) s between them: within speed, acceleration and range."""
    speed = np.diff(rows, axis=0) / steps[:, None]
    assert (np.abs(speed) <= P.max_speed * 1.0001).all()
    between = 0.5 * (steps[1:] + steps[:-1])[:, None]
    over = np.abs(np.diff(speed, axis=0)) / between / P.max_acceleration
    assert over.max() < 1.001, P.names[int(np.unravel_index(over.argmax(), over.shape)[1])]
    assert (rows >= P.low).all() and (rows <= P.high).all()


def play(steps: np.ndarray, face: np.ndarray, begin: np.ndarray, speed: np.ndarray, stay: bool) -> np.ndarray:
    """What is shown, (n, P), on the way to ``face`` : (n, P)."""
    way, rows = Approach(P), [begin - speed * steps[0], begin]
    way.begin(begin, speed, steps[0], face[0])
    for dt, row in zip(steps, face, strict=True):
        out = P.neutral()
        way.step(dt, row, out, stay=stay)
        rows.append(out)
    return np.array(rows)


def test_a_face_that_never_rests_is_met_by_every_parameter_and_is_exactly_that_from_then_on() -> None:
    steps = np.full(150, DT)
    face = np.array([swaying(t) for t in np.cumsum(steps)])
    rows = play(steps, face, P.neutral(), np.zeros(len(P)), stay=True)
    check_limits(rows, np.full(len(rows) - 1, DT))
    same = rows[2:] == face
    assert same[-1].all()
    assert (np.diff(same.astype(int), axis=0) >= 0).all()  # what was met stays met
    met = same.all(axis=1).argmax() * DT
    assert met < 1.0


@pytest.mark.parametrize("seed", range(8))
def test_the_limits_hold_with_any_steps_faces_and_speeds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    skipping = 0.01 * rng.integers(1, 4, 200)
    steps = np.full(200, rng.uniform(0.005, 0.02)) if seed % 2 else skipping
    jumps = np.repeat(rng.uniform(P.low, P.high, (10, len(P))), 20, axis=0)
    begin = rng.uniform(P.low, P.high)
    room = np.minimum(begin - P.low, P.high - begin)
    speed = rng.uniform(-1.0, 1.0, len(P)) * np.minimum(P.max_speed, 0.8 * np.sqrt(2.0 * P.max_acceleration * room))
    speed = np.where(room > np.abs(speed) * 0.05, speed, 0.0)
    rows = play(steps, jumps, begin, speed, stay=False)
    check_limits(rows, np.concatenate([steps[:1], steps]))


def test_a_face_that_stands_is_met_without_passing_it() -> None:
    steps, face = np.full(100, DT), np.tile(0.5 * (P.low + P.high) + 0.2, (100, 1))
    rows = play(steps, face, P.low.copy(), np.zeros(len(P)), stay=True)
    assert (np.diff(rows[1:], axis=0) >= -1e-12).all() and (rows[-1] == face[-1]).all()


def test_no_time_is_no_motion() -> None:
    way, out = Approach(P), P.neutral()
    way.begin(P.neutral(), np.zeros(len(P)), DT, P.neutral())
    way.step(0.0, P.high, out, stay=True)
    assert (out == P.neutral()).all() and not way.met.any()
