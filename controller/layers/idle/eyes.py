"""Moves the eyes: saccades on the main sequence to the targets of the gaze, with micro-saccades and drift."""

from __future__ import annotations

import math
import random

from controller.layers.idle.attention import Shift
from controller.layers.idle.draws import Steps, draw
from controller.layers.idle.settings import EyeSettings

_DRIFT_PERIODS_S = ((2.3, 6.1), (3.1, 7.7))


class Eyes:
    """The direction of the gaze in space, and fixational movements around it."""

    def __init__(self, settings: EyeSettings, numbers: random.Random) -> None:
        self._settings, self._random = settings, numbers
        self._gaze, self._micro = Steps(2), Steps(2)
        self._next_s = math.inf
        self._phases = [[numbers.uniform(0.0, 2 * math.pi) for _ in pair] for pair in _DRIFT_PERIODS_S]
        self._speeds = [[2 * math.pi / period for period in pair] for pair in _DRIFT_PERIODS_S]
        self._drift_rad, self._max_micro_rad = math.radians(settings.drift_deg) / 2, math.radians(settings.micro_deg)

    def begin(self, now_s: float) -> None:
        """Look straight ahead."""
        self._gaze.reset()
        self._micro.reset()
        self._next_s = now_s + draw(self._settings.micro_interval_s, self._random)

    def look(self, shift: Shift) -> float:
        """Begin a saccade and return its size (rad)."""
        before, goal = self._gaze.goal, [math.radians(shift.yaw_deg), math.radians(shift.pitch_deg)]
        size = math.dist(before, goal)
        self._gaze.move_to(goal, shift.time_s, self._length_s(size))
        return size

    def advance(self, now_s: float) -> None:
        """Begin the micro-saccades that are due until ``now_s``."""
        while self._next_s <= now_s:
            offset = [math.radians(self._random.gauss(0.0, self._settings.micro_deg / 2)) for _ in range(2)]
            offset = [min(max(each, -self._max_micro_rad), self._max_micro_rad) for each in offset]
            self._micro.move_to(offset, self._next_s, self._length_s(math.dist(self._micro.goal, offset)))
            self._next_s += draw(self._settings.micro_interval_s, self._random)
        self._gaze.drop_finished(now_s)
        self._micro.drop_finished(now_s)

    def direction(self, now_s: float) -> list[float]:
        """Return the yaw and pitch (rad) of the gaze, without fixational movements."""
        return self._gaze.at(now_s)

    def fixational_offset(self, now_s: float) -> list[float]:
        """Return the yaw and pitch (rad) of micro-saccades and drift."""
        yaw, pitch = self._micro.at(now_s)
        return [yaw + self._drift(0, now_s), pitch + self._drift(1, now_s)]

    def _drift(self, axis: int, now_s: float) -> float:
        (first, second), (first_phase, second_phase) = self._speeds[axis], self._phases[axis]
        return self._drift_rad * (math.sin(first * now_s + first_phase) + math.sin(second * now_s + second_phase))

    def _length_s(self, size_rad: float) -> float:
        """Return the duration of a saccade (main sequence: Bahill, Clark and Stark 1975)."""
        return self._settings.base_s + self._settings.per_deg_s * math.degrees(size_rad)
