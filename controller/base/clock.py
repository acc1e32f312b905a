"""Ticks at a fixed rate on absolute deadlines, and collects statistics of measurements.

A missed deadline is skipped and counted; its tick is not repeated later.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np

_ALIGN_DIVISOR = 4
"""An aligned deadline moves by its error divided by this."""
_MAX_ALIGN_DIVISOR = 20
"""An aligned deadline moves at most by the period divided by this."""


class Samples:
    """The newest ``capacity`` measurements; older ones are overwritten."""

    def __init__(self, capacity: int = 65536) -> None:
        self._values = np.zeros(capacity)
        self._sum = 0.0
        self.count = 0
        self.maximum = 0.0

    def add(self, value: float) -> None:
        """Add one measurement."""
        self._values[self.count % len(self._values)] = value
        self.count += 1
        self._sum += value
        self.maximum = max(self.maximum, value)

    def summary(self) -> dict[str, float]:
        """Return mean, p50, p95, p99 and max, in the unit of the measurements; empty without measurements.

        Mean and max are of all measurements, percentiles of the newest ``capacity``.
        """
        if not self.count:
            return {}
        percentiles = np.percentile(self._values[: self.count], [50, 95, 99]).tolist()
        middle = dict(zip(("p50", "p95", "p99"), percentiles, strict=True))
        return {"mean": self._sum / self.count, **middle, "max": self.maximum}


class Clock:
    """Ticks at a fixed rate on absolute deadlines.

    Parameters
    ----------
    rate_hz : ticks per second.
    now_ns, sleep_s : the time source and the function that waits; replaced in tests.
    prompt : after a tick that took too long, tick again immediately and move the deadlines, as pictures need for a high
        rate; otherwise wait for the next deadline, as servos need for even steps.

    Attributes
    ----------
    jitter_ms : how much later than its deadline each tick began.
    skipped : deadlines that passed unused.
    step_s : time between the last two deadlines: how far motion advances in this tick, however late it began.
    """

    def __init__(
        self,
        rate_hz: float,
        *,
        now_ns: Callable[[], int] = time.monotonic_ns,
        sleep_s: Callable[[float], object] = time.sleep,
        prompt: bool = False,
    ) -> None:
        if not rate_hz > 0:
            raise ValueError(f"rate_hz must be positive, not {rate_hz}")
        self.period_ns = round(1e9 / rate_hz)
        self.jitter_ms = Samples()
        self.skipped = 0
        self.ticks = 0
        self.step_s = self.period_ns * 1e-9
        self._now_ns = now_ns
        self._sleep_s = sleep_s
        self._prompt = prompt
        self._started_ns = self._last_ns = self._deadline_ns = 0
        self._aim_ns: int | None = None

    @property
    def deadline_ns(self) -> int:
        """When the present tick was due, by the clock's time source; ``step_s`` is the time between two of these."""
        return self._deadline_ns

    def align(self, at_ns: int) -> None:
        """Shift the phase of the ticks towards ``at_ns`` plus whole periods.

        Each call moves only the next deadline, by a small step, so that steps stay even; call it at every tick.
        """
        self._aim_ns = at_ns

    def run(self, keep_going: Callable[[], bool]) -> Iterator[int]:
        """Yield the present time (ns) once per tick until ``keep_going()`` is false."""
        self._started_ns = self._last_ns = self._deadline_ns = self._now_ns()
        before_ns = self._deadline_ns - self.period_ns
        while keep_going():
            now = self._wait()
            self.ticks += 1
            self.step_s = self._step_s(before_ns)
            before_ns = self._deadline_ns
            yield now
            self._last_ns = self._now_ns()
            self._deadline_ns = self._align_deadline(self._next_deadline(self._deadline_ns))

    def _wait(self) -> int:
        """Wait for the next tick; return the present time (ns)."""
        now = self._now_ns()
        while now < self._deadline_ns:
            self._sleep_s((self._deadline_ns - now) / 1e9)
            now = self._now_ns()
        self.jitter_ms.add((now - self._deadline_ns) / 1e6)
        return now

    def _step_s(self, before_ns: int) -> float:
        return (self._deadline_ns - before_ns) * 1e-9

    def _next_deadline(self, deadline: int) -> int:
        if self._prompt:
            return max(deadline + self.period_ns, self._last_ns)
        missed = max(0, (self._last_ns - deadline) // self.period_ns)
        self.skipped += missed
        return deadline + (missed + 1) * self.period_ns

    def _align_deadline(self, deadline: int) -> int:
        """Move a deadline towards the phase that :meth:`align` was called with since the last one."""
        if self._aim_ns is None:
            return deadline
        half, limit = self.period_ns // 2, self.period_ns // _MAX_ALIGN_DIVISOR
        error = (self._aim_ns - deadline + half) % self.period_ns - half
        self._aim_ns = None
        return deadline + min(max(error // _ALIGN_DIVISOR, -limit), limit)

    def report(self) -> dict[str, object]:
        """Return the measured rate and the wanted one (Hz), ticks, skipped deadlines and jitter percentiles (ms)."""
        seconds = (self._last_ns - self._started_ns) / 1e9
        return {
            "rate_hz": self.ticks / seconds if seconds > 0 else 0.0,
            "wanted_hz": 1e9 / self.period_ns,
            "ticks": self.ticks,
            "skipped": self.skipped,
            "jitter_ms": self.jitter_ms.summary(),
        }
