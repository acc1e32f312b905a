"""Compiled solution of one contact, or of one clearance, in one call: samples are placed, lids laid on the eyeball,
sides parted, as often as it takes.

Everything happens on a copy of the control points near the opening, relative to the eyeball's centre. The tuples that
the kernels take are made by :mod:`.contact`:

``sampling`` : near (p,) control points of the samples, and those that are moved; start, ids, share as
    :func:`.contact.tile_weights` gives them, with indices into ``near``; own (k,) and watched (w,) indices into
    ``near`` of the points that are moved, and of those that the answer depends on; offset (s, 3) float64, added to each
    sample
``limits`` : least, most, hold (s,) float64, radius and gain of :func:`.contact_kernels.find_lifts`; table and steps
    of :func:`.contact_kernels.lift_points`
``work`` : local, found (p, 3) float64; single (p, 3), room (48,) float32; samples (s, 4), heights, lifts (s,) float64;
    looked (4,) float64

Python passes all of them as one table of addresses, see :mod:`surface.base.addresses`: what it passes to a compiled
function is inspected at every call, and of so many arrays that would take as long as a quarter of the solution.
"""

# mypy: disable-error-code="call-arg, var-annotated, no-untyped-def"
# mypy: allow-untyped-defs
from __future__ import annotations

import numpy as np

from surface.base.addresses import flat, shaped, wide
from surface.base.jit import kernel, merged, nonallocating

from .contact_kernels import (
    find_closing,
    find_heights,
    find_lifts,
    find_overlap,
    lift_points,
    move_points,
    place_samples,
    trace_profiles,
)

NAMES = (
    "near", "start", "ids", "share", "own", "watched", "offset", "least", "most", "hold", "table", "steps",
    "local", "found", "single", "room", "samples", "heights", "lifts", "looked", "ball",
)  # fmt: skip
"""The arrays of a clearance in the order of its table; ``ball (5,)`` float64 is the eye's centre, its radius and the
gain of lifts."""
SIDES = ("before", "profiles", "overlap", "answer", "rest", "wanted", "apart", "push", "form", "ends")
"""The arrays that follow in the table of a contact: its opening, as :func:`part_sides` takes it, and ``form (5,)``
float64: ``press``, ``soft`` and ``rows`` there, then columns of a side and rows of a profile."""
SEAL_PASSES = 2  # of bringing sides together: the second closes what bending left open


@nonallocating
def gather_near(points, near, eye, local):
    """Copy the points ``near (p,)`` of ``points (n, 3)``, relative to ``eye (3,)``, to ``local (p, 3)``."""
    for k in range(len(near)):
        for c in range(3):
            local[k, c] = points[near[k], c] - eye[c]


@nonallocating
def is_known(watched, local, axis, seal, found, looked):
    """Whether the ``watched`` points, axis and seal are those of the last answer; they are kept as those of the next
    one if not."""
    same = looked[3] == seal
    looked[3] = seal
    for c in range(3):
        same = same and looked[c] == axis[c]
        looked[c] = axis[c]
    for k in watched:
        for c in range(3):
            same = same and found[k, c] == local[k, c]
            found[k, c] = local[k, c]
    return same


@kernel
def lift_once(axis, tolerance, sampling, limits, work):
    """Move points once where the placed samples are off the eyeball by more than ``tolerance``, mm; returns the largest
    error."""
    own = sampling[4]
    least, most, hold, radius, gain, table, steps = limits
    local, _, _, room, samples, heights, lifts, _ = work
    find_heights(samples, radius, axis, heights)
    error = find_lifts(heights, least, most, hold, gain, lifts)
    if error > tolerance:
        lift_points(own, lifts, samples, table, steps, room, local)
    return error


@nonallocating
def place_all(around, sampling, work):
    """Place the samples."""
    _, start, ids, share, _, _, offset = sampling
    local, _, single, room, samples, _, _, _ = work
    place_samples(start, ids, share, offset, local, around, single, room, samples)


