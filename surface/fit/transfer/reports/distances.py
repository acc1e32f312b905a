"""Measure distances of points from the skin and the eyeballs of a head."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from surface.base.arrays import Floats, Ints
from surface.fit.transfer.scan import Samples, make_scan, sample
from surface.head import Head

COUNT = 150_000  # samples of the head
CLOSE_MM = 2.0  # distance from the nearest sample within which the distance along its normal counts


@dataclass(frozen=True)
class Distances:
    """Distances of m points from a head.

    mm : (m,) along the normal of the nearest sample where that is close, else from the sample itself.
    to_sample : (m,) from the nearest sample, mm. nearest : (m,) its number.
    """

    mm: Floats
    to_sample: Floats
    nearest: Ints


def sample_head(head: Head) -> Samples:
    """Samples of a head's skin and eyeballs as they are posed."""
    own = [p for p in head.parts if p.material in ("skin", "eye")]
    first = np.cumsum([0, *(len(p.vertices) for p in own)])
    faces = np.concatenate([p.triangles + k for p, k in zip(own, first, strict=False)]).astype(np.int64)
    return sample(make_scan(np.concatenate([p.vertices for p in own]).astype(float), faces, head.name), COUNT)


def distances_from(head: Samples, points: Floats) -> Distances:
    """Distances of points (m, 3) from a head, of which samples are given."""
    far, near = cKDTree(head.points).query(points)
    off = np.abs(((points - head.points[near]) * head.normals[near]).sum(axis=1))
    return Distances(np.where(far < CLOSE_MM, off, far), far, near)
