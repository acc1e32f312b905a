"""Compiled loops of contacts: sample an opening, find overlap and heights above an eyeball, move control points."""

# mypy: disable-error-code="call-arg, var-annotated"
from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats, Floats32, Ints
from surface.base.jit import kernel
from surface.spline.lanes import fma, load, store3, zero

# The cornea protrudes from the eyeball: its sphere's centre and radius, in eyeball radii, as
# surface.fit.points.eyeball has it
CORNEA_AT, CORNEA_RADIUS = 0.4447, 0.65


@kernel
def place_samples(
    start: Ints, ids: Ints, share: Floats32, points: Floats, eye: Floats, radius: float,
    room: Floats32, out: Floats,
) -> None:  # fmt: skip
    """Samples ``out (s, 3)`` of a surface as (x, height, depth), from control points ``points (n, 3)``.

    Eight samples at a time: those of tile t are the sums of eight ``share`` each times the points ``ids`` between
    ``start[t]`` and ``start[t + 1]``; ``room (24,)`` is scratch space. Height and depth are y and z, or, with a
    ``radius`` > 0, the arc above the eyeball's middle and the distance from it.
    """
    for tile in range(len(start) - 1):
        x, y, z = zero(), zero(), zero()
        for k in range(start[tile], start[tile + 1]):
            i, w = ids[k], load(share, 8 * k)
            x = fma(w, np.float32(points[i, 0] - eye[0]), x)
            y = fma(w, np.float32(points[i, 1] - eye[1]), y)
            z = fma(w, np.float32(points[i, 2] - eye[2]), z)
        store3(room, 0, x, y, z)
        for s in range(8 * tile, min(8 * tile + 8, len(out))):
            at = 3 * (s - 8 * tile)
            a, b, c = room[at], room[at + 1], room[at + 2]
            out[s, 0] = a
            out[s, 1] = radius * np.arctan2(b, c) if radius > 0.0 else b
            out[s, 2] = np.sqrt(a * a + b * b + c * c) if radius > 0.0 else c


@kernel
def overlap_at(height: float, depth: float, heights: Floats, depths: Floats, sign: float) -> float:
    """How far a profile's line reaches beyond ``height`` at ``depth``, towards ``sign``; -1e9 where it has none."""
    worst = -1e9
    for j in range(len(heights) - 1):
        a, b = depths[j], depths[j + 1]
        if (a - depth) * (b - depth) > 0.0 or a == b:
            continue
        t = (depth - a) / (b - a)
        worst = max(worst, sign * (heights[j] + t * (heights[j + 1] - heights[j]) - height))
    return worst


@kernel
def deepest(heights: Floats, depths: Floats, others: Floats, at: Floats, sign: float, least: float) -> float:
    """How far two profiles, ``heights`` at ``depths`` and ``others`` at ``at``, overlap; -1e9 where that is no more
    than ``least`` at any depth."""
    most = others.max() - heights.min() if sign > 0.0 else heights.max() - others.min()
    if most <= least:
        return -1e9
    worst = -1e9
    for j in range(len(heights)):
        worst = max(worst, overlap_at(heights[j], depths[j], others, at, sign))
        worst = max(worst, overlap_at(others[j], at[j], heights, depths, -sign))
    return worst


@kernel
def find_overlap(samples: Floats, press: float, soft: float, push: Floats) -> None:
    """How far the sides of an opening must move apart, ``push (2, k)``, from ``samples (2, k, m, 3)``.

    Side 0 is the upper one. Every column of a side is compared with the other side at the same x; where the two
    profiles have the same depth, the upper must not be lower by more than ``press`` mm; correction sets in softly from
    ``soft`` mm before that to ``soft`` mm beyond.
    """
    _, columns, rows, _ = samples.shape
    heights, depths = np.empty(rows), np.empty(rows)
    middle = np.zeros((2, columns))
    for side in range(2):
        for k in range(columns):
            for j in range(rows):
                middle[side, k] += samples[side, k, j, 0] / rows
    for side in range(2):
        sign, at = 1.0 - 2.0 * side, 0
        own, other, x = samples[side], samples[1 - side], middle[1 - side]
        for k in range(columns):
            while at < columns - 2 and x[at + 1] < middle[side, k]:
                at += 1
            t = min(max((middle[side, k] - x[at]) / max(x[at + 1] - x[at], 1e-9), 0.0), 1.0)
            for j in range(rows):
                heights[j] = other[at, j, 1] + t * (other[at + 1, j, 1] - other[at, j, 1])
                depths[j] = other[at, j, 2] + t * (other[at + 1, j, 2] - other[at, j, 2])
            worst = deepest(own[k, :, 1], own[k, :, 2], heights, depths, sign, press - soft) - press
            near = min(max(worst + soft, 0.0), 2.0 * soft)
            push[side, k] = worst if worst > soft else near * near / (4.0 * soft)