@kernel
def clear_eyeball(points, eye, axis, passes, tolerance, sampling, limits, work):
    """Move control points (n, 3), at most ``passes`` times, until no sample is off the eyeball by more than
    ``tolerance``, mm; returns the largest error that was found last."""
    near, own = sampling[0], sampling[4]
    local, moved, error = work[0], False, 0.0
    gather_near(points, near, eye, local)
    for _ in range(passes):
        place_all(True, sampling, work)
        error = lift_once(axis, tolerance, sampling, limits, work)
        if error <= tolerance:
            break
        moved = True
    if moved:
        put_back(points, near, own, eye, local)
    return error


@nonallocating
def put_back(points, near, own, eye, local):
    """Write the moved ones of the points near an opening back to ``points (n, 3)``."""
    for k in range(len(own)):
        for c in range(3):
            points[near[own[k]], c] = eye[c] + local[own[k], c]


@kernel
def part_once(axis, press, soft, rows, apart, opening, push, sampling, limits, work):
    """Run one pass of :func:`part_sides` over the placed samples; return the largest error found.

    Samples are placed again after it, and profiles of lids traced."""
    own, radius, local = sampling[4], limits[3], work[0]
    profiles, overlap = opening[1], opening[2]
    error, around = 0.0, radius > 0.0
    if around:
        error = lift_once(axis, 0.0, sampling, limits, work)
        if error > 0.0:
            place_all(around, sampling, work)
    trace_profiles(work[4], rows, radius, work[5], profiles)
    find_overlap(profiles, press, soft, overlap)
    if not around:
        push += overlap.ravel()
    deepest = overlap.max()
    if deepest > 0.0:
        move_points(own, overlap.ravel(), apart, np.zeros(3), radius, False, local)
        place_all(around, sampling, work)
        if around:
            trace_profiles(work[4], rows, radius, work[5], profiles)
    return max(error, deepest)


@kernel
def close_sides(seal, passes, tolerance, rows, apart, opening, push, sampling, work):
    """Bring the placed sides of an opening together by ``seal``, 0..1, or by its ``ends`` where they are more; samples
    are placed again after it."""
    own, local = sampling[4], work[0]
    _, profiles, overlap, _, least, wanted, ends = opening
    for k in range(passes):
        trace_profiles(work[4], rows, 0.0, work[5], profiles)
        if find_closing(profiles, seal, ends, least, wanted, k == 0, overlap) < tolerance:
            break
        push += overlap.ravel()
        move_points(own, overlap.ravel(), apart, np.zeros(3), 0.0, False, local)
        place_all(False, sampling, work)


@kernel
def part_sides(
    points, eye, axis, seal, passes, tolerance, press, soft, rows, apart, opening, push, sampling, limits, work
):  # fmt: skip
    """Correct the control points (n, 3) at an opening in place, until the error is below ``tolerance``, mm.

    First lids are moved onto the eyeball, which opens them, and ``seal``, 0..1, of the opening is closed. Returns the
    number of passes, at most ``passes``; 0 if the last answer still holds.

    press, soft : as in :func:`.contact_kernels.find_overlap`; rows : samples of a column.
    apart : (2 c, k) how far the moved points go up where the sides of a column part by 1.
    opening : before, profiles (2, c, m, 3), overlap (2, c), the answer (k, 3), see :func:`answer_with`, gaps at rest
        (2, c), room for those that are wanted (2, c), and ends (c,), by how much of it each column closes at least; all
        but those at rest and ends are overwritten.
    push : what :meth:`.contact.ContactSolver.apply` returns.
    """
    near, _, _, _, own, watched, _ = sampling
    local, found, looked, radius = work[0], work[1], work[7], limits[3]
    before, profiles, answer, ends = opening[0], opening[1], opening[3], opening[6]
    gather_near(points, near, eye, local)
    done = 0
    if not is_known(watched, local, axis, seal, found, looked):
        push[:] = 0.0
        place_all(radius > 0.0, sampling, work)
        if radius <= 0.0 and max(seal, ends.max()) > 0.0:
            close_sides(seal, SEAL_PASSES, tolerance, rows, apart, opening, push, sampling, work)
        if radius > 0.0:
            trace_profiles(work[4], rows, radius, work[5], before)
        error = tolerance
        while done < passes and error >= tolerance:
            error = part_once(axis, press, soft, rows, apart, opening, push, sampling, limits, work)
            done += 1
        if radius > 0.0 and done > 0:
            tell_moves(before, profiles, push)
        answer_with(radius > 0.0, own, eye, local, push, apart, answer)
    for k in range(len(own)):
        if radius > 0.0:
            points[near[own[k]]] = answer[k]
        else:  # lips go straight up and down, wherever their points are
            points[near[own[k]], 1] += answer[k, 1]
    return done


