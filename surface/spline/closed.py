"""Closed (periodic) directions of a surface, such as around a neck: shifted copies of control points, wrapped samples.

A control point that reaches over one end acts at the other through copies of it, shifted by the period. Copies are
in blocks: copy b of point i has number ``b * n + i``, and block 0 are the points themselves.
"""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats

Interval = tuple[float, float] | None
MAX_PERIODS = 16  # that knots may reach over: each takes a copy of every point


def check_closed(closed: tuple[Interval, Interval]) -> tuple[Interval, Interval]:
    """Return the intervals as floats; ``ValueError`` where start is not below end."""
    out: list[Interval] = []
    for name, interval in zip(("closed_u", "closed_v"), closed, strict=True):
        if interval is None:
            out.append(None)
            continue
        try:
            start, end = map(float, interval)
        except (TypeError, ValueError):
            raise ValueError(f"{name}: needs (start, end), got {interval!r}") from None
        if not np.isfinite([start, end]).all() or not start < end:
            raise ValueError(f"{name}: needs finite start < end, got {interval}")
        out.append((start, end))
    return out[0], out[1]


def shifts_of(knots: tuple[Floats, Floats], closed: tuple[Interval, Interval]) -> Floats:
    """Return (b, 2): shifts in u and v of all copies that may reach the closed intervals, (0, 0) first."""
    along = []
    for name, rows, interval in zip(("closed_u", "closed_v"), knots, closed, strict=True):
        if interval is None:
            along.append([0.0])
            continue
        period = interval[1] - interval[0]
        reach = max(interval[1], float(rows[:, -1].max())) - min(interval[0], float(rows[:, 0].min()))
        if not reach <= MAX_PERIODS * period:
            raise ValueError(f"{name}: knots reach over {reach:g}, more than {MAX_PERIODS} periods of {period:g}")
        lowest = min(-1, int(np.floor((interval[0] - rows[:, -1].max()) / period)))
        highest = max(1, int(np.ceil((interval[1] - rows[:, 0].min()) / period)))
        along.append([0.0, *(k * period for k in range(lowest, highest + 1) if k)])
    return np.array([[u, v] for u in along[0] for v in along[1]])


def wrap(uv: Floats, closed: tuple[Interval, Interval]) -> Floats:
    """Return ``uv (m, 2)`` with closed directions brought into start <= x < end."""
    if closed == (None, None):
        return uv
    out = uv.copy()
    for k, interval in enumerate(closed):
        if interval is not None:
            start, end = interval
            beyond = (out[:, k] < start) | (out[:, k] >= end)
            wrapped = start + np.mod(out[beyond, k] - start, end - start)
            out[beyond, k] = np.where(wrapped >= end, start, wrapped)
    return out
