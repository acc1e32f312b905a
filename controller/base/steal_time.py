"""Measures steal time: processor time that the host of a virtual machine gave to others."""

from __future__ import annotations

import os
import time
from pathlib import Path

STAT = Path("/proc/stat")
_STEAL = 8  # of "cpu user nice system idle iowait irq softirq steal ...", proc(5)


class StealTime:
    """Counts from its creation."""

    def __init__(self) -> None:
        self._began, self._before_s = time.monotonic(), steal_time_s()

    def share(self) -> float | None:
        """Share of all processors' time since then, 0 to 1; None where the system does not report it."""
        now_s, passed_s = steal_time_s(), time.monotonic() - self._began
        if now_s is None or self._before_s is None or passed_s <= 0.0:
            return None
        return (now_s - self._before_s) / passed_s / (os.cpu_count() or 1)


def steal_time_s() -> float | None:
    """Seconds since the start of the system, summed over its processors; None where it does not report it."""
    try:
        fields = STAT.read_text(encoding="ascii").split("\n", 1)[0].split()
        return int(fields[_STEAL]) / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError):
        return None
