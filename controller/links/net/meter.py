"""Measures a source: rate, jitter, loss and age of what it sends, on the clock of this machine."""

from __future__ import annotations

import math

_SHARE = 0.05  # of a new interval in the averages
_LONGEST_S = 1.0  # a longer interval is a pause and none of the rate's
_LARGEST_STEP = 8
_MOST_LATE, _MOST_MISSING = 100, 3000
"""Frames by which one may come late, and that may be missing at once; beyond, the source restarted (RFC 3550, A.1)."""


class Numbers:
    """Counts the frames that are missing between the numbers that a source gives them.

    As RFC 3550, appendix A.3: those to be expected from the lowest to the highest number, less those that came, so that
    a frame which overtook another is not lost. Numbers may rise by more than one.
    """

    def __init__(self) -> None:
        self._before = self._came = 0
        self._first = self._highest = -1
        self._rises = [0] * _LARGEST_STEP

    def note(self, number: int, skipped: int = 0) -> None:
        """A frame came; ``skipped`` older ones before it were not read."""
        rise = number - self._highest
        if self._first < 0 or not -_MOST_LATE <= rise / self._step <= _MOST_MISSING:
            self._begin(number)
        elif rise > 0:
            if skipped == 0 and rise <= _LARGEST_STEP:
                self._rises[rise - 1] += 1
            self._highest = number
        self._first = min(self._first, number)
        self._came += 1 + skipped

    @property
    def lost(self) -> int:
        """How many are missing."""
        return self._before + self._missing()

    @property
    def _step(self) -> int:
        """By how much the number usually rises; the smaller of two that are as usual."""
        return 1 + self._rises.index(max(self._rises))

    def _missing(self) -> int:
        expected = round((self._highest - self._first) / self._step) + 1
        return max(0, expected - self._came) if self._came else 0

    def _begin(self, number: int) -> None:
        """The source restarted: at midnight, after the largest number, or as it was started."""
        self._before += self._missing()
        self._first = self._highest = number
        self._came = 0


class Meter:
    """Rate (frames/s), jitter (ms), frames lost by their numbers, and age (s) of the last frame of one source.

    Attributes
    ----------
    frames : how many came.
    """

    def __init__(self) -> None:
        self.frames = 0
        self._last_s = -math.inf
        self._interval_s = self._deviation_s = 0.0
        self._numbers = Numbers()

    def note(self, now_s: float, sequence: int | None = None, skipped: int = 0) -> None:
        """A frame arrived; ``skipped`` older ones before it were not read."""
        interval_s = (now_s - self._last_s) / (1 + skipped)
        self._last_s = now_s
        self.frames += 1 + skipped
        if interval_s < _LONGEST_S:
            self._average(interval_s)
        if sequence is not None:
            self._numbers.note(sequence, skipped)

    @property
    def lost(self) -> int:
        """How many were missing between their numbers."""
        return self._numbers.lost

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
