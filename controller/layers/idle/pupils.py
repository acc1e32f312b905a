"""Pupils that are never still: slow and fast waves, and a part that goes with the breath; the same for both eyes."""

from __future__ import annotations

import math
import random

import numpy as np

from controller.base.mailboxes import REST, Life
from controller.layers.idle.head import lung_volume
from controller.layers.idle.settings import BreathSettings, PupilSettings

_WAVES = 3  # of each kind
_FASTEST = 12.0, 0.6  # mm and shares a second: quicker than any breath or wave of the shipped settings
_MAX_STEP_S = 0.1


class Pupils:
    """How much wider pupils are than the light makes them, as a function of time alone."""

    def __init__(self, settings: PupilSettings, breath: BreathSettings, numbers: random.Random) -> None:
        self._breath, self._breath_share = breath, settings.breath
        hz, reach = (settings.slow_hz, settings.fast_hz), (settings.slow, settings.fast)
        waves = [
            (math.exp(numbers.uniform(*map(math.log, band))), numbers.uniform(0.0, 2 * math.pi), most / _WAVES)
            for band, most in zip(hz, reach, strict=True)
            for _ in range(_WAVES)
        ]
        self._hz, self._phases, self._reach = np.array(waves).T

    def at(self, now_s: float) -> float:
        """Return the share by which they are wider at ``now_s``; below 0 narrower."""
        waves = np.sin(2 * np.pi * self._hz * now_s + self._phases)
        breath = self._breath_share * (lung_volume(self._breath, now_s) - 0.5)
        return float(waves @ self._reach) + breath


class Follower:
    """Breath and pupils as pictures show them: neither jumps where idle motion begins, ends or fails.

    now : what is shown; at rest until :meth:`follow` is called.
    """

    def __init__(self) -> None:
        self.now: Life = REST
        self._last_s = math.inf  # the first step has no length

    def follow(self, wanted: Life, now_s: float) -> None:
        """Go towards ``wanted`` until ``now_s``, where idle motion is if it did not jump."""
        step_s, self._last_s = min(max(now_s - self._last_s, 0.0), _MAX_STEP_S), now_s
        if wanted != self.now:
            rise, pupil = (
                now + min(max(to - now, -fastest * step_s), fastest * step_s)
                for to, now, fastest in zip(wanted, self.now, _FASTEST, strict=True)
            )
            self.now = rise, pupil
