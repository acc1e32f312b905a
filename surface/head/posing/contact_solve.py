"""Compiled solution of one contact, or of one clearance, in one call: samples are placed, lids laid on the eyeball,
sides parted, as often as it takes.

Everything happens on a copy of the control points near the opening, relative to the eyeball's centre. The tuples that
the kernels take are made by :mod:`.contact`:

``sampling`` : near (p,) control points of the samples; start, ids, share as :func:`.contact.tile_weights` gives them,
    with indices into ``near``; own (k,) indices into ``near`` of the points that are moved
``limits`` : least, most, hold (s,) float64, radius and gain of :func:`.contact_kernels.find_lifts`; table and steps of
    :func:`.contact_kernels.lift_points`
``work`` : local, found (p, 3) float64; single (p, 3), room (24,) float32; samples (s, 4), heights, lifts (s,) float64;
    looked (4,), placed, trial (s, 4) float64
"""

# mypy: disable-error-code="call-arg, var-annotated, no-untyped-def"
# mypy: allow-untyped-defs
from __future__ import annotations

import numpy as np

from surface.base.jit import kernel, nonallocating

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

SEAL_PASSES = 2  # of bringing sides together: the second closes what bending left open
STILL_MM = 2e-3
"""Where no sample has moved further since a contact was solved, its points are moved as they were then.

A blink moves the other eye's lids, and the lips, by less than half of it: solving these contacts again reads tables
that other work has driven out of the caches, and moves nothing that could be seen."""


@nonallocating
def gather_near(points, near, eye, local):
    """Copy the points ``near (p,)`` of ``points (n, 3)``, relative to ``eye (3,)``, to ``local (p, 3)``."""
    for k in range(len(near)):
        for c in range(3):
            local[k, c] = points[near[k], c] - eye[c]


@nonallocating
def is_known(local, found):
    """Whether points (p, 3) are those that the last answer was found for."""
    for k in range(len(local)):
        for c in range(3):
            if found[k, c] != local[k, c]:
                return False
    return True


@nonallocating
def is_looking(axis, seal, looked):
    """Whether axis and seal are those of the last answer."""
    return looked[0] == axis[0] and looked[1] == axis[1] and looked[2] == axis[2] and looked[3] == seal


@nonallocating
def is_still(trial, placed):
    """Whether samples (s, 4) are within :data:`STILL_MM` of those that the last answer was found for."""
    for k in range(len(trial)):
        for c in range(3):
            if not abs(trial[k, c] - placed[k, c]) <= STILL_MM:  # placed are nan before the first answer
                return False
    return True


@nonallocating
def keep_question(axis, seal, work):
    """Keep points, samples, axis and seal as those that the next answer is found for."""
    local, found, _, _, samples, _, _, looked, placed, trial = work
    for c in range(3):
        looked[c] = axis[c]
    looked[3] = seal
    copy_rows(local, found)
    copy_rows(trial, placed)
    copy_rows(trial, samples)


@nonallocating
def copy_rows(rows, out):
    """Copy ``rows (n, c)`` to ``out (n, c)``; assigning a slice would allocate."""
    for k in range(rows.shape[0]):
        for c in range(rows.shape[1]):
            out[k, c] = rows[k, c]


@kernel
def lift_once(axis, tolerance, sampling, limits, work):
    """Move points once where the placed samples are off the eyeball by more than ``tolerance``, mm; returns the largest
    error."""
    _, _, _, _, own = sampling
    least, most, hold, radius, gain, table, steps = limits
    local, _, _, room, samples, heights, lifts, _, _, _ = work
    find_heights(samples, radius, axis, heights)
    error = find_lifts(heights, least, most, hold, gain, lifts)
    if error > tolerance:
        lift_points(own, lifts, samples, table, steps, room, local)
    return error


@nonallocating
def place_all(around, sampling, work):
    """Place the samples."""
    place_in(around, sampling, work, work[4])


