"""Measure how far a head at rest is from the scan it was made for, where the scan shows the face's front."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from surface.base.arrays import Floats
from surface.fit.points.report import Errors, PartReport
from surface.fit.transfer.align import face_region, foremost
from surface.fit.transfer.register import LEAST_COSINE
from surface.fit.transfer.scan import Samples, make_scan, sample
from surface.fit.transfer.template import Template
from surface.fit.transfer.warp import Warp
from surface.head import Head, HeadData

REACH_MM, SEEN_MM = 20.0, 3.0  # of the face: what lies further away is hair, or clothes; width of a line of sight
COUNT = 150_000


def face_report(data: HeadData, template: Template, warp: Warp, samples: Samples) -> PartReport:
    """Distances from the scan's samples on the front of the face to the nearest skin or eyeball of the head, whose
    control points are counted together."""
    own = distances(Head(data), warp(template.points[face_region(template)]), samples)
    return PartReport("face", sum(len(p.points) for p in data.parts), len(own), 0, _errors(own), {})


def distances(head: Head, front: Floats, samples: Samples) -> Floats:
    """(m,) mm from each sample of the scan that is seen from the front, within the region of the points ``front``, to
    the head's own surface."""
    own = [p for p in head.parts if p.material in ("skin", "eye")]
    first = np.cumsum([0, *(len(p.vertices) for p in own)])
    faces = np.concatenate([p.triangles + k for p, k in zip(own, first, strict=False)]).astype(np.int64)
    mine = sample(make_scan(np.concatenate([p.vertices for p in own]).astype(float), faces, head.name), COUNT)
    at, low, high = samples.points, front.min(axis=0), front.max(axis=0)
    high[2] += REACH_MM
    inside = ((at > low) & (at < high)).all(axis=1) & (samples.normals[:, 2] > 0.2)
    inside[inside] = foremost(at[inside], SEEN_MM)
    inside &= ~samples.border
    at = at[inside]
    far, near = cKDTree(mine.points).query(at)
    off = np.abs(((at - mine.points[near]) * mine.normals[near]).sum(axis=1))
    same = (mine.normals[near] * samples.normals[inside]).sum(axis=1) > LEAST_COSINE
    distance: Floats = np.where(far < 2.0, off, far)[same | (far > 2.0)]
    return distance[distance < REACH_MM]


def _errors(distance: Floats) -> Errors:
    if not len(distance):
        return Errors(0.0, 0.0, 0.0)
    return Errors(float(np.sqrt((distance**2).mean())), float(np.percentile(distance, 99)), float(distance.max()))
