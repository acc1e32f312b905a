"""Scans that mirror themselves: turned until their plane is the head's, and registered alike on both sides.

A registration follows either side of a face by itself, and where a scan says little, as at lids without eyes, both end
a millimetre apart. A sculpt or an avatar is the same on both sides; a scan of a person is not, and stays as it is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from surface.base.arrays import Floats, Ints
from surface.fit.transfer.align import Similarity
from surface.fit.transfer.register import Mark, Registered
from surface.fit.transfer.scan import Samples
from surface.fit.transfer.template import Template
from surface.fit.transfer.warp import Warp

ALIKE = 0.004  # in heights of the face: RMS of the distance between both sides of a scan that counts as mirrored
KEPT, MOST = 0.9, 0.97  # share of the samples that the plane is found by, and that have to be alike: hair need not
STEPS, CHECKED = 12, 4000  # of the search for the plane; samples that are mirrored
TILTED = np.radians(12.0)  # the plane of a face that was found is no further off than this
FLIP = np.array([-1.0, 1.0, 1.0])


@dataclass(frozen=True)
class Plane:
    """A plane by its unit normal (3,), which points to the left, and a point (3,) of it."""

    normal: Floats
    centre: Floats

    def mirrored(self, rows: Floats, *, directions: bool = False) -> Floats:
        """Points or directions (m, 3) on the other side."""
        off = (rows if directions else rows - self.centre) @ self.normal
        out: Floats = rows - 2.0 * np.outer(off, self.normal)
        return out


def mirror_plane(template: Template, samples: Samples) -> Plane | None:
    """The plane in which the samples of a scan, which is aligned with a template, mirror themselves near its face; None
    where they do not. Iterated closest points, as for the planes of heads (:mod:`surface.fit.source.placing.symmetry`),
    by distances from the surface, since samples of both sides do not meet."""
    front = template.points[template.face]
    low, high = front.min(axis=0), front.max(axis=0)
    rows = np.flatnonzero(((samples.points > low) & (samples.points < high)).all(axis=1))
    if len(rows) < 100:
        return None
    checked = rows[:: -(-len(rows) // CHECKED)]
    tree = cKDTree(samples.points)
    middle = np.array([0.5 * (low[0] + high[0]), *samples.points[checked, 1:].mean(axis=0)])
    plane = Plane(np.array([1.0, 0.0, 0.0]), middle)
    for _ in range(STEPS):
        plane = _nearer(plane, tree, samples, checked)
        if plane.normal[0] < np.cos(TILTED):
            return None
    off = np.sort(np.abs(_off(plane, tree, samples, checked)[0]))[: int(MOST * len(checked))]
    return plane if float(np.sqrt((off**2).mean())) < ALIKE * template.height else None


def _off(plane: Plane, tree: cKDTree, samples: Samples, rows: Ints) -> tuple[Floats, Ints]:
    """Distances (m,) of mirrored samples from the surface at the samples nearest to them, and these (m,)."""
    at = plane.mirrored(samples.points[rows])
    near = tree.query(at)[1]
    return ((at - samples.points[near]) * samples.normals[near]).sum(axis=1), near


def _nearer(plane: Plane, tree: cKDTree, samples: Samples, rows: Ints) -> Plane:
    """The plane turned about its vertical and its sagittal axis, and moved along its normal, in least squares."""
    off, near = _off(plane, tree, samples, rows)
    out, local = samples.normals[near], samples.points[rows] - plane.centre
    across = local @ plane.normal
    kept = np.abs(off) <= np.quantile(np.abs(off), KEPT)
    axes = np.eye(3)[1:]  # a turn of the normal towards them
    axes = axes - np.outer(axes @ plane.normal, plane.normal)
    columns = [2.0 * (out @ plane.normal)]  # of the centre, along the normal
    columns += [-2.0 * ((local @ w) * (out @ plane.normal) + across * (out @ w)) for w in axes]
    step = np.linalg.lstsq(np.column_stack(columns)[kept], -off[kept], rcond=None)[0]
    normal = plane.normal + step[1:] @ axes
    return Plane(normal / np.linalg.norm(normal), plane.centre + step[0] * plane.normal)


def levelled(found: Similarity, plane: Plane) -> Similarity:
    """The similarity of a face that was found, turned and moved until its plane is x = 0."""
    x = plane.normal
    y = np.array([0.0, 1.0, 0.0]) - x[1] * x
    y = y / np.linalg.norm(y)
    turn = np.stack([x, y, np.cross(x, y)])
    centre = plane.centre
    shift = turn @ (found.shift - centre) + centre * [0.0, 1.0, 1.0]
    return replace(found, turn=turn @ found.turn, shift=shift)


class MirroredWarp(Warp):
    """The mean of a map of space and of the one that does the same on the other side of x = 0."""

    def __init__(self, warp: Warp) -> None:
        self._warp = warp

    def __call__(self, points: Floats) -> Floats:
        """Points (m, 3) moved."""
        moved: Floats = 0.5 * (self._warp(points) + FLIP * self._warp(FLIP * points))
        return moved

    def turned(self, points: Floats, normals: Floats) -> tuple[Floats, Floats]:
        """Points (m, 3) moved, and unit normals (m, 3) of a surface through them as it lies then."""
        (at, out), (there, back) = (self._warp.turned(side * points, side * normals) for side in (np.ones(3), FLIP))
        mean = out + FLIP * back
        unit: Floats = mean / np.maximum(np.linalg.norm(mean, axis=1), 1e-12)[:, None]
        return 0.5 * (at + FLIP * there), unit


def alike(done: Registered) -> Registered:
    """A registration that is the same on both sides."""
    return Registered(MirroredWarp(done.warp), MirroredWarp(done.smooth), {n: _mark(done, n) for n in done.marks})


def _mark(done: Registered, name: str) -> Mark:
    """A landmark that was found, at the mean of its place and of that of its fellow on the other side, mirrored."""
    own = done.marks[name]
    pairs = (("left", "right"), ("right", "left"))
    other = done.marks.get(next((name.replace(a, b) for a, b in pairs if a in name), name), own)
    if "given" in (own.how, other.how):
        return own
    return replace(own, place=0.5 * (own.place + FLIP * other.place))
