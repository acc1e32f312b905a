"""Which process the operating system serves first: servos before the picture."""

from __future__ import annotations

import ctypes
import gc
import os
import sys

ORDINARY = "OMOTE_ORDINARY_PRIORITY"
"""Environment variable: set to anything, nobody asks for real-time scheduling."""
_REALTIME_PRIORITY = 10
_PR_SET_TIMERSLACK = 29
_SWITCH_S = 0.2e-3


def yield_to_servos() -> None:
    """Let this process give way: a late frame is seen less than a late servo target."""
    if hasattr(os, "nice"):
        os.nice(5)


def wake_promptly() -> None:
    """Let waits of the calling thread end when they should; Linux adds 50 us by default, to save power."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, ctypes.c_ulong(1))


def take_turns_quickly() -> None:
    """Let threads of this process wait for each other, and for the collection of garbage, as short as can be.

    Python lets one thread run for 5 ms before another gets its turn, and a full collection looks at all that was
    ever loaded: either is longer than a servo's tick may be late.
    """
    sys.setswitchinterval(_SWITCH_S)
    gc.collect()
    gc.freeze()


def take_priority() -> bool:
    """Ask for real-time scheduling and exact waits of the calling thread; False where the first is not allowed."""
    wake_promptly()
    if not hasattr(os, "sched_setscheduler") or os.environ.get(ORDINARY):
        return False
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_REALTIME_PRIORITY))
    except OSError:
        return False
    return True


def give_priority_back() -> None:
    """Ordinary scheduling of the calling thread again."""
    if hasattr(os, "sched_setscheduler"):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
