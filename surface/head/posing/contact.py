"""Lips and lids that meet: where the two sides of an opening would pass through each other, both give way; and what
lies on an eyeball stays on it, wherever the cornea is.

Columns of samples run across an opening's upper and lower side. What overlaps is found column by column in every
pose, so that any mixture of parameters is covered, and control points near the rim move by it. How they move is
worked out once, by least squares over the samples.
"""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats, Floats32, Ints
from surface.dcp import DCPSurface
from surface.deform.lists import LANES
from surface.head.model.data import Contact, HeadData, PartData
from surface.head.posing.contact_kernels import (
    find_heights,
    find_lifts,
    find_overlap,
    lift_points,
    move_points,
    place_samples,
)
from surface.spline.kernels import fill_rows, row_capacity

CONTACT_SHARE = 2 / 3  # of the rows at an opening: those that can meet the other side; in the others motion fades out
SOFT_MM = 0.1
OVERLAP_MM = (0.28, 0.9)  # so deep lips and lids may overlap: triangles cut about that off the edges of both sides
PASSES, TOLERANCE_MM = 3, 0.1  # further passes take what bending left over of more than that
LIFT_GAIN = 1.6  # of what a lid is off: least squares hold it back, because its neighbours need not move
LID_MM = 1.2  # a lid is this thick: what rests nearer to the eyeball than that never sinks further
TOUCH_MM = 0.05  # what rests on the eyeball keeps this far away
HOLD_MM = (1.2, 2.4)  # what rests nearer to the eyeball than that never comes off it; what rests further may
AHEAD = np.array([0.0, 0.0, 1.0])
REGULARISATION = (0.02, 0.05)  # for lips and lids: weight of moving no control point, beside a sample's
LEAST_WEIGHT = 0.004  # of a sample: points with less are left out of it
FAR_MM = 18.0  # from every sample: points of large spans that stand there would move brow and chin
LEAST_SHARE = 0.02  # of a sample: points with less everywhere are not moved


