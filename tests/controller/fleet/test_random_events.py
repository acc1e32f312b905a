"""A head keeps the limits of speed and acceleration in any sequence of events and ticks, which the test itself steps.

Speeds and accelerations are differences of what was shown, divided by the lengths of the ticks; nothing here knows how
the limits are kept.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.fleet.follower import Follower
from controller.fleet.lease import Token
from controller.fleet.payload import Header
from controller.layers.commands import CommandState

MS = 1_000_000
NAMES = ("happiness", "anger", "surprise", "sadness")


class Ticks:
    """Ticks every 10 ms, of which some come 5 to 300 ms late; then those that were missed are left out.

    uneven : the ticks are moved by up to 0.5 ms, and the late ones by any time; else by whole periods.
    """

    def __init__(self, rng: np.random.Generator, *, uneven: bool) -> None:
        self._rng, self._uneven = rng, uneven

    def step_ns(self) -> int:
        """Length of the next one."""
        rng = self._rng
        if rng.random() < 0.06:
            late = int(rng.integers(5, 300)) * MS
            return late if self._uneven else max(late // (10 * MS), 1) * 10 * MS
        return 10 * MS + (int(rng.integers(-MS // 2, MS // 2)) if self._uneven else 0)


@dataclass
class Conductor:
    """Sends faces: of real layers, whose expression changes now and then, or any that jump.

    jumps : the face is anywhere in its range, and somewhere else after some ticks, without regard for limits.
    """

    token: Token
    rng: np.random.Generator
    ticks: Ticks
    jumps: bool
    time_ns: int
    sequence: int = 0
    state: CommandState = field(default_factory=lambda: CommandState(P, seed=1))
    face: np.ndarray = field(default_factory=P.neutral)

    def __post_init__(self) -> None:
        self.state.live(1.0, 0)
        self.step_ns = self.ticks.step_ns()

    def until(self, now_ns: int) -> list[tuple[Header, np.ndarray]]:
        """What it sends until then."""
        found = []
        while self.time_ns + self.step_ns <= now_ns:
            self.time_ns, self.sequence = self.time_ns + self.step_ns, self.sequence + 1
            found.append((Header(self.token, self.sequence, self.time_ns), self._next(self.step_ns * 1e-9)))
            self.step_ns = self.ticks.step_ns()
        return found

    def _next(self, step_s: float) -> np.ndarray:
        if self.jumps:
            if self.rng.random() < 0.1:
                self.face = self.rng.uniform(P.low, P.high)
            return self.face.copy()
        if self.rng.random() < 0.02:
            self.state.expression(NAMES[self.rng.integers(4)], 1.0, None, self.time_ns)
        self.state.tick(self.time_ns, step_s, self.face)
        return self.face.copy()


@dataclass
class Shown:
    """What a head showed: (n, P) values, (n,) lengths of ticks in s, and (n,) time (s) and number of who conducted."""

    rows: list[np.ndarray] = field(default_factory=list)
    steps: list[float] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    whose: list[int] = field(default_factory=list)
    exact: list[bool] = field(default_factory=list)

    def greatest(self, beside_s: float) -> tuple[float, float]:
        """Greatest speed and acceleration, by their limits.

        A step is as long as the time between the two faces of the conductor that were shown, where that differs by
        no more than ``beside_s`` from one's own.
        """
        own, theirs, whose = np.array(self.steps[1:]), np.diff(self.times), np.array(self.whose)
        follows = (whose[1:] == whose[:-1]) & (whose[1:] > 0) & (theirs > 0.0) & (np.abs(theirs - own) <= beside_s)
        length = np.where(follows, theirs, own)[:, None]
        speed = np.diff(np.array(self.rows), axis=0) / length
        change = np.diff(speed, axis=0) / (0.5 * (length[1:] + length[:-1]))
        return float((np.abs(speed) / P.max_speed).max()), float((np.abs(change) / P.max_acceleration).max())


def play(seed: int, *, uneven: bool, delay_ms: float, jumps: bool, seconds: float = 12.0) -> Shown:
    """A head whose conductors are lost, come back and are replaced at random."""
    rng = np.random.default_rng(seed)
    follower = Follower(P, patience_s=0.4, delay_ns=round(delay_ms * MS))
    own, mine, shown = CommandState(P, seed=99), P.neutral(), Shown()
    own.live(1.0, 0)
    ticks, now_ns, fence, conductor = Ticks(rng, uneven=uneven), 10**10, 0, None
    event_ns, away_ns = now_ns, 0
    while now_ns < 10**10 + seconds * 1e9:
        step = ticks.step_ns()
        now_ns += step
        if now_ns >= event_ns:
            event_ns = now_ns + int(rng.uniform(0.05, 2.5) * 1e9)
            what = rng.integers(3)
            if what == 0 or conductor is None:  # another one, or the first
                fence += 1
                conductor = Conductor(Token(fence, 5), rng, Ticks(rng, uneven=uneven), jumps, now_ns)
            elif what == 1:  # the conductor is silent: for a moment, or until another one comes
                away_ns = now_ns + int(rng.choice([0.1, 0.3, 10.0]) * 1e9)
            else:
                away_ns = 0
        if conductor is not None:
            sent = conductor.until(now_ns)
            for header, values in sent if now_ns >= away_ns else []:
                if rng.random() > 0.03:
                    follower.take(header, values)
        own.tick(now_ns, min(step * 1e-9, 0.1), mine)
        out = P.neutral()
        follower.step(now_ns, step * 1e-9, mine, out)
        header = follower.header if follower.conducted else None
        shown.rows.append(out)
        shown.steps.append(step * 1e-9)
        shown.times.append(0.0 if header is None else header.time_ns * 1e-9)
        shown.whose.append(0 if header is None else header.token.fence)
        shown.exact.append(follower.exact and follower.conducted)
    return shown


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("delay_ms", [0.0, 80.0])
@pytest.mark.parametrize("jumps", [False, True])
@pytest.mark.parametrize("uneven", [False, True])
def test_no_sequence_of_events_passes_a_limit(uneven: bool, jumps: bool, delay_ms: float, seed: int) -> None:
    """With ticks of whole periods by the head's own time alone; with uneven ones as far as it lies beside that."""
    shown = play(seed, uneven=uneven, delay_ms=delay_ms, jumps=jumps)
    speed, acceleration = shown.greatest(5e-3 if uneven else 0.0)
    assert 0.5 < speed < 1.000001 and 0.9 < acceleration < 1.000001  # it moves, and as fast as it may
    rows = np.array(shown.rows)
    assert (rows >= P.low).all() and (rows <= P.high).all()
    assert len(set(shown.whose)) > 2 and 0 in shown.whose
    assert np.mean(shown.exact) > (0.0 if jumps else 0.3)
