"""Loops over control points, compiled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from surface.jit import kernel

Floats = NDArray[np.float64]


@kernel
def swing_jaw(
    rest: Floats, share: Floats, turn: Floats, shift: Floats, full_turn: Floats, full_shift: Floats,
    amount: float, undo: Floats, points: Floats,
) -> None:  # fmt: skip
    """Add to ``points (n, 3)`` each point's ``share`` of the jaw's motion from where it rests.

    ``undo (n,)`` takes back the difference between the arc and the straight way, for lips that mouthClose
    (a straight displacement) brings together.
    """
    for i in range(rest.shape[0]):
        if share[i] == 0.0:
            continue
        for r in range(3):
            arc = shift[r] - rest[i, r]
            line = full_shift[r] - amount * rest[i, r]
            for c in range(3):
                arc += turn[r, c] * rest[i, c]
                line += full_turn[r, c] * rest[i, c]
            points[i, r] += share[i] * (arc + undo[i] * (line - arc))


@kernel
def keep_on_eyeball(ids: NDArray[np.int64], eye: Floats, hold: Floats, radius: Floats, points: Floats) -> None:
    """Set the distance of points ``ids (k,)`` from ``eye (k, 3)`` to ``radius (k,)``, by the share ``hold (k,)``.

    Straight displacements would cut through the eyeball half-way; distances that are mixed like the
    displacements themselves do not.
    """
    for k in range(ids.shape[0]):
        i = ids[k]
        x, y, z = points[i, 0] - eye[k, 0], points[i, 1] - eye[k, 1], points[i, 2] - eye[k, 2]
        length = np.sqrt(x * x + y * y + z * z)
        if length < 1e-6:
            continue
        scale = hold[k] * (radius[k] / length - 1.0)
        points[i, 0] += scale * x
        points[i, 1] += scale * y
        points[i, 2] += scale * z


@kernel
def bend_neck(share: Floats, turn: Floats, pivot: Floats, points: Floats) -> None:
    """Rotate every point about ``pivot (3,)`` by its ``share (n,)`` of the rotation vector ``turn (3,)``.

    Rodrigues' formula with the angle scaled per point: the neck bends instead of shearing.
    """
    full = np.sqrt(turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
    if full == 0.0:
        return
    a, b, c = turn[0] / full, turn[1] / full, turn[2] / full
    for i in range(points.shape[0]):
        if share[i] == 0.0:
            continue
        sine, cosine = np.sin(share[i] * full), np.cos(share[i] * full)
        x, y, z = points[i, 0] - pivot[0], points[i, 1] - pivot[1], points[i, 2] - pivot[2]
        along = (a * x + b * y + c * z) * (1.0 - cosine)
        points[i, 0] = pivot[0] + x * cosine + (b * z - c * y) * sine + a * along
        points[i, 1] = pivot[1] + y * cosine + (c * x - a * z) * sine + b * along
        points[i, 2] = pivot[2] + z * cosine + (a * y - b * x) * sine + c * along


@kernel
def nearest_on_line(uv: Floats, line: Floats, closed: bool, distance: Floats, at: Floats) -> None:
    """For every point of ``uv (m, 2)``: its distance from the polyline ``line (k, 2)``, and how far along it the
    nearest place lies, in the line's points; written to ``distance (m,)`` and ``at (m,)``."""
    steps = line.shape[0] if closed else max(line.shape[0] - 1, 1)
    for i in range(uv.shape[0]):
        best = np.inf
        for k in range(steps):
            n = (k + 1) % line.shape[0]
            du, dv = line[n, 0] - line[k, 0], line[n, 1] - line[k, 1]
            pu, pv = uv[i, 0] - line[k, 0], uv[i, 1] - line[k, 1]
            t = min(max((pu * du + pv * dv) / max(du * du + dv * dv, 1e-18), 0.0), 1.0)
            pu, pv = pu - t * du, pv - t * dv
            d = pu * pu + pv * pv
            if d < best:
                best = d
                at[i] = k + t
        distance[i] = np.sqrt(best)
