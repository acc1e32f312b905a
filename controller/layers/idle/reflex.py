"""Pupils as the light changes: soon narrow in a brighter one, slowly wide in a darker one."""

from __future__ import annotations

import math

import numpy as np

from controller.base.parameters import Floats
from controller.layers.idle.settings import PupilSettings

_STAGES = 3
_LEAST = 1e-4  # nearer than this they are as wide as the light makes them


class LightReflex:
    """How wide pupils are, as three equal lags in a row after a latency follow the width that the light asks for.

    Stark and Sherman, "A servoanalytic study of consensual pupil reflex to light", J. Neurophysiol. 20 (1957); as they
    widen, with other lags: Korn and Bach, "A solid frame for the window on cognition", J. Vision 16 (2016). The lags
    are solved exactly, so the width at a time is the same for every frame rate.

    settings : latency and lags, s.
    """

    def __init__(self, settings: PupilSettings) -> None:
        self._settings = settings
        self._coming: list[tuple[float, float]] = []  # when pupils begin to follow another width, and that width
        self._asked = self._goal = self._last_s = math.nan
        self._off = np.zeros(_STAGES)  # by which the output of each lag is wider than the goal

    def follow(self, steady: float, now_s: float) -> float:
        """Return how wide they are at ``now_s``, where the light makes them ``steady`` wide from now on, in its unit.

        The first call finds them adapted. ``now_s`` (s) never decreases.
        """
        if math.isnan(self._asked):
            self._asked = self._goal = steady
            self._last_s = now_s
        if steady != self._asked:
            self._asked = steady
            self._coming.append((now_s + self._settings.latency_s, steady))
        while self._coming and self._coming[0][0] <= now_s:
            begins_s, goal = self._coming.pop(0)
            self._advance(begins_s)
            self._off += self._goal - goal
            self._goal = goal
        self._advance(now_s)
        return self._goal + float(self._off[-1])

    def _advance(self, until_s: float) -> None:
        """Let the lags pass on what they hold until ``until_s``."""
        lag_s = self._settings.narrow_s if self._off[-1] > 0.0 else self._settings.widen_s
        self._off = _passed_on(self._off, (until_s - self._last_s) / lag_s)
        self._last_s = until_s
        if np.abs(self._off).max() < _LEAST:
            self._off[:] = 0.0


def _passed_on(off: Floats, lags: float) -> Floats:
    """Return (k,): what equal first-order lags in a row, off by ``off (k,)``, are off by after a time, in lags."""
    powers = np.array([lags**i / math.factorial(i) for i in range(len(off))])
    passed: Floats = math.exp(-lags) * np.convolve(off, powers)[: len(off)]
    return passed
