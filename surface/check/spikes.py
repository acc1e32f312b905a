"""Find spikes: points that stick out from the surface on all sides, at rest or in a pose.

The height of a vertex is its least distance, along one direction, above the samples on a ring of some millimetres
around it. A ridge, such as the rim of an ear or of a lid, has no height: the ring meets the ridge on either side.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from surface.base.arrays import Bools, Floats, Floats32, Ints
from surface.base.jit import kernel
from surface.check.borders import Borders
from surface.check.findings import AGAIN, Finding
from surface.check.places import Places
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
MOST_STEPS = 40  # samples along an edge: a triangle that needs more is wrong anyway


@kernel
def rings(points: Any, cells: Any, order: Any, start: Any, low: float, high: float, first: Any, out: Any) -> int:
    """List the points of points (m, 3) between ``low`` and ``high`` mm from each of the first k.

    cells : (m, 3) the cube of each point, ``high`` mm wide. order : (m,) points by cube; ``start[x, y, z]`` is where
        those of a cube begin and end in it.
    first : (k + 1,) filled with where each point's list begins in ``out``. out : filled as far as it is long enough.

    Returns the length of all lists.
    """
    used = 0
    nx, ny, nz = start.shape[0], start.shape[1], start.shape[2]
    for i in range(len(first) - 1):
        first[i] = used
        for x in range(max(0, cells[i, 0] - 1), min(nx, cells[i, 0] + 2)):
            for y in range(max(0, cells[i, 1] - 1), min(ny, cells[i, 1] + 2)):
                for z in range(max(0, cells[i, 2] - 1), min(nz, cells[i, 2] + 2)):
                    for k in range(start[x, y, z, 0], start[x, y, z, 1]):
                        j = order[k]
                        a, b, c = points[i, 0] - points[j, 0], points[i, 1] - points[j, 1], points[i, 2] - points[j, 2]
                        square = a * a + b * b + c * c
                        if low * low <= square <= high * high:
                            if used < len(out):
                                out[used] = j
                            used += 1
    first[len(first) - 1] = used
    return used


@kernel
def heights(values: Any, start: Any, ring: Any, enough: float, out: Any) -> None:
    """Fill ``out (k,)`` with the height of each of the first k of values (m, 3) above those on its ring.

    start, ring : those on the ring of value i are ``ring`` from ``start[i]`` to ``start[i + 1]``.

    The height is measured along the mean direction from them to the value. It is 0 where one of them is nearer than
    ``enough``, since the height cannot be greater than that distance.
    """
    for i in range(len(out)):
        out[i] = 0.0
        x, y, z = 0.0, 0.0, 0.0
        low = False
        for k in range(start[i], start[i + 1]):
            dx, dy, dz = (
                values[i, 0] - values[ring[k], 0], values[i, 1] - values[ring[k], 1], values[i, 2] - values[ring[k], 2],
            )  # fmt: skip
            if dx * dx + dy * dy + dz * dz < enough * enough:
                low = True
                break
            x, y, z = x + dx, y + dy, z + dz
        length = np.sqrt(x * x + y * y + z * z)
        if low or length < 1e-9:
            continue
        x, y, z = x / length, y / length, z / length
        least = np.inf
        for k in range(start[i], start[i + 1]):
            j = ring[k]
            dx, dy, dz = values[i, 0] - values[j, 0], values[i, 1] - values[j, 1], values[i, 2] - values[j, 2]
            least = min(least, dx * x + dy * y + dz * z)
        out[i] = least


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
        """(m, 3) values at the samples, interpolated from those at the vertices (v, 3) of every part."""
        out = np.empty((len(self.part), 3))
        for k in np.unique(self.part):
            mix(np.flatnonzero(self.part == k), self.corners, self.share, vertices[k], out)
        return out


def find_samples(subject: Subject, spacing: float) -> Samples:
    """Samples of all skin that deforms, no further apart than ``spacing`` mm; vertices come first."""
    found, more = [], []
    for k, part in enumerate(subject.parts):
        if part.material == "skin" and part.follows == "skin":
            used = np.unique(part.triangles)
            corners, share = _filled(subject.rest[k].astype(np.float64), part.triangles.astype(np.int64), spacing)
            whole = np.tile([1.0, 0.0, 0.0], (len(used), 1))
            found.append((np.full(len(used), k), np.repeat(used[:, None], 3, axis=1), whole))
            more.append((np.full(len(corners), k), corners, share))
    none = np.zeros(0, np.int64), np.zeros((0, 3), np.int64), np.zeros((0, 3))
    number, corners, share = (np.concatenate(x) for x in zip(none, *found, *more, strict=True))
    return Samples(number.astype(np.int64), corners.astype(np.int64), share, sum(len(x[0]) for x in found))


def _filled(at: Floats, triangles: Ints, spacing: float) -> tuple[Ints, Floats]:
    """Corners (m, 3) and weights (m, 3) of places inside triangles that have edges longer than ``spacing`` mm."""
    corner = at[triangles]
    longest = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max(axis=1)
    steps = np.minimum(np.ceil(longest / spacing), MOST_STEPS).astype(int)
    corners, shares = [np.zeros((0, 3), np.int64)], [np.zeros((0, 3))]
    for n in np.unique(steps[steps > 1]):
        i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
        inner = (i + j <= n) & ~((i == n) | (j == n) | (i + j == 0))
        share = np.stack([n - i - j, i, j], axis=-1)[inner] / n
        rows = triangles[steps == n]
        corners.append(np.repeat(rows, len(share), axis=0))
        shares.append(np.tile(share, (len(rows), 1)))
    return np.concatenate(corners), np.concatenate(shares)


@dataclass(frozen=True)
class Ring:
    """Samples round every vertex at rest: those of vertex i are ``ids`` from ``start[i]`` to ``start[i + 1]``."""

    start: Ints
    ids: Ints

    def heights(self, values: Floats, enough: float = 0.0) -> Floats:
        """(k,) height of each of the first k of values (m, 3); it may be 0 where it is less than ``enough``."""
        out = np.zeros(len(self.start) - 1)
        heights(np.ascontiguousarray(values), self.start, self.ids, enough, out)
        return out

    def without_rims(self, points: Floats, rims: Floats, height: Floats, least: float, off: float) -> Floats:
        """``height (k,)`` of the first k of points (m, 3), 0 where it is below ``least``, and where a point of a free
        border, ``rims (r, 3)``, is nearer than ``off`` mm: corners of a border always stick out."""
        rows = np.flatnonzero(height > least)
        out = np.zeros(len(height))
        for row in rows:
            if not (np.linalg.norm(rims - points[row], axis=1) < off).any():
                out[row] = height[row]
        return out


def find_rings(points: Floats, count: int, radius: float) -> Ring:
    """The rings of the first ``count`` of points (m, 3)."""
    low, high = RING[0] * radius, RING[1] * radius
    cells = np.floor((points - points.min(axis=0)) / high).astype(np.int64)
    shape = tuple(int(n) for n in cells.max(axis=0) + 1)
    flat = np.ravel_multi_index(tuple(cells.T), shape)
    order = np.argsort(flat, kind="stable")
    edges = np.searchsorted(flat[order], np.arange(int(np.prod(shape)) + 1))
    start = np.stack([edges[:-1], edges[1:]], axis=1).reshape(*shape, 2)
    begin, ids = np.zeros(count + 1, np.int64), np.zeros(0, np.int64)
    used = rings(points, cells, order, start, low, high, begin, ids)
    ids = np.zeros(used, np.int64)
    rings(points, cells, order, start, low, high, begin, ids)
    return Ring(begin, ids)


def spikes(subject: Subject, places: Places, borders: Borders) -> Iterator[Finding]:
    """The steepest spike at rest, and the steepest in any pose."""
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
    ring = find_rings(at, samples.vertices, radius)
    height = ring.without_rims(at, rims, ring.heights(at), PAIRED * steep * radius, off)
    height[_allowed(subject, at[: samples.vertices], height, places)] = 0.0
    worst, best, name, where = int(height.argmax()), 0.0, "", 0
    for pose in (n for n in subject.claimed if n in SHAPES):
        moved = _moved(
            subject, places, samples.at(subject.moves(pose)), ring, at, rims, radius, max(best, MOVED * radius)
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


def _moved(
    subject: Subject, places: Places, moves: Floats, ring: Ring, at: Floats, rims: Floats, radius: float, enough: float
) -> Floats:  # fmt: skip
    """(k,) heights in the displacements ``moves (m, 3)`` of samples at (m, 3), mm.

    They are 0 below ``enough``, and where the other side of the face moves alike.
    """
    moved = ring.without_rims(at, rims, ring.heights(moves, enough), enough, OFF_RIM * radius)
    low = moved < MIRRORED * radius
    if (moved[low] > 0.0).any():
        height = ring.without_rims(at, rims, ring.heights(moves, PAIRED * enough), PAIRED * enough, OFF_RIM * radius)
        moved[low & _has_mirror_image(subject, at[: len(height)], height, places)] = 0.0
    return moved


def _has_mirror_image(subject: Subject, at: Floats, height: Floats, places: Places) -> Bools:
    """(k,) which samples at (k, 3) with a height (k,) above 0 have another such sample near their mirror image."""
    middle, far = places.centre[0], MIRROR_MM * subject.scale
    out = np.zeros(len(at), bool)
    steep = np.flatnonzero(height)
    mirrored = at[steep] * [-1.0, 1.0, 1.0] + [2.0 * middle, 0.0, 0.0]
    for row, place in zip(steep, mirrored, strict=True):
        near = np.linalg.norm(at[steep] - place, axis=1) < far
        out[row] = bool((near & (np.abs(at[steep, 0] - at[row, 0]) > far)).any())
    return out


def _allowed(subject: Subject, at: Floats, height: Floats, places: Places) -> Bools:
    """(m,) which samples may stick out: those of the nose, and those that have a mirror image."""
    middle, apart = places.centre[0], places.apart
    out: Bools = np.abs(at[:, 0] - middle) < NOSE * apart
    out &= (at[:, 2] > places.centre[2]) & (at[:, 1] < places.centre[1] + 0.3 * apart)
    out &= at[:, 1] > places.centre[1] - 0.9 * places.down * apart
    return np.asarray(out | _has_mirror_image(subject, at, height, places))
