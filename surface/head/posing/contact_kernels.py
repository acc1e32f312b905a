"""Compiled loops of contacts: sample an opening, find overlap and heights above an eyeball, move control points."""

# mypy: disable-error-code="call-arg, var-annotated"
from __future__ import annotations

from math import factorial

import numpy as np

from surface.base.addresses import flat, wide
from surface.base.arrays import Floats, Floats32, Ints, Shorts
from surface.base.jit import inlined, kernel, nonallocating
from surface.spline.lanes import (
    LANES,
    add,
    add_pairs,
    first_of,
    fma_at,
    fma_pair,
    item,
    load,
    load_pair,
    second_of,
    store3,
    zero,
    zero_pair,
)

# The cornea protrudes from the eyeball: its sphere's centre and radius, in eyeball radii, as
# surface.fit.points.eyeball has it
CORNEA_AT, CORNEA_RADIUS = 0.4447, 0.65
MAX_SHORT = 32767  # the largest 16-bit number
SHARE_STEP = 1.0 / MAX_SHORT  # shares of control points in samples are whole multiples of it: half the memory to read
PAIR = 2 * LANES  # points that move at once
MAX_SIGHT = 0.7  # tangent of 35 degrees: up to this far from the front, closed lips still look closed
# coefficients of Taylor's series: of x**10 to 1, of the sine over x and of the cosine
SINE = tuple((-1) ** k / factorial(2 * k + 1) for k in range(5, -1, -1))
COSINE = tuple((-1) ** k / factorial(2 * k) for k in range(5, -1, -1))


@inlined
def sum_shares(share, ids, first, end, rows):  # type: ignore[no-untyped-def]
    """Return sums of x, y and z over the entries ``first`` to ``end``: entry k is the row ``ids[k]`` of ``rows (k, 3)``
    times the eight numbers of ``share`` from ``8 k`` on.

    Two entries are a pair, and two sums are kept of each, so that additions do not wait for each other.
    """
    x, y, z = zero(), zero(), zero()
    x0, y0, z0, x1, y1, z1 = zero_pair(), zero_pair(), zero_pair(), zero_pair(), zero_pair(), zero_pair()
    k = first
    while k + 4 <= end:
        i, j, m, n = 3 * item(ids, k), 3 * item(ids, k + 1), 3 * item(ids, k + 2), 3 * item(ids, k + 3)
        a, b = load_pair(share, 8 * k), load_pair(share, 8 * k + 16)
        x0, x1 = fma_pair(a, rows, i, j, x0), fma_pair(b, rows, m, n, x1)
        y0, y1 = fma_pair(a, rows, i + 1, j + 1, y0), fma_pair(b, rows, m + 1, n + 1, y1)
        z0, z1 = fma_pair(a, rows, i + 2, j + 2, z0), fma_pair(b, rows, m + 2, n + 2, z1)
        k += 4
    while k < end:
        a, i = load(share, 8 * k), 3 * item(ids, k)
        x, y, z = fma_at(a, rows, i, x), fma_at(a, rows, i + 1, y), fma_at(a, rows, i + 2, z)
        k += 1
    x0, y0, z0 = add_pairs(x0, x1), add_pairs(y0, y1), add_pairs(z0, z1)
    return (
        add(x, add(first_of(x0), second_of(x0))),
        add(y, add(first_of(y0), second_of(y0))),
        add(z, add(first_of(z0), second_of(z0))),
    )


@inlined
def sum_ways(table, base, picks, count, ways):  # type: ignore[no-untyped-def]
    """Return sums of x, y and z, a pair each, of ``ways (k, 3)``, way k times the sixteen numbers of ``table`` from
    ``base + 16 picks[k]`` on."""
    x0, y0, z0, x1, y1, z1 = zero_pair(), zero_pair(), zero_pair(), zero_pair(), zero_pair(), zero_pair()
    k = 0
    while k + 2 <= count:
        a, b = load_pair(table, base + 16 * item(picks, k)), load_pair(table, base + 16 * item(picks, k + 1))
        i = 3 * k
        x0, x1 = fma_pair(a, ways, i, i, x0), fma_pair(b, ways, i + 3, i + 3, x1)
        y0, y1 = fma_pair(a, ways, i + 1, i + 1, y0), fma_pair(b, ways, i + 4, i + 4, y1)
        z0, z1 = fma_pair(a, ways, i + 2, i + 2, z0), fma_pair(b, ways, i + 5, i + 5, z1)
        k += 2
    if k < count:
        a, i = load_pair(table, base + 16 * item(picks, k)), 3 * k
        x0, y0 = fma_pair(a, ways, i, i, x0), fma_pair(a, ways, i + 1, i + 1, y0)
        z0 = fma_pair(a, ways, i + 2, i + 2, z0)
    return add_pairs(x0, x1), add_pairs(y0, y1), add_pairs(z0, z1)


