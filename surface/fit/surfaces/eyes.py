"""Find the eyeballs among the surfaces of a file: two spheres of one size, side by side, which the gaze turns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats
from surface.fit.source.kinds import kind_of
from surface.fit.surfaces.pieces import Piece

MAX_FIT_ERROR = 0.06  # root mean square distance of an eyeball's samples from a sphere, in radii
MIN_EXTENT = 0.75  # of an eyeball along each axis, in radii: the front half of a sphere is 1 deep
MAX_RADIUS_DIFFERENCE = 0.15  # between the radii of both eyeballs, in radii
SPACING = (2.2, 9.0)  # minimum and maximum distance between both centres, in radii
MAX_OFFSET = 0.35  # difference of both centres in height or depth, relative to their distance in x
EYE_REACH = 1.3  # pieces that lie wholly within this distance from an eye's centre, in radii, belong to the eye


@dataclass(frozen=True)
class Eyeballs:
    """centres : (2, 3), left first, mm; radius : mm. pieces : indices of the left eye's and the right eye's."""

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
    residuals = np.linalg.norm(local - found[:3], axis=1) - radius
    return middle + found[:3], radius, float(np.sqrt((residuals**2).mean()))


def find_eyeballs(pieces: Sequence[Piece], points: Sequence[Floats]) -> Eyeballs | None:
    """The largest pair of spheres that can be eyes; None where there is none. If any sphere is named as an
    eye, only those are considered.

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
    centre, radius, rms = sphere(points)
    if not rms < MAX_FIT_ERROR * radius or not (np.ptp(points, axis=0) > MIN_EXTENT * radius).all():
        return None
    return centre, radius


def _are_pair(a: tuple[int, Floats, float], b: tuple[int, Floats, float]) -> bool:
    apart = np.abs(a[1] - b[1])
    radius = 0.5 * (a[2] + b[2])
    alike = abs(a[2] - b[2]) < MAX_RADIUS_DIFFERENCE * radius
    beside = apart[1:].max() < MAX_OFFSET * apart[0]
    return bool(alike and beside and SPACING[0] * radius < apart[0] < SPACING[1] * radius)


def _within(points: Floats, centre: Floats, radius: float) -> bool:
    return bool(np.linalg.norm(points - centre, axis=1).max() < EYE_REACH * radius)
