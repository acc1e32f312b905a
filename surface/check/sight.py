"""What of a head can be seen from outside at rest, from all sides."""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.check.raster import NOTHING, View, view_rotation
from surface.check.subject import HAIR, Subject

VIEWS = ((0.0, 0.0), (45.0, 0.0), (-45.0, 0.0), (90.0, 0.0), (-90.0, 0.0), (180.0, 0.0), (0.0, -40.0), (0.0, 40.0))
STEP_MM = 0.8  # pixel size of the pictures that determine what is visible
MAX_PIXELS = 900  # width or height of such a picture


def are_visible(at: Floats, triangles: Ints, scale: float) -> Bools:
    """Return (t,): which triangles of vertices at (m, 3) can be seen from outside, or have a corner of such a one.

    scale : the head's size relative to a usual one.
    """
    seen = np.zeros(len(triangles), bool)
    for yaw, pitch in VIEWS:
        turned = at @ view_rotation(yaw, pitch).T
        (x0, y0, _), (x1, y1, _) = turned.min(axis=0), turned.max(axis=0)
        step = max(STEP_MM * scale, (x1 - x0) / MAX_PIXELS, (y1 - y0) / MAX_PIXELS)
        shape = at.astype(np.float32), triangles.astype(np.int32)
        picture = View((x0, x1), (y0, y1), step, view_rotation(yaw, pitch)).draw([shape])
        seen[picture.rows[picture.parts != NOTHING]] = True
    corners = np.zeros(len(at), bool)
    corners[triangles[seen]] = True
    return np.asarray(corners[triangles].any(axis=1))


def seen_vertices(subject: Subject) -> list[Bools]:
    """Return (m,) for each part: which of its vertices can be seen at rest; hair hides nothing and is not asked."""
    drawn = [k for k, p in enumerate(subject.parts) if p.material not in HAIR and len(p.triangles)]
    out = [np.zeros(len(rest), bool) for rest in subject.rest]
    if not drawn:
        return out
    starts = np.cumsum([0, *(len(subject.rest[k]) for k in drawn)])
    triangles = [subject.parts[k].triangles.astype(np.int64) + s for k, s in zip(drawn, starts, strict=False)]
    at, every = np.concatenate([subject.rest[k] for k in drawn]).astype(np.float64), np.concatenate(triangles)
    corners = np.zeros(len(at), bool)
    corners[every[are_visible(at, every, subject.scale)]] = True
    for k, start, stop in zip(drawn, starts, starts[1:], strict=False):
        out[k] = corners[start:stop]
    return out
