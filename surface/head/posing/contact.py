"""Contacts of lips and lids: keep the two sides of an opening from passing through each other, lids on the eyeball with
its cornea, and what lines the lids out of it.

Columns of samples run across an opening's upper and lower side. Overlap is found column by column in every pose, so
that any mixture of parameters is covered, and control points near the rim are moved by it. How far each moves per
sample is computed once, by least squares.
"""

from __future__ import annotations

from collections import OrderedDict
from hashlib import blake2b
from typing import NamedTuple

import numpy as np

from surface.base.addresses import make_table
from surface.base.arrays import Array, Floats, Ints, Shorts
from surface.dcp import DCPSurface
from surface.deform.lists import LANES
from surface.head.model.data import Contact, HeadData
from surface.head.model.parameters import smoothstep
from surface.head.posing.contact_kernels import (
    MAX_SHORT,
    PAIR,
    SHARE_STEP,
    find_gaps,
    find_heights,
    follow_bound,
    move_points,
    trace_profiles,
)
from surface.head.posing.contact_solve import NAMES, SIDES, clear_bound, gather_near, part_bound, place_all
from surface.spline.kernels import fill_rows, row_capacity

CONTACT_SHARE = 2 / 3  # fraction of the rows at an opening that can touch the other side; in the rest corrections fade
INNER_SHARE = 0.7  # of the rows of lips that can touch: those from the rim on whose points the others take, too
SOFT_MM = 0.1
OVERLAP_MM = (0.28, 0.9)  # allowed overlap of lips and of lids: triangles cut about that off the edges of both sides
NEARLY_MM = 1.2  # lips nearer than this at rest count as closed
HIDDEN_MM = 0.25  # by which each of two closed lips hides the other
_CORNER_COLUMNS = 3.0  # from a corner, over which lips of a mesh that leaves them apart begin to be closed
ROUND_FROM_TO = (0.35, 0.82)  # of half the mouth's width: where rounded lips begin to meet, and where they do
PASSES, TOLERANCE_MM = 3, 0.1  # corrections are repeated while bending leaves more than this
LIFT_GAIN = 1.6  # corrections of lids are multiplied by it, because regularised least squares fall short
LID_MM = 1.2  # thickness of a lid: skin that is nearer to the eyeball at rest never sinks further
TOUCH_MM = 0.05  # minimum distance from the eyeball
HOLD_MM = (1.2, 2.4)  # skin nearer to the eyeball at rest than the first is held on it, beyond the second it is free
FORWARD = np.array([0.0, 0.0, 1.0])
REGULARISATION = (0.02, 0.05)  # for lips and lids: weight of zero moves of control points, relative to a sample's
MIN_WEIGHT = 0.004  # of a control point in a sample: those with less are left out of it
FAR_MM = 18.0  # points further than this from every sample stay, since they would move brow and chin
MIN_SHARE = 0.02  # of a sample: points with less everywhere are not moved
_MAX_CACHED = 12  # tables in the cache, those of two heads
_FOUND: OrderedDict[bytes, tuple[Ints, Floats]] = OrderedDict()


def height_limits(
    samples: Floats, radius: float, *, held: bool, cling: bool = True
) -> tuple[Floats, Floats, Floats]:  # fmt: skip
    """Return how high samples of a lid shall lie above an eyeball: least and most, mm, and how firmly they are held
    down to the most, 0..1; (s,) each.

    samples : (s, 4) at rest, as :func:`.contact_kernels.place_samples` gives them, the eye looking ahead; radius : the
    eyeball's, 0 for none; held : do they rest on the eyeball, with their thickness? If not, they only keep out of it.
    cling : are they brought back to it, too?
    """
    heights = np.empty(len(samples))
    find_heights(samples, radius, FORWARD, heights)
    most = np.maximum(heights, TOUCH_MM)
    hold = smoothstep(most, HOLD_MM[1], HOLD_MM[0]) * (held and cling)
    return np.minimum(most, LID_MM if held else TOUCH_MM), most, hold


class SampleWeights(NamedTuple):
    """How samples depend on control points: sample k is the sum of ``share (m,)`` times the points ``ids (m,)`` from
    ``start[k]`` to ``start[k + 1]``, and ``offset[k]`` of (s, 3)."""

    start: Ints
    ids: Ints
    share: Floats
    offset: Floats


