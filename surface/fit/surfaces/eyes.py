"""Find the eyeballs among the surfaces of a file: two spheres of one size, side by side, which gaze shall turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats
from surface.fit.source.kinds import kind_of
from surface.fit.surfaces.pieces import Piece

ROUND = 0.06  # most root mean square distance of an eyeball's samples from a sphere, in radii
COVER = 0.75  # least extent of an eyeball along each axis, in radii: the front half of a sphere is 1 deep
SAME = 0.15  # most difference between the radii of both eyeballs, in radii
APART = (2.2, 9.0)  # least and most distance between both centres, in radii
ALIGNED = 0.35  # most difference of both centres in height or depth, relative to their distance in x
INSIDE = 1.3  # pieces that lie wholly within this distance from an eye's centre, in radii, belong to the eye


@dataclass(frozen=True)
class Eyeballs:
    """centres : (2, 3), left first, mm; radius : mm. pieces : numbers of those of the left eye, of the right."""

    centres: Floats
    radius: float
    pieces: tuple[list[int], list[int]]


def sphere(points: Floats) -> tuple[Floats, float, float]:
    """Centre (3,), radius and root mean square distance of the sphere nearest to points (n, 3), by linear least
    squares on the squared distances."""
    middle = points.mean(axis=0)
    local = points - middle
    system = np.column_stack([2.0 * local, np.ones(len(local))])
    found, *_ = np.linalg.lstsq(system, (local**2).sum(axis=1), rcond=None)
    radius = float(np.sqrt(max(found[3] + found[:3] @ found[:3], 0.0)))
    off = np.linalg.norm(local - found[:3], axis=1) - radius
    return middle + found[:3], radius, float(np.sqrt((off**2).mean()))


def find_eyeballs(pieces: Sequence[Piece], points: Sequence[Floats]) -> Eyeballs | None:
    """The largest pair of spheres that can be eyes; None where there is none. Pieces named as eyes come first.

    points : samples (n, 3) of every piece, mm, in head axes.
    """
    balls = [(k, *found) for k, at in enumerate(points) if (found := _ball(at)) is not None]
    named = [ball for ball in balls if kind_of(pieces[ball[0]].title).rule == "eye"]
    pairs = [(a, b) for a in named or balls for b in named or balls if a[1][0] > b[1][0] and _are_pair(a, b)]
    if not pairs:
        return None
    left, right = max(pairs, key=lambda pair: pair[0][2] + pair[1][2])
    centres, radius = np.stack([left[1], right[1]]), 0.5 * (left[2] + right[2])
    sides = [[k for k, at in enumerate(points) if _within(at, centre, radius)] for centre in centres]
    return Eyeballs(centres, radius, (sides[0], sides[1]))


def _ball(points: Floats) -> tuple[Floats, float] | None:
    """Centre and radius of a sphere that samples (n, 3) cover most of; None where they do not."""
    centre, radius, off = sphere(points)
    if not off < ROUND * radius or not (np.ptp(points, axis=0) > COVER * radius).all():
        return None
    return centre, radius


def _are_pair(a: tuple[int, Floats, float], b: tuple[int, Floats, float]) -> bool:
    apart = np.abs(a[1] - b[1])
    radius = 0.5 * (a[2] + b[2])
    alike = abs(a[2] - b[2]) < SAME * radius
    beside = apart[1:].max() < ALIGNED * apart[0]
    return bool(alike and beside and APART[0] * radius < apart[0] < APART[1] * radius)


def _within(points: Floats, centre: Floats, radius: float) -> bool:
    return bool(np.linalg.norm(points - centre, axis=1).max() < INSIDE * radius)