@kernel
def find_heights(samples: Floats, size: float, axis: Floats, heights: Floats) -> None:
    """How high samples (s, 3) as (x, height, depth) lie above an eyeball of radius ``size``: ``heights (s,)``.

    The eye looks along ``axis (3,)``; its cornea protrudes.
    """
    for s in range(len(samples)):
        x, depth = samples[s, 0], max(samples[s, 2], 1e-6)
        across = np.sqrt(max(depth * depth - x * x, 0.0))
        y, z = across * np.sin(samples[s, 1] / size), across * np.cos(samples[s, 1] / size)
        along = (x * axis[0] + y * axis[1] + z * axis[2]) / depth
        root = CORNEA_RADIUS**2 - CORNEA_AT**2 * (1.0 - along * along)
        ground = 1.0
        if along > 0.0 and root > 0.0:
            ground = max(1.0, CORNEA_AT * along + np.sqrt(root))
        heights[s] = depth - size * ground


@kernel
def find_lifts(heights: Floats, least: Floats, most: Floats, hold: Floats, gain: float, lifts: Floats) -> float:
    """How far samples at ``heights (s,)`` must be lifted or, below 0, laid down: ``lifts (s,)``.

    The error is what is missing to ``least (s,)`` or, times ``hold (s,)``, exceeds ``most (s,)``; samples move by
    ``gain`` times it. Returns the largest error.
    """
    worst = 0.0
    for s in range(len(heights)):
        lifts[s], h = 0.0, heights[s]
        if h < least[s]:
            lifts[s] = gain * (least[s] - h)
            worst = max(worst, least[s] - h)
        elif h > most[s] and hold[s] > 0.0:
            lifts[s] = gain * hold[s] * (most[s] - h)
            worst = max(worst, hold[s] * (h - most[s]))
    return worst


@kernel
def lift_points(ids: Ints, lifts: Floats, samples: Floats, size: float, table: Floats32, points: Floats) -> None:
    """Move ``points (n, 3)`` with the numbers ``ids (k,)`` by ``lifts (s,) @ table (s, k)``, mm, each lift away from
    the eyeball of radius ``size`` at its sample (s, 3) as (x, height, depth)."""
    count = len(ids)
    x, y, z = np.zeros(count, np.float32), np.zeros(count, np.float32), np.zeros(count, np.float32)
    for s in range(len(lifts)):
        if lifts[s] == 0.0:
            continue
        depth = max(samples[s, 2], 1e-6)
        across, share = np.sqrt(max(depth * depth - samples[s, 0] ** 2, 0.0)), lifts[s] / depth
        a = np.float32(share * samples[s, 0])
        b = np.float32(share * across * np.sin(samples[s, 1] / size))
        c = np.float32(share * across * np.cos(samples[s, 1] / size))
        row = table[s]
        for k in range(count):
            x[k] += a * row[k]
            y[k] += b * row[k]
            z[k] += c * row[k]
    for k in range(count):
        points[ids[k], 0] += x[k]
        points[ids[k], 1] += y[k]
        points[ids[k], 2] += z[k]


@kernel
def move_points(
    ids: Ints, amounts: Floats, table: Floats, eye: Floats, radius: float, outward: bool, points: Floats
) -> None:
    """Move ``points (n, 3)`` with the numbers ``ids (k,)`` up by ``amounts (s,) @ table (s, k)``, mm.

    With a ``radius`` they go up round the eyeball at ``eye (3,)``, or away from its centre if ``outward``.
    """
    moves, still = np.zeros(len(ids)), True
    for s in range(len(amounts)):
        if amounts[s] != 0.0:
            still = False
            for k in range(len(ids)):
                moves[k] += amounts[s] * table[s, k]
    if still:
        return
    for k in range(len(ids)):
        i, move = ids[k], moves[k]
        if radius <= 0.0:
            points[i, 1] += move
            continue
        x, y, z = points[i, 0] - eye[0], points[i, 1] - eye[1], points[i, 2] - eye[2]
        if outward:
            scale = move / max(np.sqrt(x * x + y * y + z * z), 1e-6)
            points[i, 0] += scale * x
            points[i, 1] += scale * y
            points[i, 2] += scale * z
        else:
            cosine, sine = np.cos(move / radius), np.sin(move / radius)
            points[i, 1] = eye[1] + cosine * y + sine * z
            points[i, 2] = eye[2] + cosine * z - sine * y