class EyeballClearance:
    """Keeps a surface out of an eyeball, or on it where it is ``held``.

    Parameters
    ----------
    places : (s, 2) samples in (u, v) of the surface near the eyeball; eye (3,), radius : the eyeball; with radius 0
        there is none, and only samples are placed.
    seen : samples that are placed, if not all of them; what moves is chosen by all.

    Attributes
    ----------
    ids : (k,) control points that are moved; table : (s, k) how far each moves per sample that moves by 1.
    samples : (s, 4) as placed last: x, y and z from the eyeball's centre, and depth.
    sampling, limits, work : what the kernels of :mod:`.contact_solve` take; arrays : in the order of their NAMES.
    """

    def __init__(
        self, surface: DCPSurface, places: Floats, eye: Floats, radius: float, *, held: bool = False,
        cling: bool = True, seen: SampleWeights | None = None,
    ) -> None:  # fmt: skip
        self.eye, self.radius = np.ascontiguousarray(eye, np.float64), float(radius)
        start, ids, share = weights_at(surface, places)
        self.ids, self.table = _inverse(start, ids, share, surface.points, REGULARISATION[radius > 0])
        placed = seen or SampleWeights(start, ids, share, np.zeros((len(places), 3)))
        near = np.union1d(placed.ids, self.ids)
        watched = np.searchsorted(near, np.unique(placed.ids if seen else near))
        tiles = tile_weights(placed.start, np.searchsorted(near, placed.ids), placed.share)
        self.sampling = near, *tiles, np.searchsorted(near, self.ids), watched, placed.offset
        s, p = len(placed.offset), len(near)
        self.samples = np.empty((s, 4))
        self.work = (np.zeros((p, 3)), np.full((p, 3), np.nan), np.zeros((p, 3), np.float32),
                     np.zeros(3 * PAIR, np.float32), self.samples, np.zeros(s), np.zeros(s), np.zeros(4))  # fmt: skip
        gather_near(surface.points, near, self.eye, self.work[0])
        place_all(self.radius > 0.0, self.sampling, self.work)
        limits = height_limits(self.samples, self.radius, held=held, cling=cling)
        tables = by_lanes(self.table)
        self.limits = (*limits, self.radius, LIFT_GAIN, *tables)
        ball = np.array([*self.eye, self.radius, LIFT_GAIN])
        self.arrays: list[Array] = [*self.sampling, *limits, *tables, *self.work, ball]
        self._bound = make_table(dict(zip(NAMES, self.arrays, strict=True)))

    def apply(self, axis: Floats, points: Floats) -> float:
        """Move control points (n, 3) in place; ``axis (3,)`` is where the eye looks. Returns the largest error, mm,
        that was found last."""
        return float(clear_bound(self._bound, points, axis, PASSES, TOLERANCE_MM))