@nonallocating
def place_samples(
    start: Ints, ids: Ints, share: Shorts, offset: Floats, local: Floats, around: bool, single: Floats32,
    room: Floats32, out: Floats,
) -> None:  # fmt: skip
    """Samples ``out (s, 4)`` of a surface: x, y and z from the eyeball's centre, and depth, from control points
    ``local (k, 3)``, which are relative to that centre, too.

    Eight samples at a time: those of tile t are the sums of eight ``share`` each, in steps of :data:`SHARE_STEP`, times
    the points ``ids`` between ``start[t]`` and ``start[t + 1]``, and of ``offset (s, 3)``; ``single (k, 3)`` and
    ``room (48,)`` are scratch space. Depth is the distance from the centre if samples lie ``around`` an eyeball, else
    z.
    """
    for k in range(len(local)):
        for c in range(3):
            single[k, c] = SHARE_STEP * local[k, c]
    for tile in range(len(start) - 1):
        x, y, z = sum_shares(share, ids, start[tile], start[tile + 1], single)
        store3(room, 0, x, y, z)
        for s in range(8 * tile, min(8 * tile + 8, len(out))):
            at = 3 * (s - 8 * tile)
            for c in range(3):
                out[s, c] = room[at + c] + offset[s, c]
    if around:  # loops as simple as these are compiled to several samples at once
        for s in range(len(out)):
            out[s, 3] = np.sqrt(out[s, 0] * out[s, 0] + out[s, 1] * out[s, 1] + out[s, 2] * out[s, 2])
    else:
        for s in range(len(out)):
            out[s, 3] = out[s, 2]


@nonallocating
def angle(y: float, z: float) -> float:
    """Return the angle of (z, y) as np.arctan2(y, z), to 2e-8 rad, in a third of the time; Abramowitz and Stegun,
    4.4.49."""
    a, b = abs(y), abs(z)
    t = min(a, b) / max(a, b, 1e-300)
    q, r = t * t, 0.0028662257
    r = -0.0161657367 + q * r
    r = 0.0429096138 + q * r
    r = -0.0752896400 + q * r
    r = 0.1065626393 + q * r
    r = -0.1420889944 + q * r
    r = 0.1999355085 + q * r
    r = t * (1.0 + q * (-0.3333314528 + q * r))
    r = np.pi / 2.0 - r if a > b else r
    r = np.pi - r if z < 0.0 else r
    return -r if y < 0.0 else r


@nonallocating
def trace_profiles(samples: Floats, rows: int, radius: float, room: Floats, out: Floats) -> None:
    """Profiles ``out (2, k, m, 3)`` of an opening's columns as (x, height, depth), from ``samples (s, 4)``, of which
    every column has ``rows``, m of them in its profile. Height is y, or, with a ``radius`` > 0, the arc above the
    eyeball's middle. ``room (s,)`` is scratch space."""
    _, columns, m, _ = out.shape
    if radius > 0.0:
        for s in range(len(samples)):
            room[s] = radius * angle(samples[s, 1], samples[s, 2])
    else:
        for s in range(len(samples)):
            room[s] = samples[s, 1]
    for side in range(2):
        for k in range(columns):
            first = (side * columns + k) * rows
            for j in range(m):
                s = first + j
                out[side, k, j, 0], out[side, k, j, 1], out[side, k, j, 2] = samples[s, 0], room[s], samples[s, 3]


@nonallocating
def overlap_at(height: float, depth: float, heights: Floats, depths: Floats, sign: float) -> float:
    """Return how far a profile's line reaches beyond ``height`` at ``depth``, towards ``sign``; -1e9 where it has
    none.
    """
    worst = -1e9
    for j in range(len(heights) - 1):
        a, b = depths[j], depths[j + 1]
        if (a - depth) * (b - depth) > 0.0 or a == b:
            continue
        t = (depth - a) / (b - a)
        worst = max(worst, sign * (heights[j] + t * (heights[j + 1] - heights[j]) - height))
    return worst


@nonallocating
def deepest(heights: Floats, depths: Floats, others: Floats, at: Floats, sign: float, least: float) -> float:
    """Return how far two profiles, ``heights`` at ``depths`` and ``others`` at ``at``, overlap; -1e9 where that is no
    more than ``least`` at any depth."""
    near, far = 1e9, -1e9
    for j in range(len(heights)):
        near, far = min(near, sign * heights[j]), max(far, sign * others[j])
    if far - near <= least:
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


