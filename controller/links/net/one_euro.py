"""Implements the One Euro filter, which smooths slow movements strongly and fast ones little.

Casiez, Roussel and Vogel, "1 Euro Filter: A Simple Speed-based Low-pass Filter for Noisy Input", CHI 2012, Algorithm 1.
"""

from __future__ import annotations

import math

import numpy as np

from controller.base.parameters import Floats

_DERIVATIVE_HZ = 1.0
"""Cut-off of the derivative, as in the paper."""


class OneEuro:
    """Filters vectors (P,) that arrive at irregular times.

    min_cutoff_hz : cut-off at rest; lower is smoother. beta : increase of the cut-off with speed (Hz per unit/s).
    """

    def __init__(self, size: int, min_cutoff_hz: float, beta: float) -> None:
        self._min_cutoff_hz, self._beta = min_cutoff_hz, beta
        self._value, self._speed = np.zeros(size), np.zeros(size)
        self._last_s: float | None = None

    def reset(self) -> None:
        """Start again: the next vector passes unchanged."""
        self._last_s = None

    def __call__(self, values: Floats, now_s: float) -> Floats:
        """Return the filtered vector; ``now_s`` must increase from call to call."""
        if self._last_s is None:
            self._value[:], self._speed[:], self._last_s = values, 0.0, now_s
            return values.copy()
        dt, self._last_s = max(now_s - self._last_s, 1e-4), now_s
        self._speed += _smoothing_factor(np.array(_DERIVATIVE_HZ), dt) * ((values - self._value) / dt - self._speed)
        cutoff_hz = self._min_cutoff_hz + self._beta * np.abs(self._speed)
        self._value += _smoothing_factor(cutoff_hz, dt) * (values - self._value)
        return self._value.copy()


def _smoothing_factor(cutoff_hz: Floats, dt: float) -> Floats:
    """Return the weight of a new value, by the cut-off and the time since the last value."""
    phase: Floats = 2.0 * math.pi * cutoff_hz * dt
    return phase / (phase + 1.0)
