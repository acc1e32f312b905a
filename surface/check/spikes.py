"""Find spikes: points that stick out from the surface on all sides, at rest, where they can be seen, or in a pose.

The height of a vertex is its least distance, along one direction, above the samples on a ring of some millimetres
around it. A ridge, such as the rim of an ear or of a lid, has no height: the ring meets the ridge on either side.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from surface.base.arrays import Bools, Floats, Floats32, Ints
from surface.base.jit import kernel, nonallocating
from surface.check.borders import Borders
from surface.check.cells import any_nearer, cubes, sort_into_cells
from surface.check.findings import AGAIN, Finding
from surface.check.places import Places
from surface.check.sight import seen_vertices
from surface.check.subject import Subject
from surface.head.model.parameters import SHAPES

RINGS = {6.0: 0.55, 12.0: 0.45}  # radius of a ring, mm on a head of usual size: greatest height at rest, in radii
RING = (0.75, 1.3)  # inner and outer edge of a ring, in radii
OFF_RIM = 0.5  # distance from a free border, in radii, within which no height is measured
MOVED = 0.5  # greatest height in the displacements of a pose, in radii; corners of mouth and eyes have up to 0.35
MIRRORED = 0.8  # the same where both sides move alike: a small drawn mouth purses by half its width
PAIRED = 0.6  # least height at the mirror image, relative to the greatest allowed, for both sides to count as alike
MIRROR_MM = 10.0  # greatest distance from the mirror image at which a horn or pointed ear counts as the other of a pair
NOSE = 0.35  # half the width of the nose, in distances of the eyes: a nose may have any length
SPACING = 0.6  # of the samples, in radii of the ring
MAX_LISTED = 1 << 25  # samples on all rings together; the shipped head has 3 million
MAX_STEPS = 40  # samples along an edge: a triangle that needs more is wrong anyway


@nonallocating
def ring_heights(points: Any, own: Any, first: Any, last: Any, order: Any, ring: Any, values: Any, enough: float,
                 out: Any) -> None:  # fmt: skip
    """Fill ``out (k,)`` with the height of each of the first k of values (m, 3) above those on its ring.

    The ring of value i holds the values of all points (m, 3) between ``ring (2,)`` mm from point i. All of these, and
    perhaps others, are those of ``order`` from ``first[own[i], c]`` to ``last[own[i], c]``, for every column c.

    The height is measured along the mean direction from them to the value. It is 0 where one of them is nearer than
    ``enough``, since the height cannot be greater than that distance.
    """
    for i in range(len(out)):
        near = first[own[i]], last[own[i]], order
        x, y, z = _sum_from_ring(points, i, *near, ring, values, enough)
        length = np.sqrt(x * x + y * y + z * z)
        out[i] = 0.0
        if length >= 1e-9:
            out[i] = _least_along(points, i, *near, ring, values, x / length, y / length, z / length)


@nonallocating
def _sum_from_ring(
    points: Any, i: int, first: Any, last: Any, order: Any, ring: Any, values: Any, enough: float
) -> Any:
    """Sum of the ways to value i from those on its ring; none at all where one of them is nearer than ``enough``."""
    x, y, z = 0.0, 0.0, 0.0
    for column in range(len(first)):
        for e in range(first[column], last[column]):
            j = order[e]
            if on_ring(points, i, j, ring):
                dx, dy, dz = values[i, 0] - values[j, 0], values[i, 1] - values[j, 1], values[i, 2] - values[j, 2]
                if dx * dx + dy * dy + dz * dz < enough * enough:
                    return 0.0, 0.0, 0.0
                x, y, z = x + dx, y + dy, z + dz
    return x, y, z


@nonallocating
def _least_along(
    points: Any, i: int, first: Any, last: Any, order: Any, ring: Any, values: Any, x: float, y: float, z: float
) -> Any:  # fmt: skip
    """Return the least height of value i above one on its ring, along the unit vector (x, y, z)."""
    least = np.inf
    for column in range(len(first)):
        for e in range(first[column], last[column]):
            j = order[e]
            if on_ring(points, i, j, ring):
                dx, dy, dz = values[i, 0] - values[j, 0], values[i, 1] - values[j, 1], values[i, 2] - values[j, 2]
                least = min(least, dx * x + dy * y + dz * z)
    return least


@nonallocating
def on_ring(points: Any, i: int, j: int, ring: Any) -> Any:
    """Whether point j is between ``ring (2,)`` mm from point i."""
    a, b, c = points[i, 0] - points[j, 0], points[i, 1] - points[j, 1], points[i, 2] - points[j, 2]
    square = a * a + b * b + c * c
    return ring[0] * ring[0] <= square <= ring[1] * ring[1]


@nonallocating
def list_rings(points: Any, own: Any, first: Any, last: Any, order: Any, ring: Any, begin: Any, out: Any) -> int:
    """Write the rings of the first k points to ``out``, as far as it is long enough, and to ``begin (k + 1,)`` where
    each begins there; returns the length of all. Others as in :func:`ring_heights`."""
    used = 0
    for i in range(len(begin) - 1):
        begin[i] = used
        for column in range(9):
            for e in range(first[own[i], column], last[own[i], column]):
                if on_ring(points, i, order[e], ring):
                    if used < len(out):
                        out[used] = order[e]
                    used += 1
    begin[len(begin) - 1] = used
    return used


@kernel
def mix(rows: Any, corners: Any, share: Any, values: Any, out: Any) -> None:
    """Fill ``rows`` of ``out (m, 3)`` with means of values (v, 3) at ``corners (m, 3)``, weights ``share (m, 3)``."""
    for row in rows:
        for c in range(3):
            out[row, c] = 0.0
            for k in range(3):
                out[row, c] += share[row, k] * values[corners[row, k], c]


@dataclass(frozen=True)
class Samples:
    """Vertices and further places on large triangles of the skin, close enough for rings.

    part : (m,) number of the part. corners : (m, 3) vertices of it. share : (m, 3) weight of each corner.
    vertices : how many samples are vertices; these come first.
    """

    part: Ints
    corners: Ints
    share: Floats
    vertices: int

    def at(self, vertices: list[Floats32]) -> Floats:
        """Return (m, 3): values at the samples, interpolated from those at the vertices (v, 3) of every part."""
        out = np.empty((len(self.part), 3))
        for k in np.unique(self.part):
            mix(np.flatnonzero(self.part == k), self.corners, self.share, vertices[k], out)
        return out


def find_samples(subject: Subject, spacing: float) -> Samples:
    """Return samples of all skin that deforms, no further apart than ``spacing`` mm; vertices come first."""
    found, more = [], []
    for k, part in enumerate(subject.parts):
        if part.material == "skin" and part.follows == "skin":
            used = np.unique(part.triangles)
            corners, share = _sample_triangles(
                subject.rest[k].astype(np.float64), part.triangles.astype(np.int64), spacing
            )
            whole = np.tile([1.0, 0.0, 0.0], (len(used), 1))
            found.append((np.full(len(used), k), np.repeat(used[:, None], 3, axis=1), whole))
            more.append((np.full(len(corners), k), corners, share))
    none = np.zeros(0, np.int64), np.zeros((0, 3), np.int64), np.zeros((0, 3))
    number, corners, share = (np.concatenate(x) for x in zip(none, *found, *more, strict=True))
    return Samples(number.astype(np.int64), corners.astype(np.int64), share, sum(len(x[0]) for x in found))


def _sample_triangles(at: Floats, triangles: Ints, spacing: float) -> tuple[Ints, Floats]:
    """Return corners (m, 3) and weights (m, 3) of places inside triangles that have edges longer than ``spacing``
    mm.
    """
    corner = at[triangles]
    longest = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max(axis=1)
    steps = np.minimum(np.ceil(longest / spacing), MAX_STEPS).astype(int)
    corners, shares = [np.zeros((0, 3), np.int64)], [np.zeros((0, 3))]
    for n in np.unique(steps[steps > 1]):
        i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
        inner = (i + j <= n) & ~((i == n) | (j == n) | (i + j == 0))
        share = np.stack([n - i - j, i, j], axis=-1)[inner] / n
        rows = triangles[steps == n]
        corners.append(np.repeat(rows, len(share), axis=0))
        shares.append(np.tile(share, (len(rows), 1)))
    return np.concatenate(corners), np.concatenate(shares)


class Rings:
    """Samples round each of the first ``count`` of points (m, 3), between two distances from it.

    They are listed, unless the lists would be longer than :data:`MAX_LISTED`: these grow with the square of how
    densely samples lie. Then they are searched for at every question.
    """

    def __init__(self, points: Floats, count: int, radius: float) -> None:
        self._points, self._count, self._ring = np.ascontiguousarray(points), count, np.multiply(RING, radius)
        cells = sort_into_cells(self._points, self._ring[1])
        near = cells.own, *cells.columns(), cells.order
        begin, ids = np.zeros(count + 1, np.int64), np.zeros(0, np.int64)
        used = list_rings(self._points, *near, self._ring, begin, ids)
        if used <= MAX_LISTED:
            ids = np.zeros(used, np.int64)
            list_rings(self._points, *near, self._ring, begin, ids)
            near = np.arange(count), begin[:count, None], begin[1:, None], ids
        self._near = near

    def heights(self, values: Floats, enough: float = 0.0) -> Floats:
        """Return (k,): height of each of the first k of values (m, 3); it may be 0 where it is less than ``enough``."""
        out = np.zeros(self._count)
        ring_heights(self._points, *self._near, self._ring, np.ascontiguousarray(values), enough, out)
        return out


def drop_rims(points: Floats, rims: Floats, height: Floats, least: float, off: float) -> Floats:
    """Return ``height (k,)`` of the first k of points (m, 3), 0 where it is below ``least``, and where a point of a
    free border, ``rims (r, 3)``, is nearer than ``off`` mm: corners of a border always stick out."""
    rows = np.flatnonzero(height > least)
    rows = rows[~any_nearer(points[rows], rims, off)]
    out = np.zeros(len(height))
    out[rows] = height[rows]
    return out


def spikes(subject: Subject, places: Places, borders: Borders) -> Iterator[Finding]:
    """Find the steepest spike at rest, and the steepest in any pose."""
    rims = borders.at(subject.rest)[~borders.sewn].reshape(-1, 3)
    found = [_spikes(subject, places, rims, r * subject.scale, steep) for r, steep in RINGS.items()]
    for kind in zip(*found, strict=True):
        if steepest := max((x for x in kind if x is not None), default=None):
            yield Finding("spike", steepest[1], AGAIN)


def _spikes(
    subject: Subject, places: Places, rims: Floats, radius: float, steep: float
) -> list[tuple[float, str] | None]:
    """For one ring the steepest spike at rest and in a pose, each as steepness and text; None where there is none."""
    samples = find_samples(subject, SPACING * radius)
    if not samples.vertices:
        return [None, None]
    at, off = samples.at(subject.rest), OFF_RIM * radius
    rings = Rings(at, samples.vertices, radius)
    height = drop_rims(at, rims, rings.heights(at), PAIRED * steep * radius, off)
    height[_may_stick_out(subject, at[: samples.vertices], height, places)] = 0.0
    _drop_hidden(subject, samples, height, steep * radius)
    worst, best, name, where = int(height.argmax()), 0.0, "", 0
    for pose in (n for n in subject.claimed if n in SHAPES):
        moved = _heights_in_pose(
            subject, places, samples.at(subject.moves(pose)), rings, at, rims, radius, max(best, MOVED * radius)
        )
        if moved.max() > best:
            best, name, where = float(moved.max()), pose, int(moved.argmax())

    def found(when: str, row: int, high: float) -> tuple[float, str]:
        part = subject.parts[samples.part[row]].name
        return high / radius, f"{when}part {part!r} sticks out by {high:.1f} mm or more: {places.name(at[row])}"

    return [
        found("", worst, height[worst]) if height[worst] > steep * radius else None,
        found(f"with {name} = 1 ", where, best) if best > 0.0 else None,
    ]


def _drop_hidden(subject: Subject, samples: Samples, height: Floats, least: float) -> None:
    """Set ``height (k,)`` to 0 where nobody sees the sample at rest, as at the end of a bag that lines the mouth of a
    head without shapes; nothing is asked where none is above ``least``."""
    if (height > least).any():
        seen = seen_vertices(subject)
        for row in np.flatnonzero(height > 0.0):
            height[row] *= seen[samples.part[row]][samples.corners[row, 0]]


def _heights_in_pose(
    subject: Subject, places: Places, moves: Floats, rings: Rings, at: Floats, rims: Floats, radius: float,
    enough: float,
) -> Floats:  # fmt: skip
    """Return (k,): heights in the displacements ``moves (m, 3)`` of samples at (m, 3), mm.

    They are 0 below ``enough``, and where the other side of the face moves alike.
    """
    moved = drop_rims(at, rims, rings.heights(moves, enough), enough, OFF_RIM * radius)
    low = moved < MIRRORED * radius
    if (moved[low] > 0.0).any():
        height = drop_rims(at, rims, rings.heights(moves, PAIRED * enough), PAIRED * enough, OFF_RIM * radius)
        moved[low & _has_mirror_image(subject, at[: len(height)], height, places)] = 0.0
    return moved


def _has_mirror_image(subject: Subject, at: Floats, height: Floats, places: Places) -> Bools:
    """Return (k,): which samples at (k, 3) with a height (k,) above 0 have another such sample near their mirror
    image.
    """
    middle, far = places.centre[0], MIRROR_MM * subject.scale
    out = np.zeros(len(at), bool)
    steep = np.flatnonzero(height)
    if len(steep):
        points = np.ascontiguousarray(at[steep])
        mirrored = points * [-1.0, 1.0, 1.0] + [2.0 * middle, 0.0, 0.0]
        cells = sort_into_cells(points, far)
        out[steep] = mirror_images(points, mirrored, *cells.columns_at(cubes(mirrored, far)), cells.order, far)
    return out


@kernel
def mirror_images(points: Any, mirrored: Any, first: Any, last: Any, order: Any, far: float) -> Any:
    """Return (k,): whether any of points (k, 3) is nearer than ``far`` to the mirror image (k, 3) of each, and further
    than ``far`` to the side of the point itself.

    All points that near a mirror image are those of ``order`` from ``first[i, c]`` to ``last[i, c]``, for every column
    c.
    """
    out = np.zeros(len(points), np.bool_)
    for i in range(len(points)):
        for column in range(first.shape[1]):
            for e in range(first[i, column], last[i, column]):
                j = order[e]
                if abs(points[j, 0] - points[i, 0]) > far:
                    x, y = points[j, 0] - mirrored[i, 0], points[j, 1] - mirrored[i, 1]
                    z = points[j, 2] - mirrored[i, 2]
                    out[i] |= np.sqrt(x * x + y * y + z * z) < far
                if out[i]:
                    break
            if out[i]:
                break
    return out


def _may_stick_out(subject: Subject, at: Floats, height: Floats, places: Places) -> Bools:
    """Return (m,): which samples may stick out: those of the nose, and those that have a mirror image."""
    middle, apart = places.centre[0], places.apart
    out: Bools = np.abs(at[:, 0] - middle) < NOSE * apart
    out &= (at[:, 2] > places.centre[2]) & (at[:, 1] < places.centre[1] + 0.3 * apart)
    out &= at[:, 1] > places.centre[1] - 0.9 * places.down * apart
    return np.asarray(out | _has_mirror_image(subject, at, height, places))