class ContactSolver:
    """Keeps the two sides of one opening apart, and lids off the eyeball, on the part that has the opening.

    Parameters
    ----------
    contact : which opening; part : the part that has it; head : for the eyes.
    """

    def __init__(self, contact: Contact, part: PartData, surface: DCPSurface, head: HeadData) -> None:
        self.contact = contact
        self.eye, self.radius = eye_of(contact, head)
        start, ids, share = shares_at(surface, contact.places.reshape(-1, 2))
        self._near = np.unique(ids)
        self._tiles, self._room = tiled(start, ids, share), np.empty(3 * LANES, np.float32)
        self._samples = np.empty((*contact.places.shape[:3], 3))
        self._rows = contact_rows(contact)
        self._place(surface.points)
        self._limits = _limits(self._samples, self.radius)
        self.ids, table = _inverse(start, ids, share, surface.points, REGULARISATION[self.radius > 0])
        self._lift, self._away = table.astype(np.float32), _spread(contact).T @ table
        self._overlap = np.zeros((2, contact.places.shape[1]))
        self._before = np.empty((2, *self._overlap.shape, self._rows))
        self.push = np.zeros(self._before.size if self.radius > 0 else self._overlap.size)
        self._found = np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3))

    def _place(self, points: Floats) -> None:
        flat = self._samples.reshape(-1, 3)
        place_samples(*self._tiles, points, self.eye, self.radius, self._room, flat)

    def apply(self, axis: Floats, points: Floats) -> Floats:
        """Correct control points (n, 3) in place; returns what :meth:`Follower.apply` takes.

        For lips that is the overlap (2 k,) in mm that was found in each column, for lids how far their samples (2 k m,)
        slid and how far they were lifted. ``axis (3,)`` is where the eye looks. The result is the solver's own and is
        overwritten each time. Where neither the points near the opening nor the eye have moved, the last answer holds.
        """
        before, (looked, found, moved) = points[self._near], self._found
        if np.array_equal(axis, looked) and np.array_equal(before, found):
            points[self.ids] = moved
        else:
            self._resolve(axis, points)
            self._found = np.array(axis), before, points[self.ids]
        return self.push

    def _resolve(self, axis: Floats, points: Floats) -> None:
        """Move control points (n, 3) in place, and leave in ``push`` what was asked of them.

        Lids are laid on the eyeball before they are parted: that opens them.
        """
        self.push[:] = 0.0
        self._place(points)
        self._before[:] = self._now()
        for _ in range(PASSES):
            laid = self._lay(axis, points)
            off = max(laid, self._part(points))
            self._place(points)
            if off < TOLERANCE_MM:
                break
        if self.radius > 0:
            self.push[:] = (self._now() - self._before).ravel()

    def _now(self) -> Floats:
        """(2, 2, k, m) height and depth of the samples that can meet, as they are placed."""
        return self._samples[:, :, : self._rows, 1:].transpose(3, 0, 1, 2)

    def _part(self, points: Floats) -> float:
        """Move the sides, whose samples are placed, apart where they overlap; returns the deepest overlap, mm."""
        find_overlap(self._samples[:, :, : self._rows], OVERLAP_MM[self.radius > 0], SOFT_MM, self._overlap)
        if self.radius <= 0:
            self.push += self._overlap.ravel()
        move_points(self.ids, self._overlap.ravel(), self._away, self.eye, self.radius, False, points)
        return float(self._overlap.max())

    def _lay(self, axis: Floats, points: Floats) -> float:
        """Keep lids, whose samples are placed, on the eyeball, and place them anew; returns how far the furthest was
        off, mm."""
        if self._limits is None:
            return 0.0
        samples = self._samples.reshape(-1, 3)
        off = self._limits.find(samples, axis)
        if off > 0.0:
            lift_points(self.ids, self._limits.lifts, samples, self.radius, self._lift, points)
            self._place(points)
        return off


class HeightLimits:
    """Says how samples of a lid must move so that it lies on an eyeball as it does at rest.

    Parameters
    ----------
    samples : (s, 3) at rest, as :func:`place_samples` gives them; radius : the eyeball's. The eye looks ahead.
    held : do they stay on the eyeball? If not, they only keep out of it.

    Attributes
    ----------
    lifts : (s,) what :meth:`find` found, mm.
    """

    def __init__(self, samples: Floats, radius: float, *, held: bool) -> None:
        self._radius = radius
        self._heights, self.lifts = np.empty(len(samples)), np.empty(len(samples))
        find_heights(samples, radius, AHEAD, self._heights)
        self._most = np.maximum(self._heights, TOUCH_MM)
        self._least = np.minimum(self._most, LID_MM if held else TOUCH_MM)
        t = np.clip((HOLD_MM[1] - self._most) / (HOLD_MM[1] - HOLD_MM[0]), 0.0, 1.0)
        self._hold = t * t * (3.0 - 2.0 * t) * held

    def find(self, samples: Floats, axis: Floats) -> float:
        """Fill ``lifts`` for samples (s, 3) over an eye that looks along ``axis (3,)``; returns how far the furthest
        is off, mm."""
        find_heights(samples, self._radius, axis, self._heights)
        return float(find_lifts(self._heights, self._least, self._most, self._hold, LIFT_GAIN, self.lifts))


