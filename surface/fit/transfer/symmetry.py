"""Detect scans that are mirror-symmetric, turn them into the head's plane of symmetry, and symmetrise the registration.

A registration follows each side of a face independently. Where a scan has little detail, as at lids without eyes, both
sides end up a millimetre apart. A sculpt or an avatar is usually symmetric, so its registration can be, too. A scan of
a person is not symmetric and is left as it is.
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

SYMMETRIC = 0.004  # greatest RMS distance between both sides of a symmetric scan, in heights of the face
KEPT, MOST = 0.9, 0.97  # share of the samples that find the plane, and that have to be symmetric: hair need not be
STEPS, CHECKED = 12, 4000  # iterations of the search for the plane; samples that are mirrored
TILTED = np.radians(12.0)  # greatest angle between the plane and the one that the alignment has found
FLIP = np.array([-1.0, 1.0, 1.0])


@dataclass(frozen=True)
class Plane:
    """A plane, given by its unit normal (3,), which points to the subject's left, and a point (3,) of it."""

    normal: Floats
    centre: Floats

    def mirrored(self, rows: Floats, *, directions: bool = False) -> Floats:
        """Points or directions (m, 3) mirrored in the plane."""
        off = (rows if directions else rows - self.centre) @ self.normal
        out: Floats = rows - 2.0 * np.outer(off, self.normal)
        return out


def mirror_plane(template: Template, samples: Samples) -> Plane | None:
    """The plane of symmetry of a scan near its face; None where the scan is not symmetric.

    The scan is aligned with the template. The plane is found by iterated closest points, as in
    :mod:`surface.fit.source.placing.symmetry`, but by distances along normals, since the samples of both sides do not
    coincide.
    """
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
    return plane if float(np.sqrt((off**2).mean())) < SYMMETRIC * template.height else None


def _off(plane: Plane, tree: cKDTree, samples: Samples, rows: Ints) -> tuple[Floats, Ints]:
    """Distances (m,) of mirrored samples from the surface, along the nearest sample's normal; and its number (m,)."""
    at = plane.mirrored(samples.points[rows])
    near = tree.query(at)[1]
    return ((at - samples.points[near]) * samples.normals[near]).sum(axis=1), near


def _nearer(plane: Plane, tree: cKDTree, samples: Samples, rows: Ints) -> Plane:
    """A least-squares step: the plane turned about its vertical and its sagittal axis and moved along its normal."""
    off, near = _off(plane, tree, samples, rows)
    out, local = samples.normals[near], samples.points[rows] - plane.centre
    across = local @ plane.normal
    kept = np.abs(off) <= np.quantile(np.abs(off), KEPT)
    axes = np.eye(3)[1:]  # the normal is turned towards these
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
    """The mean of a map of space and of its mirror image in x = 0."""

    def __init__(self, warp: Warp) -> None:
        self._warp = warp

    def __call__(self, points: Floats) -> Floats:
        """Points (m, 3) moved."""
        moved: Floats = 0.5 * (self._warp(points) + FLIP * self._warp(FLIP * points))
        return moved

    def turned(self, points: Floats, normals: Floats) -> tuple[Floats, Floats]:
        """Points (m, 3) moved, and unit normals (m, 3) of the moved surface through them."""
        (at, out), (there, back) = (self._warp.turned(side * points, side * normals) for side in (np.ones(3), FLIP))
        mean = out + FLIP * back
        unit: Floats = mean / np.maximum(np.linalg.norm(mean, axis=1), 1e-12)[:, None]
        return 0.5 * (at + FLIP * there), unit


def symmetrised(done: Registered) -> Registered:
    """The registration made symmetric about x = 0."""
    return Registered(MirroredWarp(done.warp), MirroredWarp(done.smooth), {n: _mark(done, n) for n in done.marks})


def _mark(done: Registered, name: str) -> Mark:
    """A landmark at the mean of its place and the mirror image of its counterpart; given ones stay as they are."""
    own = done.marks[name]
    pairs = (("left", "right"), ("right", "left"))
    other = done.marks.get(next((name.replace(a, b) for a, b in pairs if a in name), name), own)
    if "given" in (own.how, other.how):
        return own
    return replace(own, place=0.5 * (own.place + FLIP * other.place))
