"""Tell which samples of a scan are in sight from outside, and which are inside it, such as teeth behind closed lips or
the inner wall of a shell.

The head has its own teeth and its own lining of the mouth, so what nobody sees is no skin for it to follow.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import minimum_filter

from surface.base.arrays import Bools, Floats
from surface.check.raster import View, view_rotation
from surface.fit.transfer.scan import Scan

VIEWS = tuple((yaw, pitch) for pitch in (-60.0, -30.0, 0.0, 30.0, 60.0) for yaw in range(-75, 76, 25))  # degrees
PIXEL_MM = 0.8
SLACK_MM = 0.3  # behind what a picture shows, of samples that are in sight


def in_sight(scan: Scan, points: Floats) -> Bools:
    """(m,) which of points (m, 3) on a scan, which looks along z, are in sight in at least one of :data:`VIEWS`.

    Of the pixels around a point the deepest decides, so that points of steep walls are in sight, too.
    """
    out = np.zeros(len(points), bool)
    tri = scan.triangles.astype(np.int32)
    if not len(tri):
        return out
    for yaw, pitch in VIEWS:
        left = np.flatnonzero(~out)
        turn = view_rotation(yaw, pitch)
        at, own = scan.vertices @ turn.T, points[left] @ turn.T
        low, high = (edge(at[np.unique(tri)], axis=0) for edge in (np.min, np.max))
        view = View((low[0], high[0]), (low[1], high[1]), PIXEL_MM)
        depth = minimum_filter(view.draw([(at.astype(np.float32), tri)]).depth, 3)
        column, row = np.round((own[:, :2] - low[:2]) / PIXEL_MM).astype(np.int64).T
        row, column = (np.clip(k, 0, n - 1) for k, n in zip((row, column), depth.shape, strict=True))
        out[left] = own[:, 2] > depth[row, column] - SLACK_MM
    return out