class ContactSolver:
    """Keeps the two sides of one opening apart, and lids on the eyeball, on the part that has the opening.

    surface : of the part at rest; head : for the eyes.
    passes : how often the last call of :meth:`apply` corrected; 0 where it knew the answer.
    """

    def __init__(self, contact: Contact, surface: DCPSurface, head: HeadData) -> None:
        self.contact, self.passes = contact, 0
        places, eye = contact.places.reshape(-1, 2), eye_of(contact, head)
        lids = eye[1] > 0
        seen = None if lids else lip_weights(contact, surface)
        self._sides = EyeballClearance(surface, places, *eye, held=True, cling=contact.cling, seen=seen)
        self._apart = _column_moves(contact).T @ self._sides.table
        columns, rows = contact.places.shape[1], contact.places.shape[2] if lids else contact_rows(contact)
        profiles = 2, columns, contact_rows(contact), 3
        self._opening = (np.zeros(profiles), np.zeros(profiles), np.zeros((2, columns)),
                         np.zeros((len(self._sides.ids), 3)), *np.zeros((2, 2, columns)))  # fmt: skip
        trace_profiles(self._sides.samples, rows, self._sides.radius, self._sides.work[5], self._opening[0])
        find_gaps(self._opening[0], self._opening[4])
        close_nearly(self._opening[4], np.ones(columns) if contact.cling else corner_fade(columns))
        self.push = np.zeros(4 * columns * profiles[2] if lids else 2 * columns)
        self._rows, self._round, self._ends = rows, 0.0, np.zeros(columns)
        self._outer = np.zeros(columns) if lids else outer_columns(self._opening[0])
        form = np.array([OVERLAP_MM[lids], SOFT_MM, rows, columns, profiles[2]], np.float64)
        arrays = [*self._sides.arrays, *self._opening, self._apart, self.push, form, self._ends]
        self._kept, self._bound = arrays, make_table(dict(zip((*NAMES, *SIDES), arrays, strict=True)))

    def apply(self, axis: Floats, points: Floats, seal: float = 0.0, rounding: float = 0.0) -> Floats:
        """Correct control points (n, 3) in place; return what :meth:`Follower.apply` takes, overwritten by each
        call.

        For lips that is the overlap (2 k,) in mm that was found in each column, for lids how far their samples (2 k m,)
        slid and how far they were lifted. ``axis (3,)`` is where the eye looks; ``seal``, 0..1, how
        firmly lips stay together; ``rounding``, 0..1, how firmly they do towards the corners, so that what is open
        between them is round. Where neither the points near the opening nor the eye nor these two have changed, the
        last answer is used again.
        """
        if rounding != self._round:
            self._round = rounding
            np.multiply(rounding, self._outer, out=self._ends)
            self._sides.work[-1][:] = np.nan  # no answer is known for these ends
        self.passes = part_bound(self._bound, points, axis, seal, PASSES, TOLERANCE_MM)
        return self.push

    def gaps(self) -> Floats:
        """Return (2, k): how far each column of both sides stands open, mm, as the last call of :meth:`apply` left it,
        seen as :func:`.contact_kernels.find_gaps` sees it; for lips."""
        profiles = np.zeros_like(self._opening[0])
        gaps: Floats = np.zeros(profiles.shape[:2])
        trace_profiles(self._sides.samples, self._rows, self._sides.radius, self._sides.work[5], profiles)
        find_gaps(profiles, gaps)
        return gaps

    @property
    def lower(self) -> Floats:
        """(k, 3) samples of the lower side that can touch the upper one, as the last call of :meth:`apply` left them;
        for lips."""
        samples = self._sides.samples.reshape(2, -1, 4)[1, :, :3]
        return samples.reshape(-1, 3)

    def move_sides(self, amounts: Floats, points: Floats) -> None:
        """Move control points (n, 3) so that the sides go apart by ``amounts (2, k)`` mm in their columns: the upper
        ones up by the contact's share of it, the lower ones down by the rest; together below 0."""
        sides = self._sides
        move_points(sides.ids, amounts.ravel(), self._apart, sides.eye, sides.radius, False, points)


class Follower:
    """Moves the control points of another part near an opening along with it: at lids, each as the sample next to it in
    two columns; at lips, by the correction of each side.

    points : (n, 3) of the part at rest; surface : of the part that has the opening.
    """

    def __init__(self, contact: Contact, points: Floats, surface: DCPSurface, head: HeadData) -> None:
        self.eye, self.radius = eye_of(contact, head)
        places = contact.places[:, :, : contact_rows(contact)]
        at = surface.evaluate(places.reshape(-1, 2)).reshape(*places.shape[:3], 3)
        _, columns, rows, _ = at.shape
        distance = np.stack([_nearest(points, side.reshape(-1, 3)) for side in at])
        side = (distance[1] < distance[0]).astype(int)
        near = 1.0 - smoothstep(distance[side, np.arange(len(points))], 0.0, contact.reach_mm)
        share = np.ones(len(points)) if self.radius > 0 else np.where(side == 1, contact.share - 1.0, contact.share)
        self.ids = np.flatnonzero(near > 1e-3).astype(np.int64)
        self._rows = rows if self.radius > 0 else 1
        self._size, count = 2 * columns * self._rows, len(self.ids)
        self._beside, self._share = np.zeros((count, 2), np.int64), np.zeros((count, 2))
        for k, i in enumerate(self.ids):
            own = at[side[i]]
            x = np.interp(points[i, 0], own[..., 0].mean(axis=1), np.arange(columns))
            left = min(int(x), columns - 2)
            row = np.linalg.norm(own[left : left + 2] - points[i], axis=2).argmin(axis=1) % self._rows
            self._beside[k] = (side[i] * columns + np.array([left, left + 1])) * self._rows + row
            self._share[k] = near[i] * share[i] * np.array([1 - x + left, x - left])
        ball = np.array([*self.eye, self.radius, self._size])
        self._arrays = {"ids": self.ids, "beside": self._beside, "share": self._share, "ball": ball}
        self._bound = make_table(self._arrays)

    def apply(self, push: Floats, points: Floats) -> None:
        """Add what :meth:`ContactSolver.apply` returned to control points (n, 3)."""
        follow_bound(self._bound, push, points)


