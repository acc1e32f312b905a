"""Scheduling of threads and processes by the operating system: threads that drive servos run before the picture."""

from __future__ import annotations

import ctypes
import gc
import os
import platform
import struct
import sys

NO_REALTIME = "OMOTE_ORDINARY_PRIORITY"
"""Environment variable: where it is set, no thread requests real-time scheduling."""
_REALTIME_PRIORITY = 10
_NICE = 5
_PR_SET_TIMERSLACK = 29
_SWITCH_S = 0.2e-3
_TIME_SLICE_NS = 100_000
_ATTRIBUTES = struct.Struct("=IIQiIQQQ")
"""``struct sched_attr``: size, policy, flags, nice, priority, then runtime, deadline and period in ns."""
_SCHED_SETATTR = {"x86_64": 314, "aarch64": 274, "riscv64": 274, "armv7l": 380, "armv6l": 380, "i686": 351}
"""Number of the system call by machine; the C library has no function for it."""


def lower_process_priority() -> None:
    """Lower the priority of this process, once: a late frame is seen less than a late servo target."""
    if hasattr(os, "setpriority"):
        os.setpriority(os.PRIO_PROCESS, 0, max(_NICE, os.getpriority(os.PRIO_PROCESS, 0)))


def reduce_timer_slack() -> None:
    """Let waits of the calling thread end on time; by default Linux may delay them by 50 us to save power."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, ctypes.c_ulong(1))


def shorten_thread_switches() -> None:
    """Shorten how long threads of this process wait for each other and for garbage collection.

    By default Python switches threads every 5 ms, and a full collection visits all objects that were ever loaded;
    either takes longer than a servo's cycle may be late.
    """
    sys.setswitchinterval(_SWITCH_S)
    gc.collect()
    gc.freeze()


def request_realtime() -> bool:
    """Request real-time scheduling and exact waits for the calling thread; return whether it was granted.

    Where it is not, short time slices are requested instead.
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
    """Request short time slices for the calling thread; return False where the system has no such request.

    Linux 6.12 and later (EEVDF) serves a thread that wakes up before one in the middle of a longer slice, asked for by
    ``sched_setattr``; older ones ignore it.
    """
    number = _SCHED_SETATTR.get(platform.machine())
    if sys.platform != "linux" or number is None:
        return False
    nice = os.getpriority(os.PRIO_PROCESS, 0)
    request = _ATTRIBUTES.pack(_ATTRIBUTES.size, os.SCHED_OTHER, 0, nice, 0, _TIME_SLICE_NS, 0, 0)
    return bool(ctypes.CDLL(None).syscall(number, 0, request, 0) == 0)


def restore_priority() -> None:
    """Set ordinary scheduling of the calling thread again."""
    if hasattr(os, "sched_setscheduler"):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