class Follower:
    """Moves the control points of another part that lie near an opening along with it: at lids, each as the sample
    next to it in two columns; at lips, by what each side gives way.

    Parameters
    ----------
    contact : which opening; points : (n, 3) of the part at rest; surface : of the part that has it.
    """

    def __init__(self, contact: Contact, points: Floats, surface: DCPSurface, head: HeadData) -> None:
        self.eye, self.radius = eye_of(contact, head)
        places = contact.places[:, :, : contact_rows(contact)]
        at = surface.evaluate(places.reshape(-1, 2)).reshape(*places.shape[:3], 3)
        _, columns, rows, _ = at.shape
        distance = np.stack([_nearest(points, side.reshape(-1, 3)) for side in at])
        side = (distance[1] < distance[0]).astype(int)
        t = np.clip(distance[side, np.arange(len(points))] / contact.reach_mm, 0.0, 1.0)
        near = 1.0 - t * t * (3.0 - 2.0 * t)
        share = np.ones(len(points)) if self.radius > 0 else np.where(side == 1, contact.share - 1.0, contact.share)
        self.ids = np.flatnonzero(near > 1e-3).astype(np.int64)
        table = np.zeros((2, columns, rows if self.radius > 0 else 1, len(self.ids)))
        for k, i in enumerate(self.ids):
            own = at[side[i]]
            x = np.interp(points[i, 0], own[..., 0].mean(axis=1), np.arange(columns))
            left = min(int(x), columns - 2)
            row = np.linalg.norm(own[left : left + 2] - points[i], axis=2).argmin(axis=1) % table.shape[2]
            parts = near[i] * share[i] * np.array([1 - x + left, x - left])
            table[side[i], [left, left + 1], row, k] = parts
        self._with = table.reshape(-1, len(self.ids))

    def apply(self, push: Floats, points: Floats) -> None:
        """Add what :meth:`ContactSolver.apply` asks of control points (n, 3)."""
        for k, asked in enumerate(push.reshape(-1, len(self._with))):
            move_points(self.ids, asked, self._with, self.eye, self.radius, k == 1, points)


class EyeballClearance:
    """Keeps what lines the lids out of the eyeball.

    Parameters
    ----------
    surface : of the lining; places : (s, 2) in (u, v), all over what lies near the eyeball; eye, radius : the eyeball.
    """

    def __init__(self, surface: DCPSurface, places: Floats, eye: Floats, radius: float) -> None:
        self.eye, self.radius = np.ascontiguousarray(eye, np.float64), radius
        start, ids, share = shares_at(surface, places)
        self._tiles, self._room = tiled(start, ids, share), np.empty(3 * LANES, np.float32)
        self.ids, table = _inverse(start, ids, share, surface.points, REGULARISATION[1])
        self._lift, self._samples = table.astype(np.float32), np.empty((len(places), 3))
        self._place(surface.points)
        self._limits = HeightLimits(self._samples, radius, held=False)

    def _place(self, points: Floats) -> None:
        place_samples(*self._tiles, points, self.eye, self.radius, self._room, self._samples)

    def apply(self, axis: Floats, points: Floats) -> None:
        """Correct control points (n, 3) in place; ``axis (3,)`` is where the eye looks."""
        for _ in range(PASSES):
            self._place(points)
            if self._limits.find(self._samples, axis) < TOLERANCE_MM:
                return
            lift_points(self.ids, self._limits.lifts, self._samples, self.radius, self._lift, points)


def eye_of(contact: Contact, head: HeadData) -> tuple[Floats, float]:
    """Centre (3,) and radius of the eyeball that a contact's heights go round; radius 0 for lips."""
    if contact.eye < 0:
        return np.zeros(3), 0.0
    return np.ascontiguousarray(head.eyes[contact.eye], np.float64), head.eye_radius


def _limits(samples: Floats, radius: float) -> HeightLimits | None:
    """What keeps lids on an eyeball; None for lips."""
    return HeightLimits(samples.reshape(-1, 3), radius, held=True) if radius > 0 else None


