"""Find where a closed scan ends below: the cut, or break, of its neck, which is no skin.

Seen from below, it is what lies around the neck's axis without a step: the underside of the jaw, which faces down, too,
lies a step higher. Behind the axis, what faces down below the chin is no skin, either: sculptors cut the nape off on
the slant, and a nape widens downwards.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import label
from scipy.spatial import cKDTree

from surface.base.arrays import Bools, Floats, Ints
from surface.check.raster import View
from surface.fit.transfer.scan import Samples, Scan

PIXEL_MM = 1.5
STEP_MM = 2.0  # greatest step between neighbouring pixels of the end
FROM_BELOW = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # x, z and depth
SLANT = -0.3  # y of normals behind the axis below which samples are no nape
LEAST = 0.01  # share of all samples that a slanting end has
RIM_MM = 6.0  # beside a slanting end, where the nape already turns to it: no detail that a neck has
NEAR_MM = 1.5  # samples that lie so near to what is seen belong to it


def without_end(samples: Samples, scan: Scan, axis: Floats, chin: float) -> Samples:
    """The samples of a scan, but for those on the end of its neck; those beside a slanting end lie at a
    border.

    axis : (3,) a point of the neck's axis, inside. chin : height of the chin, mm: the end lies below it. All in the
    head's frame.
    """
    if not len(scan.triangles):
        return samples
    at = scan.vertices @ FROM_BELOW.T
    used = at[np.unique(scan.triangles)]
    (x0, z0), (x1, z1) = used[:, :2].min(axis=0), used[:, :2].max(axis=0)
    picture = View((x0, x1), (z0, z1), PIXEL_MM).draw([(at.astype(np.float32), scan.triangles.astype(np.int32))])
    column, row = _pixels(axis[None] @ FROM_BELOW.T, x0, z0, picture.depth.shape)
    if not -picture.depth[row[0], column[0]] < chin:
        return samples
    end = _around(picture.depth, int(row[0]), int(column[0]))
    own = samples.points @ FROM_BELOW.T
    column, row = _pixels(own, x0, z0, picture.depth.shape)
    on = end[row, column] & (np.abs(own[:, 2] - picture.depth[row, column]) < NEAR_MM) & (samples.normals[:, 1] < 0.0)
    slant = _slanting(samples, axis, chin) & ~on
    if slant.mean() < LEAST:  # some of a break that is rough
        return samples.kept(~on)
    return _with_border(samples.kept(~(on | slant)), samples.points[slant])


def _slanting(samples: Samples, axis: Floats, chin: float) -> Bools:
    """(m,) which samples behind the neck's axis face down."""
    at = samples.points
    down: Bools = (at[:, 1] < chin) & (at[:, 2] < axis[2]) & (samples.normals[:, 1] < SLANT)
    return down


def _with_border(samples: Samples, end: Floats) -> Samples:
    """The samples, of which those near points ``end (k, 3)`` lie at a border, so that nothing is matched to them."""
    if not len(end) or not len(samples.points):
        return samples
    beside = cKDTree(end).query(samples.points, distance_upper_bound=RIM_MM)[0] < RIM_MM
    return replace(samples, border=samples.border | beside)


def _pixels(points: Floats, x0: float, z0: float, shape: tuple[int, ...]) -> tuple[Ints, Ints]:
    """Columns and rows (m,) of points (m, 3) as seen from below; those beside the picture are at its edge."""
    column, row = np.round((points[:, :2] - [x0, z0]) / PIXEL_MM).astype(np.int64).T
    return np.clip(column, 0, shape[1] - 1), np.clip(row, 0, shape[0] - 1)


def _around(depth: Floats, row: int, column: int) -> Bools:
    """(h, w) the pixels that are joined to one without a step in ``depth (h, w)``.

    On a grid of twice the resolution, pixels are even places and links between them odd ones.
    """
    joined = np.zeros((2 * depth.shape[0] - 1, 2 * depth.shape[1] - 1), bool)
    joined[::2, ::2] = np.isfinite(depth)
    with np.errstate(invalid="ignore"):  # between pixels where nothing is
        joined[1::2, ::2] = np.abs(np.diff(depth, axis=0)) < STEP_MM
        joined[::2, 1::2] = np.abs(np.diff(depth, axis=1)) < STEP_MM
    labels = label(joined)[0][::2, ::2]
    out: Bools = (labels == labels[row, column]) & np.isfinite(depth)
    return out