@nonallocating
def trace_edges(samples: Floats, edges: Floats) -> None:
    """The lines that hide what lies behind an opening: ``edges (2, k, 3)``, x, height and depth of the lowest sample of
    each column of the upper side and of the highest of the lower side, from ``samples (2, k, m, 3)``."""
    _, columns, rows, _ = samples.shape
    for side in range(2):
        sign = 1.0 - 2.0 * side
        for k in range(columns):
            best = 0
            for j in range(1, rows):
                if sign * samples[side, k, j, 1] < sign * samples[side, k, best, 1]:
                    best = j
            for c in range(3):
                edges[side, k, c] = samples[side, k, best, c]


@nonallocating
def hidden_to(across: Floats, edge: Floats, at: float, sign: float) -> float:
    """Return the height up to which a line of :func:`trace_edges`, ``edge (k, 3)``, hides what lies behind it, or down
    to which with a ``sign`` below 0, at the place ``at`` across the line of sight; that of its nearest point beyond
    its ends.

    across : (k,) places of its points. Seen aside, the line may run back at a corner of the mouth, so that several of
    its pieces lie at one place; the one that hides most counts.
    """
    most, nearest = -1e9, 0
    for k in range(len(across) - 1):
        a, b = across[k], across[k + 1]
        if (a - at) * (b - at) <= 0.0:
            t = (at - a) / (b - a) if a != b else 0.0
            most = max(most, sign * (edge[k, 1] + t * (edge[k + 1, 1] - edge[k, 1])))
    if most > -1e9:
        return sign * most
    for k in range(1, len(across)):
        if abs(across[k] - at) < abs(across[nearest] - at):
            nearest = k
    return float(edge[nearest, 1])


@kernel
def find_gaps(samples: Floats, gaps: Floats) -> None:
    """How far an opening stands open, ``gaps (2, k)``, as seen from the front and :data:`MAX_SIGHT` aside of it,
    where it is widest, from ``samples (2, k, m, 3)`` as :func:`find_overlap` takes them: from the lowest of each
    column of the upper side to the highest of the lower side in the same line of sight, below 0 where one hides
    behind the other; and for each column of the lower side in turn.
    """
    columns = samples.shape[1]
    edges, across = np.empty((2, columns, 3)), np.empty((2, columns))
    trace_edges(samples, edges)
    gaps[:] = -1e9
    for way in range(-1, 2):
        for side in range(2):
            for k in range(columns):
                across[side, k] = edges[side, k, 0] - way * MAX_SIGHT * edges[side, k, 2]
        for side in range(2):
            sign = 1.0 - 2.0 * side
            for k in range(columns):
                other = hidden_to(across[1 - side], edges[1 - side], across[side, k], sign)
                gaps[side, k] = max(gaps[side, k], sign * (edges[side, k, 1] - other))


@kernel
def find_closing(
    samples: Floats, seal: float, ends: Floats, least: Floats, wanted: Floats, first: bool, push: Floats
) -> float:
    """Return how far the sides of an opening must come together, ``push (2, k)``, not above 0, so that ``seal`` of what
    it stands open beyond ``least (2, k)`` closes, or in each column ``ends (k,)`` of it where that is more; ``wanted
    (2, k)`` is where that ends, set at the ``first`` call. Returns the farthest."""
    most = 0.0
    find_gaps(samples, push)
    for side in range(2):
        for k in range(push.shape[1]):
            if first:
                wanted[side, k] = push[side, k] - max(seal, ends[k]) * max(push[side, k] - least[side, k], 0.0)
            push[side, k] = min(wanted[side, k] - push[side, k], 0.0)
            most = max(most, -push[side, k])
    return most


@nonallocating
def find_heights(samples: Floats, size: float, axis: Floats, heights: Floats) -> None:
    """How high ``samples (s, 4)``, as :func:`place_samples` gives them, lie above an eyeball of radius ``size``:
    ``heights (s,)``.

    The eye looks along ``axis (3,)``; its cornea protrudes.
    """
    a, b, c = axis[0], axis[1], axis[2]
    for s in range(len(samples)):  # in two loops, each of which is compiled to several samples at once
        heights[s] = (samples[s, 0] * a + samples[s, 1] * b + samples[s, 2] * c) / max(samples[s, 3], 1e-6)
    for s in range(len(samples)):
        along = heights[s]
        root = max(CORNEA_RADIUS**2 - CORNEA_AT**2 * (1.0 - along * along), 0.0)
        ground = size * max(1.0, CORNEA_AT * along + np.sqrt(root))  # 1 beside the cornea and behind it
        heights[s] = max(samples[s, 3], 1e-6) - ground