@nonallocating
def answer_with(around, own, eye, local, push, apart, answer):
    """Write the places of moved points to ``answer (k, 3)``, or, of lips, how far they go up."""
    for k in range(len(own)):
        for c in range(3):
            answer[k, c] = eye[c] + local[own[k], c] if around else 0.0
    if not around:
        for s in range(len(push)):
            if push[s] != 0.0:
                for k in range(len(own)):
                    answer[k, 1] += push[s] * apart[s, k]


@nonallocating
def tell_moves(before, after, push):
    """Heights and depths of all samples of profiles ``after (2, c, m, 3)`` less those ``before``: ``push (4 c m,)``."""
    _, columns, rows, _ = before.shape
    at = 0
    for kind in range(1, 3):
        for side in range(2):
            for k in range(columns):
                for j in range(rows):
                    push[at] = after[side, k, j, kind] - before[side, k, j, kind]
                    at += 1


@merged
def clearance_of(table):
    """Return the eye's centre, and ``sampling``, ``limits`` and ``work`` of a table."""
    ball = flat(table, 20, np.float64)
    sampling = (flat(table, 0, np.int64), flat(table, 1, np.int64), flat(table, 2, np.int64), flat(table, 3, np.int16),
                flat(table, 4, np.int64), flat(table, 5, np.int64), wide(table, 6, 3, np.float64))  # fmt: skip
    limits = (flat(table, 7, np.float64), flat(table, 8, np.float64), flat(table, 9, np.float64), ball[3], ball[4],
              flat(table, 10, np.int16), flat(table, 11, np.float64))  # fmt: skip
    work = (wide(table, 12, 3, np.float64), wide(table, 13, 3, np.float64), wide(table, 14, 3, np.float32),
            flat(table, 15, np.float32), wide(table, 16, 4, np.float64), flat(table, 17, np.float64),
            flat(table, 18, np.float64), flat(table, 19, np.float64))  # fmt: skip
    return ball[:3], sampling, limits, work


@kernel
def clear_bound(table, points, axis, passes, tolerance):
    """Do what :func:`clear_eyeball` does with the arrays of a table of NAMES."""
    eye, sampling, limits, work = clearance_of(table)
    return clear_eyeball(points, eye, axis, passes, tolerance, sampling, limits, work)


@kernel
def part_bound(table, points, axis, seal, passes, tolerance):
    """Do what :func:`part_sides` does with the arrays of a table of NAMES and SIDES."""
    eye, sampling, limits, work = clearance_of(table)
    first, form = len(NAMES), flat(table, len(NAMES) + 8, np.float64)
    columns, deep, moved = np.int64(form[3]), np.int64(form[4]), len(sampling[4])
    profiles, sides = (2, columns, deep, 3), (2, columns)
    opening = (
        shaped(table, first, profiles, np.float64), shaped(table, first + 1, profiles, np.float64),
        shaped(table, first + 2, sides, np.float64), wide(table, first + 3, 3, np.float64),
        shaped(table, first + 4, sides, np.float64), shaped(table, first + 5, sides, np.float64),
        flat(table, first + 9, np.float64),
    )  # fmt: skip
    apart = shaped(table, first + 6, (2 * columns, moved), np.float64)
    return part_sides(
        points, eye, axis, seal, passes, tolerance, form[0], form[1], np.int64(form[2]), apart, opening,
        flat(table, first + 7, np.float64), sampling, limits, work,
    )  # fmt: skip
