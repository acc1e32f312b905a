"""Which side of a surface is its outside: by what is seen of it from around, as a file may have it either way round."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.check.raster import NOTHING, View, view_rotation

PIXELS = 240  # along the longest side of a picture
# yaw and pitch, degrees, and how much a picture counts: a mask shows its inside from behind, a head its back
VIEWS = (
    (0.0, 0.0, 1.0), (40.0, 0.0, 1.0), (-40.0, 0.0, 1.0), (0.0, 50.0, 0.5), (0.0, -50.0, 0.5),
    (90.0, 0.0, 0.5), (-90.0, 0.0, 0.5), (180.0, 0.0, 0.1),
)  # fmt: skip

Samples = tuple[Floats, Ints]


def seen(pieces: Sequence[Samples]) -> tuple[Floats, Bools]:
    """How much of each piece is seen from the front, and which are inside out.

    pieces : points (n, 3) in head axes, and triangles (t, 3), of each.

    Returns (k,) square millimetres of its front view, and (k,) whether its triangles run so that they show their backs.
    """
    every = np.concatenate([points for points, _ in pieces])
    step = float(np.ptp(every, axis=0).max()) / PIXELS
    votes, front = np.zeros(len(pieces)), np.zeros(len(pieces))
    for yaw, pitch, share in VIEWS:
        shown, back = _counts(pieces, every, view_rotation(yaw, pitch), step)
        votes += share * (shown - 2.0 * back)
        front += shown if yaw == pitch == 0.0 else 0.0
    for k in np.flatnonzero(votes == 0.0).tolist():  # hidden by others
        shown, back = _counts([pieces[k]], pieces[k][0], view_rotation(0.0), step)
        votes[k] = shown[0] - 2.0 * back[0]
    return front * step**2, votes < 0.0


def _counts(pieces: Sequence[Samples], every: Floats, turn: Floats, step: float) -> tuple[Floats, Floats]:
    """Pixels (k,) that show each piece from one side, and how many of them show its back."""
    at = every @ turn.T
    low, high = at.min(axis=0), at.max(axis=0)
    view = View((low[0], high[0]), (low[1], high[1]), step, turn)
    picture = view.draw([(points.astype(np.float32), tri.astype(np.int32)) for points, tri in pieces])
    shown, back = np.zeros(len(pieces)), np.zeros(len(pieces))
    for k in np.unique(picture.parts[picture.parts != NOTHING]).tolist():
        points, triangles = pieces[k]
        corner = points[triangles[picture.rows[picture.parts == k]]]
        towards = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]) @ turn[2]
        shown[k], back[k] = len(corner), (towards < 0).sum()
    return shown, back