@nonallocating
def find_lifts(heights: Floats, least: Floats, most: Floats, hold: Floats, gain: float, lifts: Floats) -> float:
    """Return how far samples at ``heights (s,)`` must be lifted or, below 0, laid down: ``lifts (s,)``.

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
def lift_points(
    ids: Ints, lifts: Floats, samples: Floats, table: Shorts, steps: Floats, room: Floats32, points: Floats
) -> None:  # fmt: skip
    """Move ``points (n, 3)`` with the numbers ``ids (k,)`` by ``lifts (s,)``, mm, each away from the eyeball's centre
    at its sample (s, 4).

    ``table (16 b s,)`` says how far points move per lift, in each point's ``steps (k,)``: for every sixteen of them,
    sample after sample. ``room (48,)`` is scratch space.
    """
    ways, used, count = np.empty((len(lifts), 3), np.float32), np.empty(len(lifts), np.int64), 0
    for s in range(len(lifts)):
        if lifts[s] != 0.0:
            share = lifts[s] / max(samples[s, 3], 1e-6)
            for c in range(3):
                ways[count, c] = share * samples[s, c]
            used[count] = s
            count += 1
    for first in range(0, len(ids), PAIR):
        x, y, z = sum_ways(table, first * len(lifts), used, count, ways)
        store3(room, 0, first_of(x), first_of(y), first_of(z))
        store3(room, 24, second_of(x), second_of(y), second_of(z))
        for k in range(first, min(first + PAIR, len(ids))):
            for c in range(3):
                points[ids[k], c] += steps[k] * room[3 * (k - first) + c]


@nonallocating
def turn_of(angle: float) -> tuple[float, float]:
    """Return the sine and cosine of an angle in rad; by Taylor's series where it is small, to 2e-15, in a tenth of the
    time."""
    if abs(angle) > 0.25:
        return np.sin(angle), np.cos(angle)
    q, s, c = angle * angle, SINE[0], COSINE[0]
    for k in range(1, len(SINE)):
        s, c = SINE[k] + q * s, COSINE[k] + q * c
    return angle * s, c


@nonallocating
def move_up(i: int, move: float, eye: Floats, radius: float, outward: bool, points: Floats) -> None:
    """Move point i of ``points (n, 3)`` up by ``move``, mm; with a ``radius`` round the eyeball at ``eye (3,)``, or
    away from its centre if ``outward``."""
    if radius <= 0.0:
        points[i, 1] += move
        return
    x, y, z = points[i, 0] - eye[0], points[i, 1] - eye[1], points[i, 2] - eye[2]
    if outward:
        scale = move / max(np.sqrt(x * x + y * y + z * z), 1e-6)
        points[i, 0] += scale * x
        points[i, 1] += scale * y
        points[i, 2] += scale * z
    elif move != 0.0:
        sine, cosine = turn_of(move / radius)
        points[i, 1] = eye[1] + cosine * y + sine * z
        points[i, 2] = eye[2] + cosine * z - sine * y


@kernel
def move_points(
    ids: Ints, amounts: Floats, table: Floats, eye: Floats, radius: float, outward: bool, points: Floats
) -> None:
    """Move ``points (n, 3)`` with the numbers ``ids (k,)`` up by ``amounts (s,) @ table (s, k)``, mm, as
    :func:`move_up`."""
    moves, still = np.zeros(len(ids)), True
    for s in range(len(amounts)):
        if amounts[s] != 0.0:
            still = False
            for k in range(len(ids)):
                moves[k] += amounts[s] * table[s, k]
    if still:
        return
    for k in range(len(ids)):
        move_up(ids[k], moves[k], eye, radius, outward, points)


@nonallocating
def follow_samples(
    ids: Ints, beside: Ints, share: Floats, push: Floats, size: int, eye: Floats, radius: float, points: Floats
) -> None:  # fmt: skip
    """Move ``points (n, 3)`` with the numbers ``ids (k,)`` along with the two samples that each lies beside.

    push : (size,) how far samples went up, mm, or (2 size,): also how far they were lifted off the eyeball;
    beside (k, 2) : samples of each point; share (k, 2) : how much of their move it takes.
    """
    for kind in range(len(push) // size):
        for k in range(len(ids)):
            a, b = push[kind * size + beside[k, 0]], push[kind * size + beside[k, 1]]
            move = share[k, 0] * a + share[k, 1] * b
            if move != 0.0:
                move_up(ids[k], move, eye, radius, kind == 1, points)


@kernel
def follow_bound(table: Ints, push: Floats, points: Floats) -> None:
    """Run :func:`follow_samples` with a table of addresses: of ``ids``, ``beside``, ``share``, and of five numbers, the
    eye's centre, its radius and ``size``."""
    ball = flat(table, 3, np.float64)
    follow_samples(
        flat(table, 0, np.int64), wide(table, 1, 2, np.int64), wide(table, 2, 2, np.float64), push, np.int64(ball[4]),
        ball[:3], ball[3], points,
    )  # fmt: skip
