"""Measures a source: rate, jitter, loss and age of what it sends, on the clock of this machine."""

from __future__ import annotations

import math

_SHARE = 0.05  # of a new interval in the averages
_LONGEST_S = 1.0  # a longer interval is a pause and none of the rate's


class Meter:
    """Rate (frames/s), jitter (ms), frames lost by their numbers, and age (s) of the last frame of one source.

    Attributes
    ----------
    frames : how many came. lost : how many were missing between their numbers.
    """

    def __init__(self) -> None:
        self.frames = self.lost = 0
        self._last_s = -math.inf
        self._interval_s = self._deviation_s = 0.0
        self._sequence: int | None = None
        self._step = 0

    def note(self, now_s: float, sequence: int | None = None, skipped: int = 0) -> None:
        """A frame arrived; ``skipped`` older ones before it were not read."""
        interval_s = (now_s - self._last_s) / (1 + skipped)
        self._last_s = now_s
        self.frames += 1 + skipped
        if interval_s < _LONGEST_S:
            self._average(interval_s)
        if sequence is not None:
            self._count(sequence, skipped)

    def age_s(self, now_s: float) -> float | None:
        """How old the last frame is; None before the first."""
        return None if math.isinf(self._last_s) else max(0.0, now_s - self._last_s)

    def report(self, now_s: float) -> dict[str, object]:
        """Rounded figures for people."""
        age_s = self.age_s(now_s)
        silent = age_s is None or age_s > _LONGEST_S or self._interval_s <= 0.0
        return {
            "rate_hz": 0.0 if silent else round(1.0 / self._interval_s, 1),
            "jitter_ms": round(1e3 * self._deviation_s, 2),
            "lost": self.lost,
            "age_s": None if age_s is None else round(age_s, 3),
        }

    def _average(self, interval_s: float) -> None:
        share = _SHARE if self._interval_s > 0.0 else 1.0
        self._deviation_s += _SHARE * (abs(interval_s - self._interval_s) * (share < 1.0) - self._deviation_s)
        self._interval_s += share * (interval_s - self._interval_s)

    def _count(self, sequence: int, skipped: int) -> None:
        """Frames are missing where the number rises by more than it usually does; a fall begins anew."""
        before, self._sequence = self._sequence, sequence
        if before is None or sequence <= before:
            return
        step = sequence - before
        if skipped == 0:
            self._step = min(self._step, step) if self._step else step
        if self._step:
            self.lost += max(0, round(step / self._step) - 1 - skipped)