@nonallocating
def place_in(around, sampling, work, out):
    """Place the samples in ``out (s, 4)``."""
    _, start, ids, share, _ = sampling
    place_samples(start, ids, share, work[0], around, work[2], work[3], out)


@kernel
def clear_eyeball(points, eye, axis, passes, tolerance, sampling, limits, work):
    """Move control points (n, 3), at most ``passes`` times, until no sample is off the eyeball by more than
    ``tolerance``, mm; returns the largest error that was found last."""
    near, _, _, _, own = sampling
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

    Samples are placed again after it."""
    own, radius, local = sampling[4], limits[3], work[0]
    _, profiles, overlap, _, _, _ = opening
    error, around = 0.0, radius > 0.0
    if around:
        error = lift_once(axis, 0.0, sampling, limits, work)
        if error > 0.0:
            place_all(around, sampling, work)
    trace_profiles(work[4], rows, radius, profiles)
    find_overlap(profiles, press, soft, overlap)
    if not around:
        push += overlap.ravel()
    deepest = overlap.max()
    if deepest > 0.0:
        move_points(own, overlap.ravel(), apart, np.zeros(3), radius, False, local)
        place_all(around, sampling, work)
    return max(error, deepest)


@kernel
def close_sides(seal, passes, tolerance, rows, apart, opening, push, sampling, work):
    """Bring the placed sides of an opening together by ``seal``, 0..1; samples are placed again after it."""
    own, local = sampling[4], work[0]
    _, profiles, overlap, _, least, wanted = opening
    for k in range(passes):
        trace_profiles(work[4], rows, 0.0, profiles)
        if find_closing(profiles, seal, least, wanted, k == 0, overlap) < tolerance:
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
    number of passes, at most ``passes``; 0 if the last answer still holds, or the moves that led to it do.

    press, soft : as in :func:`.contact_kernels.find_overlap`; rows : samples of a column.
    apart : (2 c, k) how far the moved points go up where the sides of a column part by 1.
    opening : before, profiles (2, c, m, 3), overlap (2, c), the answer (k, 3), gaps at rest (2, c), and room for
        those that are wanted (2, c); all but those at rest are overwritten.
    push : what :meth:`.contact.ContactSolver.apply` returns.
    """
    near, _, _, _, own = sampling
    local, found, looked, placed, trial, answer = work[0], work[1], work[7], work[8], work[9], opening[3]
    gather_near(points, near, eye, local)
    same = is_looking(axis, seal, looked)
    if same and is_known(local, found):
        for k in range(len(own)):
            points[near[own[k]]] = answer[k]
        return 0
    place_in(limits[3] > 0.0, sampling, work, trial)
    if same and is_still(trial, placed):
        for k in range(len(own)):
            for c in range(3):
                points[near[own[k]], c] += answer[k, c] - eye[c] - found[own[k], c]
        return 0
    keep_question(axis, seal, work)
    done = solve_sides(axis, seal, passes, tolerance, press, soft, rows, apart, opening, push, sampling, limits, work)
    for k in range(len(own)):
        for c in range(3):
            answer[k, c] = eye[c] + local[own[k], c]
        points[near[own[k]]] = answer[k]
    return done


@kernel
def solve_sides(axis, seal, passes, tolerance, press, soft, rows, apart, opening, push, sampling, limits, work):
    """Correct the points near an opening, whose samples are placed, as :func:`part_sides` says; returns the number of
    passes."""
    before, profiles, _, _, _, _ = opening
    lids, done, error = limits[3] > 0.0, 0, tolerance
    push[:] = 0.0
    if seal > 0.0 and not lids:
        close_sides(seal, SEAL_PASSES, tolerance, rows, apart, opening, push, sampling, work)
    if lids:
        trace_profiles(work[4], rows, limits[3], before)
    while done < passes and error >= tolerance:
        error = part_once(axis, press, soft, rows, apart, opening, push, sampling, limits, work)
        done += 1
    if lids:
        trace_profiles(work[4], rows, limits[3], profiles)
        tell_moves(before, profiles, push)
    return done


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