def shares_at(surface: DCPSurface, uv: Floats) -> tuple[Ints, Ints, Floats]:
    """The rational weights of a surface's points at places (s, 2), without scipy: those of place k are ``share (m,)``
    of the points ``ids (m,)`` from ``start[k]`` to ``start[k + 1]``."""
    samples, sides, _ = surface.sample(uv, None)
    arrays, bins = surface.arrays(), surface.bin_arrays()
    capacity = row_capacity(*bins[:3], samples)
    data, ids = np.zeros((capacity, 3)), np.zeros(capacity, np.int32)
    start = np.zeros(len(uv) + 1, np.int64)
    used = fill_rows(*arrays[:4], arrays[5], *bins, samples, sides, data, ids, start)
    rows = np.repeat(np.arange(len(uv)), np.diff(start))
    share = data[:used, 0] / np.bincount(rows, data[:used, 0], len(uv))[rows]
    felt = share > LEAST_WEIGHT
    rows, share, ids = rows[felt], share[felt], ids[:used][felt]
    start = np.searchsorted(rows, np.arange(len(uv) + 1))
    return start, ids.astype(np.int64) % surface.n, share / np.bincount(rows, share, len(uv))[rows]


def tiled(start: Ints, ids: Ints, share: Floats) -> tuple[Ints, Ints, Floats32]:
    """Shares as :func:`shares_at` gives them, for eight places at a time: tile t takes eight ``share (8 m,)`` each of
    the points ``ids (m,)`` from ``start[t]`` to ``start[t + 1]``."""
    places, n = len(start) - 1, int(ids.max(initial=0)) + 1
    tile, lane = np.divmod(np.repeat(np.arange(places), np.diff(start)), LANES)
    keys, back = np.unique(tile * n + ids, return_inverse=True)
    packed = np.zeros((len(keys), LANES), np.float32)
    packed[back, lane] = share
    tile_start = np.searchsorted(keys, n * np.arange(-(-places // LANES) + 1))
    return tile_start.astype(np.int64), keys % n, packed.ravel()


def _nearest(points: Floats, others: Floats) -> Floats:
    """(n,) distance of each of points (n, 3) from the nearest of others (m, 3)."""
    square = (points**2).sum(axis=1)[:, None] - 2.0 * points @ others.T + (others**2).sum(axis=1)
    distance: Floats = np.sqrt(np.maximum(square.min(axis=1), 0.0))
    return distance


def _inverse(start: Ints, ids: Ints, share: Floats, points: Floats, stiff: float) -> tuple[Ints, Floats]:
    """Control points (k,) of ``points (n, 3)`` that reach the samples, and (s, k) how far each moves, in least squares,
    for every sample that shall move by 1. A point that mostly acts elsewhere, or stands far off, is left alone."""
    dense = np.zeros((len(start) - 1, int(ids.max()) + 1))
    np.add.at(dense, (np.repeat(np.arange(len(dense)), np.diff(start)), ids), share)
    used = np.flatnonzero(dense.max(axis=0) > LEAST_SHARE).astype(np.int64)
    used = used[_nearest(points[used], dense @ points[: dense.shape[1]]) < FAR_MM]
    dense = dense[:, used]
    normal = dense.T @ dense
    normal[np.diag_indices(len(used))] += stiff
    return used, np.ascontiguousarray(np.linalg.solve(normal, dense.T).T)


def contact_rows(contact: Contact) -> int:
    """How many rows from the rim on can meet the other side."""
    return round(CONTACT_SHARE * int(contact.places.shape[2]))


def _spread(contact: Contact) -> Floats:
    """(s, 2 k) how far each sample moves for a push of each column: up by the contact's share of it, down by the
    rest."""
    _, columns, rows, _ = contact.places.shape
    meeting = contact_rows(contact)
    t = np.linspace(0.0, 1.0, rows - meeting + 1)[1:]
    row = np.concatenate([np.ones(meeting), 1.0 - t * t * (3.0 - 2.0 * t)])
    out = np.zeros((2, columns, rows, 2, columns))
    for side, part in enumerate((contact.share, contact.share - 1.0)):
        for k in range(columns):
            out[side, k, :, side, k] = part * row
    return out.reshape(-1, 2 * columns)
