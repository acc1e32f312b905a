"""The One Euro filter: smooth while little moves, quick while much does.

Casiez, Roussel and Vogel, "1 Euro Filter: A Simple Speed-based Low-pass Filter for Noisy Input", CHI 2012, Algorithm 1.
"""

from __future__ import annotations

import math

import numpy as np

from controller.base.parameters import Floats

_DERIVATIVE_HZ = 1.0
"""Cut-off of the derivative, as in the paper."""


class OneEuro:
    """Filters vectors (P,) that arrive at any times.

    min_cutoff_hz : cut-off at rest; lower is smoother. beta : how much it rises with speed (Hz for each unit/s).
    """

    def __init__(self, size: int, min_cutoff_hz: float, beta: float) -> None:
        self._min_cutoff_hz, self._beta = min_cutoff_hz, beta
        self._value, self._speed = np.zeros(size), np.zeros(size)
        self._last_s: float | None = None

    def reset(self) -> None:
        """Forget what came before: the next vector passes unchanged."""
        self._last_s = None

    def __call__(self, values: Floats, now_s: float) -> Floats:
        """The filtered vector; ``now_s`` rises."""
        if self._last_s is None:
            self._value[:], self._speed[:], self._last_s = values, 0.0, now_s
            return values.copy()
        dt, self._last_s = max(now_s - self._last_s, 1e-4), now_s
        self._speed += _share(np.array(_DERIVATIVE_HZ), dt) * ((values - self._value) / dt - self._speed)
        cutoff_hz = self._min_cutoff_hz + self._beta * np.abs(self._speed)
        self._value += _share(cutoff_hz, dt) * (values - self._value)
        return self._value.copy()


def _share(cutoff_hz: Floats, dt: float) -> Floats:
    """How much of a new value counts, by the cut-off and the time since the last one."""
    turn: Floats = 2.0 * math.pi * cutoff_hz * dt
    return turn / (turn + 1.0)