def close_nearly(gaps: Floats, firm: Floats) -> None:
    """Make gaps at rest (2, k), mm, of sides that nearly touch everywhere those of sides that do, in place: an identity
    mixed into a head may leave its lips some tenths of a millimetre apart, which no expression could close then.

    firm : (k,) 0..1, by which share in each column.
    """
    if gaps.max() < NEARLY_MM:
        gaps[:] = (1.0 - firm) * gaps + firm * np.minimum(gaps, -HIDDEN_MM)  # exactly the latter where firm is 1


def outer_columns(profiles: Floats) -> Floats:
    """Return (k,): 1 at the corners of lips whose ``profiles (2, k, m, 3)`` at rest are given, 0 in the middle."""
    x = profiles[..., 0].mean(axis=(0, 2))
    out: Floats = smoothstep(np.abs(x - 0.5 * (x[0] + x[-1])) / (0.5 * np.ptp(x)), *ROUND_FROM_TO)
    return out


def corner_fade(columns: int) -> Floats:
    """Return (columns,): small at both ends of an opening, 1 from some columns inwards; 0 at the corners, half a column
    beyond the outermost. Where the sides of a mesh are apart close to a corner, which cannot move, closing them there
    would fold the skin beside it, and leaving them as they are would show a hole."""
    from_corner = 0.5 + np.minimum(np.arange(columns), np.arange(columns)[::-1])
    fade: Floats = smoothstep(from_corner / _CORNER_COLUMNS)
    return fade


def eye_of(contact: Contact, head: HeadData) -> tuple[Floats, float]:
    """Return centre (3,) and radius of a contact's eyeball; radius 0 for lips."""
    if contact.eye < 0:
        return np.zeros(3), 0.0
    return np.ascontiguousarray(head.eyes[contact.eye], np.float64), head.eye_radius


def weights_at(surface: DCPSurface, uv: Floats) -> tuple[Ints, Ints, Floats]:
    """Return rational weights of a surface's points at places (s, 2), without scipy: those of place k are ``share
    (m,)`` of the points ``ids (m,)`` from ``start[k]`` to ``start[k + 1]``."""
    samples, sides, _ = surface.sample(uv, None)
    arrays, bins = surface.arrays(), surface.bin_arrays()
    capacity = row_capacity(*bins[:3], samples)
    data, ids = np.zeros((capacity, 3)), np.zeros(capacity, np.int32)
    start = np.zeros(len(uv) + 1, np.int64)
    used = fill_rows(*arrays[:4], arrays[5], *bins, samples, sides, data, ids, start)
    rows = np.repeat(np.arange(len(uv)), np.diff(start))
    share = data[:used, 0] / np.bincount(rows, data[:used, 0], len(uv))[rows]
    counts = share > MIN_WEIGHT
    rows, share, ids = rows[counts], share[counts], ids[:used][counts]
    start = np.searchsorted(rows, np.arange(len(uv) + 1))
    return start, ids.astype(np.int64) % surface.n, share / np.bincount(rows, share, len(uv))[rows]


def lip_weights(contact: Contact, surface: DCPSurface) -> SampleWeights:
    """Return how samples of lips that can touch depend on control points.

    Rows beyond the inner ones, :data:`INNER_SHARE` of all, take only points that those take, so that shapes of brows
    and cheeks leave all of them alone. At rest they lie where all points put them.
    """
    rows = contact_rows(contact)
    places = contact.places[:, :, :rows].reshape(-1, 2)
    start, ids, share = weights_at(surface, places)
    sample = np.repeat(np.arange(len(places)), np.diff(start))
    inner = np.unique(ids[sample % rows < round(INNER_SHARE * rows)])
    kept = np.isin(ids, inner)
    kept |= ~np.isin(sample, sample[kept])  # a sample without any of them takes all
    less = np.where(kept, share, 0.0)
    less /= np.bincount(sample, less, len(places))[sample]
    moves = (share - less)[:, None] * surface.points[ids]
    offset = np.zeros((len(places), 3))
    np.add.at(offset, sample, moves)
    start = np.searchsorted(sample[kept], np.arange(len(places) + 1))
    return SampleWeights(start, ids[kept], less[kept], offset)


