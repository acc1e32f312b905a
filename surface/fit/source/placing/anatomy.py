"""Find eyes and mouth of a mesh in any unit and axes: by what its shapes move, by eyeballs among its pieces.

Everything here is in the coordinates of the file; nothing is assumed about its unit, its axes or its origin.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.fit.source.mesh import components, corners

BLINKS = ("eyeBlink", "eyeSquint", "eyeWide")  # shapes whose middles lie on the lids, best first
LIPS = (
    "mouthClose", "mouthPucker", "mouthFunnel", "mouthRollLower", "mouthRollUpper", "mouthShrugLower",
    "mouthShrugUpper", "mouthPressLeft", "mouthPressRight", "mouthSmileLeft", "mouthSmileRight", "mouthFrownLeft",
    "mouthFrownRight", "mouthStretchLeft", "mouthStretchRight", "mouthUpperUpLeft", "mouthUpperUpRight",
    "mouthLowerDownLeft", "mouthLowerDownRight", "mouthDimpleLeft", "mouthDimpleRight",
)  # fmt: skip
MAX_FIT_ERROR = 0.1  # of an eyeball from a sphere, in radii
SPACING = (2.2, 9.0)  # minimum and maximum distance between two eyeballs, in radii
MAX_OFFSET = 2.0  # vertices further off a sphere than this many times the median distance are no part of it
MIN_BALL_VERTICES = 12  # of an eyeball
MAX_BALLS = 64  # pieces that are compared as eyeballs; of more, those with most vertices
MIN_EXTENT = 0.75  # of an eyeball's piece along each axis, in radii: a front half shell has 1 along its depth
MAX_RATIO, MIN_RATIO = 3.0, 0.33  # of the distance between two eyeballs to that between the lids
MAX_SPREAD = (
    0.35  # of the motion of a lid's shape about its middle, in distances of the lids: a face-wide shape shows no eye
)


@dataclass(frozen=True)
class Eyes:
    """Both eyes.

    centres : (2, 3), the subject's left first where ``sided``. balls : whether these are centres of eyeballs, else
    they lie on the lids. by : how they were found, in words.
    """

    centres: Floats
    sided: bool
    balls: bool
    by: str

    @property
    def apart(self) -> float:
        """Distance between both."""
        return float(np.linalg.norm(self.centres[0] - self.centres[1]))

    @property
    def middle(self) -> Floats:
        """(3,) the point between both."""
        middle: Floats = self.centres.mean(axis=0)
        return middle


@dataclass(frozen=True)
class Landmarks:
    """What is known of a face.

    mouth : (3,) middle of the lips; jaw : (3,) middle of what the opening jaw moves; left : (3,) unit vector from
    shapes of the right side to those of the left. Each is None where no shape shows it.
    """

    eyes: Eyes | None = None
    mouth: Floats | None = None
    jaw: Floats | None = None
    left: Floats | None = None


def find_landmarks(vertices: Floats, faces: Ints, shapes: Mapping[str, Floats]) -> Landmarks:
    """Landmarks of a mesh.

    vertices : (n, 3); faces : (f, 4) as in :class:`surface.fit.source.mesh.FitMesh`; shapes : displacements (n, 3) by
    ARKit's names; a name without its side ("eyeBlink") is a shape of both sides.
    """
    left = _left(vertices, shapes)
    lips = [m for name in LIPS if (m := middle_of(vertices, shapes.get(name))) is not None]
    return Landmarks(
        find_eyes(vertices, faces, shapes, left),
        np.mean(lips, axis=0) if lips else None,
        middle_of(vertices, shapes.get("jawOpen")),
        left,
    )


def find_eyes(
    vertices: Floats, faces: Ints, shapes: Mapping[str, Floats], left: Floats | None = None
) -> Eyes | None:  # fmt: skip
    """Both eyes of a mesh, by the shapes of their lids and by eyeballs; None where neither is there.

    Arguments as for :func:`find_landmarks`; left : direction to the subject's left, (3,), if known.
    """
    lids, balls = _lids(vertices, shapes), _eyeballs(vertices, faces)
    if lids is not None:
        near = [pair for pair in balls if MIN_RATIO < _apart(pair) / lids.apart < MAX_RATIO]
        near = [pair for pair in near if _distance(pair, lids.centres) < 0.5 * lids.apart]
        if not near:
            return lids
        best = min(near, key=lambda pair: _distance(pair, lids.centres))
        return Eyes(in_order(best, lids.centres), lids.sided, True, "eyeballs and the shapes of the lids")
    if not balls:
        return None
    pair = balls[0]
    if left is None:
        return Eyes(pair, False, True, "two balls that are eyes")
    ordered = pair if (pair[0] - pair[1]) @ left > 0 else pair[::-1]
    return Eyes(ordered, True, True, "two balls that are eyes")


def middle_of(vertices: Floats, move: Floats | None) -> Floats | None:
    """(3,) mean of the vertices, weighted by the squares of a shape's displacements; None where it moves nothing."""
    weight = None if move is None else (move**2).sum(axis=1)
    if weight is None or not weight.sum() > 0:
        return None
    middle: Floats = weight @ vertices / weight.sum()
    return middle


