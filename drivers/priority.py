"""Which process the operating system serves first: servos before the picture."""

from __future__ import annotations

import ctypes
import os
import sys

_REALTIME_PRIORITY = 10
_PR_SET_TIMERSLACK = 29


def yield_to_servos() -> None:
    """Let this process give way: a late frame is seen less than a late servo target."""
    if hasattr(os, "nice"):
        os.nice(5)


def wake_promptly() -> None:
    """Let waits of the calling thread end when they should; Linux adds 50 us by default, to save power."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, ctypes.c_ulong(1))


def take_priority() -> bool:
    """Ask for real-time scheduling and exact waits of the calling thread; False where the first is not allowed."""
    wake_promptly()
    if not hasattr(os, "sched_setscheduler"):
        return False
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_REALTIME_PRIORITY))
    except OSError:
        return False
    return True
