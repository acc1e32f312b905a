"""Moves the head: its part of large gaze shifts, changes of posture, slow sway, breath and nods.

Angles are yaw, pitch and roll in rad. Yaw is positive to the left, pitch downwards, and roll with the subject's left
side up.
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass

import numpy as np

from controller.layers.idle.attention import Shift
from controller.layers.idle.draws import Steps, draw
from controller.layers.idle.settings import BreathSettings, HeadSettings, NodSettings, PostureSettings, TurnSettings
from controller.motion.motion import minimum_jerk

MEMORY_S = 0.5
"""How far in the past the head's angles can still be queried."""

_WAVES = 3  # for each axis
_GAIN_CHANGE_S = 0.8  # time in which the amplitude of sway changes, for instance when speech begins


class Turn:
    """The head's part of gaze shifts: it follows the eyes, later and more slowly."""

    def __init__(self, settings: TurnSettings) -> None:
        self._settings, self._steps = settings, Steps(2)

    def begin(self) -> None:
        """Look straight ahead."""
        self._steps.reset()

    def follow(self, shift: Shift) -> None:
        """Turn by the head's part of a shift: a fraction of what exceeds a comfortable eye angle."""
        turn, size = self._settings, math.hypot(shift.yaw_deg, shift.pitch_deg)
        beyond = max(0.0, 1.0 - turn.comfort_deg / size) if size > 0.0 else 0.0
        yaw_deg, pitch_deg = turn.share * shift.yaw_deg, turn.pitch_share * shift.pitch_deg
        goal = [math.radians(beyond * yaw_deg), math.radians(beyond * pitch_deg)]
        distance_deg = math.degrees(math.dist(goal, self._steps.goal))
        if distance_deg > 0.0:
            self._steps.move_to(goal, shift.time_s + turn.delay_s, turn.base_s + turn.per_deg_s * distance_deg)

    def at(self, now_s: float) -> tuple[float, float, float]:
        """Return the angles at ``now_s``."""
        yaw, pitch = self._steps.at(now_s)
        return yaw, pitch, 0.0

    def drop_finished(self, now_s: float) -> None:
        """Drop steps that ended before the times that can be queried."""
        self._steps.drop_finished(now_s - MEMORY_S)


class Posture:
    """The posture of the head: slightly turned, lowered and tilted; it changes from time to time."""

    def __init__(self, settings: PostureSettings, numbers: random.Random) -> None:
        self._settings, self._random, self._steps = settings, numbers, Steps(3)
        self._next_s = math.inf

    def begin(self, now_s: float) -> None:
        """Start upright."""
        self._steps.reset()
        self._next_s = now_s + draw(self._settings.interval_s, self._random) / 2

    def advance(self, now_s: float) -> None:
        """Begin the changes of posture that are due until ``now_s``."""
        posture, numbers = self._settings, self._random
        while self._next_s <= now_s:
            reach = (posture.yaw_deg, posture.pitch_deg, posture.roll_deg)
            goal = [math.radians(each) * min(max(numbers.gauss(0.0, 0.5), -1.0), 1.0) for each in reach]
            self._steps.move_to(goal, self._next_s, draw(posture.length_s, numbers))
            self._next_s += draw(posture.interval_s, numbers)
        self._steps.drop_finished(now_s - MEMORY_S)

    def at(self, now_s: float) -> tuple[float, float, float]:
        """Return the angles at ``now_s``."""
        yaw, pitch, roll = self._steps.at(now_s)
        return yaw, pitch, roll


