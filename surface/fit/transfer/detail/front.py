"""Samples of a scan that lie on the front of the face."""

from __future__ import annotations

from scipy.spatial import cKDTree

from surface.base.arrays import Bools, Floats
from surface.fit.transfer.align import foremost
from surface.fit.transfer.scan import Samples

REACH_MM, SEEN_MM = 20.0, 3.0  # samples further from the face are hair or clothes; width of a line of sight
NEAR_MM = 6.0  # samples that lie further beside the front of the face, seen from the front, are ears or the crown


def on_front(front: Floats, samples: Samples) -> Bools:
    """(m,) which of a scan's samples are visible from the front near the points ``front (k, 3)`` of the face."""
    at, low, high = samples.points, front.min(axis=0), front.max(axis=0)
    high[2] += REACH_MM
    inside: Bools = ((at > low) & (at < high)).all(axis=1) & (samples.normals[:, 2] > 0.2)
    inside[inside] = foremost(at[inside], SEEN_MM)
    inside &= ~samples.border
    inside[inside] = cKDTree(front[:, :2]).query(at[inside, :2], distance_upper_bound=NEAR_MM)[0] < NEAR_MM
    return inside