def tile_weights(start: Ints, ids: Ints, share: Floats) -> tuple[Ints, Ints, Shorts]:
    """Return weights as :func:`weights_at` gives them, for eight places at a time: tile t takes eight ``share (8 m,)``,
    in steps of :data:`.contact_kernels.SHARE_STEP`, each of the points ``ids (m,)`` from ``start[t]`` to
    ``start[t + 1]``."""
    places, n = len(start) - 1, int(ids.max(initial=0)) + 1
    tile, lane = np.divmod(np.repeat(np.arange(places), np.diff(start)), LANES)
    keys, back = np.unique(tile * n + ids, return_inverse=True)
    packed = np.zeros((len(keys), LANES), np.int16)
    packed[back, lane] = np.rint(share / SHARE_STEP)
    tile_start = np.searchsorted(keys, n * np.arange(-(-places // LANES) + 1))
    return tile_start.astype(np.int64), keys % n, packed.ravel()


def by_lanes(table: Floats) -> tuple[Shorts, Floats]:
    """Return ``table (s, k)`` for sixteen columns at a time, (16 b s,): of the first, row after row, then of the
    next; and the step (k,) of each column, of which its numbers are whole multiples: reading what other work has driven
    out of the caches takes longer than the sums, and so half as long as with float32."""
    rows, columns = table.shape
    padded = np.zeros((rows, -(-columns // PAIR) * PAIR), np.int16)
    steps = np.maximum(np.abs(table).max(axis=0), 1e-30) / MAX_SHORT
    padded[:, :columns] = np.rint(table / steps)
    return np.ascontiguousarray(padded.reshape(rows, -1, PAIR).transpose(1, 0, 2)).ravel(), steps


def _nearest(points: Floats, others: Floats) -> Floats:
    """Return (n,): distance of each of points (n, 3) from the nearest of others (m, 3)."""
    square = (points**2).sum(axis=1)[:, None] - 2.0 * points @ others.T + (others**2).sum(axis=1)
    distance: Floats = np.sqrt(np.maximum(square.min(axis=1), 0.0))
    return distance


def _inverse(start: Ints, ids: Ints, share: Floats, points: Floats, regularisation: float) -> tuple[Ints, Floats]:
    """Return control points (k,) of ``points (n, 3)`` that reach the samples, and (s, k) how far each moves, in least
    squares, per sample that is to move by 1; read-only. Points that mostly act elsewhere, or are far from every
    sample, are left out. The same head loaded again, as with a control point added elsewhere, finds what was found
    before."""
    reached = points[: int(ids.max()) + 1]
    key = blake2b(b"".join(np.ascontiguousarray(each).tobytes() for each in (start, ids, share, reached))).digest()
    known = key + str(regularisation).encode()
    found = _FOUND.pop(known, None) or _find_inverse(start, ids, share, reached, regularisation)
    _FOUND[known] = found
    while len(_FOUND) > _MAX_CACHED:
        _FOUND.popitem(last=False)
    return found


def _find_inverse(
    start: Ints, ids: Ints, share: Floats, points: Floats, regularisation: float
) -> tuple[Ints, Floats]:  # fmt: skip
    dense = np.zeros((len(start) - 1, int(ids.max()) + 1))
    np.add.at(dense, (np.repeat(np.arange(len(dense)), np.diff(start)), ids), share)
    used = np.flatnonzero(dense.max(axis=0) > MIN_SHARE).astype(np.int64)
    used = used[_nearest(points[used], dense @ points[: dense.shape[1]]) < FAR_MM]
    dense = dense[:, used]
    normal = dense.T @ dense
    normal[np.diag_indices(len(used))] += regularisation
    table = np.ascontiguousarray(np.linalg.solve(normal, dense.T).T)
    for array in (used, table):
        array.flags.writeable = False
    return used, table


def contact_rows(contact: Contact) -> int:
    """Number of rows from the rim on that can touch the other side."""
    return round(CONTACT_SHARE * int(contact.places.shape[2]))


def _column_moves(contact: Contact) -> Floats:
    """Return (s, 2 k): how far each sample moves per push of each column: up by the contact's share, down by the
    rest.
    """
    _, columns, rows, _ = contact.places.shape
    touching = contact_rows(contact)
    row = np.ones(rows)
    row[touching:] -= smoothstep(np.linspace(0.0, 1.0, rows - touching + 1)[1:])
    out = np.zeros((2, columns, rows, 2, columns))
    for side, part in enumerate((contact.share, contact.share - 1.0)):
        for k in range(columns):
            out[side, k, :, side, k] = part * row
    return out.reshape(-1, 2 * columns)
