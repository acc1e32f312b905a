"""Measures the rate, jitter, loss and age of the frames of a source, on the clock of this machine."""

from __future__ import annotations

import math

_NEW_WEIGHT = 0.05  # weight of a new interval in the averages
_MAX_INTERVAL_S = 1.0  # a longer interval is a pause and does not count for the rate
_MAX_STEP = 8
_MAX_LATE, _MAX_MISSING = 100, 3000
"""Limits of late and of missing frames; beyond them, the source has restarted (RFC 3550, A.1)."""


class SequenceCounter:
    """Counts the frames that are missing by their sequence numbers.

    As in RFC 3550, appendix A.3, it is the number of frames expected from the lowest to the highest sequence number,
    minus the number of those that came, so that reordered frames do not count as lost. The number may rise by more than
    one per frame.
    """

    def __init__(self) -> None:
        self._before = self._came = 0
        self._first = self._highest = -1
        self._rises = [0] * _MAX_STEP

    def note(self, number: int, skipped: int = 0) -> None:
        """Count a frame that came; ``skipped`` : number of older frames before it that were skipped."""
        rise = number - self._highest
        if self._first < 0 or not -_MAX_LATE <= rise / self._step <= _MAX_MISSING:
            self._begin(number)
        elif rise > 0:
            if skipped == 0 and rise <= _MAX_STEP:
                self._rises[rise - 1] += 1
            self._highest = number
        self._first = min(self._first, number)
        self._came += 1 + skipped

    @property
    def lost(self) -> int:
        """Number of missing frames."""
        return self._before + self._missing()

    @property
    def _step(self) -> int:
        """The most frequent rise of the number from frame to frame; of equally frequent ones the smallest."""
        return 1 + self._rises.index(max(self._rises))

    def _missing(self) -> int:
        expected = round((self._highest - self._first) / self._step) + 1
        return max(0, expected - self._came) if self._came else 0

    def _begin(self, number: int) -> None:
        """Start again after a jump of the numbers, for instance when the source restarts or its numbers wrap round."""
        self._before += self._missing()
        self._first = self._highest = number
        self._came = 0


class Meter:
    """Rate (frames/s), jitter (ms), frames lost by their numbers, and age (s) of the last frame of one source.

    Attributes
    ----------
    frames : number of frames that came.
    """

    def __init__(self) -> None:
        self.frames = 0
        self._last_s = -math.inf
        self._interval_s = self._deviation_s = 0.0
        self._numbers = SequenceCounter()

    def note(self, now_s: float, sequence: int | None = None, skipped: int = 0) -> None:
        """Count a frame that arrived; ``skipped`` : number of older frames before it that were skipped."""
        interval_s = (now_s - self._last_s) / (1 + skipped)
        self._last_s = now_s
        self.frames += 1 + skipped
        if interval_s < _MAX_INTERVAL_S:
            self._average(interval_s)
        if sequence is not None:
            self._numbers.note(sequence, skipped)

    @property
    def lost(self) -> int:
        """Number of missing frames, by their sequence numbers."""
        return self._numbers.lost

    def age_s(self, now_s: float) -> float | None:
        """Return the age of the last frame (s); None before the first."""
        return None if math.isinf(self._last_s) else max(0.0, now_s - self._last_s)

    def report(self, now_s: float) -> dict[str, object]:
        """Return rounded figures for people."""
        age_s = self.age_s(now_s)
        silent = age_s is None or age_s > _MAX_INTERVAL_S or self._interval_s <= 0.0
        return {
            "rate_hz": 0.0 if silent else round(1.0 / self._interval_s, 1),
            "jitter_ms": round(1e3 * self._deviation_s, 2),
            "lost": self.lost,
            "age_s": None if age_s is None else round(age_s, 3),
        }

    def _average(self, interval_s: float) -> None:
        weight = _NEW_WEIGHT if self._interval_s > 0.0 else 1.0
        self._deviation_s += _NEW_WEIGHT * (abs(interval_s - self._interval_s) * (weight < 1.0) - self._deviation_s)
        self._interval_s += weight * (interval_s - self._interval_s)
