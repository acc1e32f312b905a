"""Measures steal time: processor time that the host of a virtual machine used for other machines."""

from __future__ import annotations

import os
import time
from pathlib import Path

STAT = Path("/proc/stat")
_STEAL_FIELD = 8  # index in "cpu user nice system idle iowait irq softirq steal ...", proc(5)


class StealTime:
    """Measures the steal time since its creation."""

    def __init__(self) -> None:
        self._began, self._before_s = time.monotonic(), steal_time_s()

    def fraction(self) -> float | None:
        """Fraction of all processors' time since the creation, 0 to 1; None if the system does not report it."""
        now_s, passed_s = steal_time_s(), time.monotonic() - self._began
        if now_s is None or self._before_s is None or passed_s <= 0.0:
            return None
        return (now_s - self._before_s) / passed_s / (os.cpu_count() or 1)


def steal_time_s() -> float | None:
    """Steal time (s) since the start of the system, summed over its processors; None if it is not reported."""
    try:
        fields = STAT.read_text(encoding="ascii").split("\n", 1)[0].split()
        return int(fields[_STEAL_FIELD]) / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError):
        return None