class Sway:
    """Three incommensurable waves for each axis, and the breath. They depend only on time and on the gain.

    waves : (3, 3, 2) period (s) and phase (rad) of the waves of yaw, pitch and roll.
    """

    def __init__(self, head: HeadSettings, breath: BreathSettings, numbers: random.Random) -> None:
        self._breath, self._breath_rad = breath, math.radians(breath.pitch_deg)
        draws = [(numbers.uniform(*head.period_s), numbers.uniform(0.0, 2 * math.pi)) for _ in range(3 * _WAVES)]
        self.waves = np.array(draws).reshape(3, _WAVES, 2)
        self._speeds, self._phases = 2 * np.pi / self.waves[..., 0], self.waves[..., 1]
        self._reach = np.radians([head.yaw_deg, head.pitch_deg, head.roll_deg]) / _WAVES
        self._gain = Steps(1)

    def begin(self) -> None:
        """Start with the gain 1."""
        self._gain.reset()

    def set_gain(self, gain: float, now_s: float) -> None:
        """Change the amplitude of the sway to ``gain`` times that of the settings, from now on."""
        if abs(gain - 1.0 - self._gain.goal[0]) > 1e-9:
            self._gain.move_to([gain - 1.0], now_s, _GAIN_CHANGE_S)
        self._gain.drop_finished(now_s - MEMORY_S)

    def at(self, now_s: float) -> tuple[float, float, float]:
        """Return the angles at ``now_s``."""
        waves = np.sin(now_s * self._speeds + self._phases).sum(axis=1)
        yaw, pitch, roll = ((1.0 + self._gain.at(now_s)[0]) * self._reach * waves).tolist()
        return yaw, pitch - self._breath_rad * lung_volume(self._breath, now_s), roll


def lung_volume(breath: BreathSettings, now_s: float) -> float:
    """Return how full the lungs are, 0..1."""
    t = now_s % (breath.inhale_s + breath.hold_s + breath.exhale_s + breath.pause_s)
    if t < breath.inhale_s + breath.hold_s:
        return minimum_jerk(t / breath.inhale_s)
    return 1.0 - minimum_jerk((t - breath.inhale_s - breath.hold_s) / breath.exhale_s)


@dataclass(frozen=True)
class Nod:
    """A nod of several cycles down and up.

    depth_rad : of the first cycle. cycle_s : length of a cycle. fade : depth of a cycle relative to the previous one.
    """

    start_s: float
    depth_rad: float
    cycle_s: float
    cycles: int = 1
    fade: float = 1.0

    @property
    def end_s(self) -> float:
        """Time at which the nod ends."""
        return self.start_s + self.cycles * self.cycle_s

    def at(self, now_s: float) -> float:
        """Return the pitch (rad) at ``now_s``."""
        passed = (now_s - self.start_s) / self.cycle_s
        if not 0.0 < passed < self.cycles:
            return 0.0
        return self.depth_rad * self.fade ** int(passed) * (0.5 - 0.5 * math.cos(2 * math.pi * passed))


class Nods:
    """Spontaneous nods of a listener, and requested nods."""

    def __init__(self, settings: NodSettings, numbers: random.Random) -> None:
        self._settings, self._random = settings, numbers
        self.nods: list[Nod] = []
        self._next_s = math.inf

    def begin(self, now_s: float) -> None:
        """Start without nods."""
        self.nods = []
        self._next_s = now_s + draw(self._settings.interval_s, self._random)

    def advance(self, now_s: float, *, listening: bool) -> None:
        """Begin the nods that are due until ``now_s``; only a listener nods spontaneously."""
        nod, numbers = self._settings, self._random
        while self._next_s <= now_s:
            depth, cycle = math.radians(numbers.uniform(*nod.depth_deg)), numbers.uniform(*nod.cycle_s)
            new = Nod(self._next_s, depth, cycle, numbers.randint(1, nod.most_cycles), nod.fade)
            self._next_s = new.end_s + draw(nod.interval_s, numbers)
            if listening:
                self.nods.append(new)
        while self.nods and self.nods[0].end_s < now_s - MEMORY_S:
            self.nods.pop(0)

    def nod(self, now_s: float, depth_rad: float, cycle_s: float) -> None:
        """Nod once, at ``now_s``."""
        self.nods.append(Nod(now_s, depth_rad, cycle_s))

    def at(self, now_s: float) -> tuple[float, float, float]:
        """Return the angles at ``now_s``."""
        return 0.0, sum(nod.at(now_s) for nod in self.nods), 0.0