def _left(vertices: Floats, shapes: Mapping[str, Floats]) -> Floats | None:
    """Unit vector from right shapes to left ones, of eyes, brows, cheeks and nose."""
    total = np.zeros(3)
    for name in shapes:
        if name.endswith("Left") and name[:3] not in ("jaw", "mou"):
            a, b = (middle_of(vertices, shapes.get(n)) for n in (name, name.removesuffix("Left") + "Right"))
            total += a - b if a is not None and b is not None else 0.0
    length = float(np.linalg.norm(total))
    return total / length if length > 0 else None


def _lids(vertices: Floats, shapes: Mapping[str, Floats]) -> Eyes | None:
    """Middles of the lids: of the first kind of shape that both sides have, or that moves both."""
    for name in BLINKS:
        a, b = (middle_of(vertices, shapes.get(name + side)) for side in ("Left", "Right"))
        if a is not None and b is not None:
            eyes = Eyes(np.stack([a, b]), True, False, "the shapes of the lids")
            return eyes if eyes.apart > 0 else None
        if (both := shapes.get(name)) is not None and (halves := _two(vertices, both)) is not None:
            return Eyes(halves, False, False, "the shapes of the lids")
    return None


def _two(vertices: Floats, move: Floats) -> Floats | None:
    """(2, 3) middles of the two places that a shape of both sides moves; None where it moves only one."""
    weight = (move**2).sum(axis=1)
    if not weight.sum() > 0:
        return None
    rows, w = vertices[weight > 0], weight[weight > 0]
    off = rows - w @ rows / w.sum()
    axis = np.linalg.svd(off * np.sqrt(w)[:, None], full_matrices=False)[2][0]
    side = off @ axis > 0
    if side.all() or not side.any():
        return None
    out = np.stack([w[s] @ rows[s] / w[s].sum() for s in (side, ~side)])
    off = rows - np.where(side[:, None], out[0], out[1])
    spread = float(np.sqrt(w @ (off**2).sum(axis=1) / w.sum()))
    return out if spread < MAX_SPREAD * _apart(out) else None


def _eyeballs(vertices: Floats, faces: Ints) -> list[Floats]:
    """(2, 3) centres of pairs of pieces that are balls of one size, those with most vertices first."""
    balls = sorted(_balls(vertices, faces), key=lambda ball: -ball[2])[:MAX_BALLS]
    pairs = []
    for i, (p, r, n) in enumerate(balls):
        for q, s, m in balls[i + 1 :]:
            apart = float(np.linalg.norm(p - q))
            if abs(r - s) < 0.1 * r and SPACING[0] * r < apart < SPACING[1] * r and min(n, m) > 0.5 * max(n, m):
                pairs.append((n + m, np.stack([p, q])))
    return [pair for _, pair in sorted(pairs, key=lambda x: -x[0])]


def _balls(vertices: Floats, faces: Ints) -> list[tuple[Floats, float, int]]:
    """Centre, radius and number of vertices of every connected piece that lies on a sphere."""
    a, b, c, d = corners(faces)
    label = components(np.concatenate([a, b, c]), np.concatenate([b, c, d]), len(vertices))
    used = np.unique(faces[faces >= 0])
    order = used[np.argsort(label[used], kind="stable")]
    starts = np.flatnonzero(np.diff(label[order], prepend=-1))
    pieces = [ids for ids in np.split(order, starts[1:]) if len(ids) >= MIN_BALL_VERTICES]
    return [(*ball, len(ids)) for ids in pieces if (ball := _sphere(vertices[ids])) is not None]


def _sphere(points: Floats) -> tuple[Floats, float] | None:
    """Centre and radius of points on a ball or at least a front half of one; None for anything else."""
    extent = np.ptp(points, axis=0)
    if extent.max() > 2.6 * extent.min() or extent.min() <= 0:
        return None
    origin = points.mean(axis=0)
    centre, radius = _least_squares(points - origin)
    off = np.abs(np.linalg.norm(points - origin - centre, axis=1) - radius)
    for _ in range(4):  # without the cornea, which stands out of the ball
        near = np.abs(np.linalg.norm(points - origin - centre, axis=1) - radius)
        kept = near <= MAX_OFFSET * np.median(near)
        if kept.sum() >= MIN_BALL_VERTICES and not kept.all():
            centre, radius = _least_squares((points - origin)[kept])
    good = (
        radius > 0 and float(np.sqrt((off**2).mean())) < MAX_FIT_ERROR * radius and extent.min() > MIN_EXTENT * radius
    )
    return (origin + centre, radius) if good else None


def _least_squares(points: Floats) -> tuple[Floats, float]:
    """Centre (3,) and radius of the sphere nearest to points (m, 3), by linear least squares."""
    x = np.linalg.lstsq(np.column_stack([2.0 * points, np.ones(len(points))]), (points**2).sum(axis=1), rcond=None)[0]
    return x[:3], float(np.sqrt(max(x[3] + x[:3] @ x[:3], 0.0)))


def _apart(pair: Floats) -> float:
    return float(np.linalg.norm(pair[0] - pair[1]))


def in_order(pair: Floats, wanted: Floats) -> Floats:
    """A pair (2, 3) in the order in which it is nearest to another."""
    return min((pair, pair[::-1]), key=lambda p: float(np.linalg.norm(p - wanted)))


def _distance(pair: Floats, wanted: Floats) -> float:
    return float(np.linalg.norm(in_order(pair, wanted) - wanted, axis=1).max())
