"""Which process the operating system serves first: servos before the picture."""

from __future__ import annotations

import ctypes
import gc
import os
import platform
import struct
import sys

NO_REALTIME = "OMOTE_ORDINARY_PRIORITY"
"""Environment variable: set to anything, nobody asks for real-time scheduling."""
_REALTIME_PRIORITY = 10
_PR_SET_TIMERSLACK = 29
_SWITCH_S = 0.2e-3
_TURN_NS = 100_000
_ATTRIBUTES = struct.Struct("=IIQiIQQQ")
"""``struct sched_attr``: size, policy, flags, nice, priority, then runtime, deadline and period in ns."""
_SCHED_SETATTR = {"x86_64": 314, "aarch64": 274, "riscv64": 274, "armv7l": 380, "armv6l": 380, "i686": 351}
"""Its number as a system call, by machine; the C library has no function for it."""


def lower_process_priority() -> None:
    """Let this process give way: a late frame is seen less than a late servo target."""
    if hasattr(os, "nice"):
        os.nice(5)


def reduce_timer_slack() -> None:
    """Let waits of the calling thread end when they should; Linux adds 50 us by default, to save power."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, ctypes.c_ulong(1))


def shorten_thread_switches() -> None:
    """Let threads of this process wait for each other, and for the collection of garbage, as short as can be.

    Python lets one thread run for 5 ms before another gets its turn, and a full collection looks at all that was
    ever loaded: either is longer than a servo's tick may be late.
    """
    sys.setswitchinterval(_SWITCH_S)
    gc.collect()
    gc.freeze()


def request_realtime() -> bool:
    """Ask for real-time scheduling and exact waits of the calling thread; False where the first is not allowed.

    Where it is not the thread asks for short turns instead, as everybody may.
    """
    reduce_timer_slack()
    if hasattr(os, "sched_setscheduler") and not os.environ.get(NO_REALTIME):
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_REALTIME_PRIORITY))
        except OSError:
            pass
        else:
            return True
    request_short_time_slice()
    return False


def request_short_time_slice() -> bool:
    """Let the calling thread run often and briefly, not seldom and long; False where the system has no such request.

    Linux 6.12 and later serves a thread that wakes up ahead of one in the middle of a longer turn (EEVDF, a slice asked
    for by ``sched_setattr``); older ones take no notice.
    """
    number = _SCHED_SETATTR.get(platform.machine())
    if sys.platform != "linux" or number is None:
        return False
    nice = os.getpriority(os.PRIO_PROCESS, 0)
    request = _ATTRIBUTES.pack(_ATTRIBUTES.size, os.SCHED_OTHER, 0, nice, 0, _TURN_NS, 0, 0)
    return bool(ctypes.CDLL(None).syscall(number, 0, request, 0) == 0)


def restore_priority() -> None:
    """Ordinary scheduling of the calling thread again."""
    if hasattr(os, "sched_setscheduler"):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
