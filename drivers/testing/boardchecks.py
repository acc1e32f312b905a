"""Assertions about a record of a board. Each raises AssertionError, which says which channel, when, and what.

Times in messages are seconds since the record began; values are those of the board's outputs, pulses in microseconds.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from drivers.testing.records import BoardRecord, outputs
from drivers.testing.servochecks import Limits


def beyond_limits(record: BoardRecord, limits: Limits) -> list[str]:
    """Targets beyond limits."""
    faults = []
    for write in record.writes:
        low, high = limits.get(write.id, (-math.inf, math.inf)) if isinstance(limits, Mapping) else limits or (0, 0)
        if write.value is not None and not low <= write.value <= high:
            at = f"{write.register} = {write.value:g} at {write.time_s:.3f} s"
            faults.append(f"channel {write.id} got {at}; its limits are {low:g} to {high:g}")
    return faults


def still_on(record: BoardRecord, now_s: float) -> list[str]:
    """Outputs that are on."""
    faults = []
    for output in outputs(record.board, now_s):
        if output.target is not None:
            wrote = [write.time_s for write in record.writes if write.id == output.id]
            since = f", since {wrote[-1]:.3f} s" if wrote else ""
            faults.append(f"channel {output.id} is still on with {output.key} = {output.target:g}{since}")
    return faults


def jumps(record: BoardRecord, most: float) -> list[str]:
    """Outputs that changed by more than ``most`` at once. Where a first pulse moves a servo is not known."""
    return [
        f"channel {write.id} went from {before:g} to {after:g} at once at {write.time_s:.3f} s"
        for write, before, after in record.steps
        if before is not None and after is not None and abs(after - before) > most
    ]
