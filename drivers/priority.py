"""Which process the operating system serves first: servos before the picture."""

from __future__ import annotations

import os

_REALTIME_PRIORITY = 10


def yield_to_servos() -> None:
    """Let this process give way: a late frame is seen less than a late servo target."""
    if hasattr(os, "nice"):
        os.nice(5)


def take_priority() -> bool:
    """Ask for real-time scheduling of the calling thread; False where that is not allowed (most users)."""
    if not hasattr(os, "sched_setscheduler"):
        return False
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_REALTIME_PRIORITY))
    except OSError:
        return False
    return True
