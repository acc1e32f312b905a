"""Measure the distance of a head at rest from the scan it was made from, on the front of the face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats
from surface.check.mouth import find_mouth
from surface.check.places import Places
from surface.check.subject import Subject
from surface.fit.measures.closest import ClosestTree
from surface.fit.points.report import PartReport, errors_of
from surface.fit.transfer.align import face_region
from surface.fit.transfer.detail.front import REACH_MM, on_front
from surface.fit.transfer.register import LEAST_COSINE
from surface.fit.transfer.reports.distances import CLOSE_MM, distances_from, sample_head
from surface.fit.transfer.scan import Samples, Scan
from surface.fit.transfer.template import Template
from surface.fit.transfer.warp import Warp
from surface.head import Head, HeadData

LIDS = "eyes and lids"
EYES = 1.6  # distance from an eyeball's axis, in radii, within which samples belong to eyes and lids


@dataclass(frozen=True)
class FaceErrors:
    """Reports of the face and of eyes and lids; and of each the greatest distance, mm, with its place (3,) on the
    scan; none of what was not measured."""

    parts: list[PartReport]
    greatest: list[tuple[str, float, Floats]]

    def in_words(self, head: Head) -> list[str]:
        """How far the scan is from the head, which is posed for it and at rest afterwards, at most, and where."""
        subject = Subject(head)
        places = Places(subject, find_mouth(subject))
        head.pose(head.values({}))
        return [f"{mm:.2f} mm: {places.name(at)} ({name}, mesh to surface)" for name, mm, at in self.greatest]

    def lines(self, head: Head) -> list[str]:
        """The same as sentences of a report."""
        why = f"; {LIDS}: eyeballs are spheres, and lids lie on them, unlike those of a scan"
        return [f"greatest error {said}{why if LIDS in said else ''}" for said in self.in_words(head)]


def face_errors(data: HeadData, template: Template, warp: Warp, samples: Samples) -> FaceErrors:
    """Distances from the scan's samples on the front of the face to the nearest skin or eyeball of the head.

    The first report is of the face, the second of eyes and lids. The head always has spherical eyeballs with lids that
    lie on them, whereas a scan may have flat, carved, closed or noisy eyes. So distances at the eyes are reported
    separately and do not count as errors of the face. The first report also has the number of all control points.
    samples : those of the scan that are in sight from outside.
    """
    at, own = distances(Head(data), warp(template.points[face_region(template)]), samples)
    off = np.linalg.norm(at[:, None, :2] - data.eyes[:, :2], axis=2).min(axis=1)
    eyes = off < EYES * data.eye_radius
    count = sum(len(p.points) for p in data.parts)
    pairs = (("face", ~eyes, count), (LIDS, eyes, 0))
    reports = [PartReport(n, points, int(k.sum()), 0, errors_of(own[k]), {}) for n, k, points in pairs]
    rows = [(n, np.flatnonzero(k)[own[k].argmax()]) for n, k, _ in pairs if k.any()]
    return FaceErrors(reports, [(n, float(own[row]), at[row]) for n, row in rows])


def distances(head: Head, front: Floats, samples: Samples) -> tuple[Floats, Floats]:
    """Samples (m, 3) of the scan that are visible from the front near the points ``front (k, 3)``, and their distances
    (m,) from the head's surface, mm."""
    inside = on_front(front, samples)
    at = samples.points[inside]
    own = sample_head(head)
    found = distances_from(own, at)
    same = (own.normals[found.nearest] * samples.normals[inside]).sum(axis=1) > LEAST_COSINE
    counted = (same | (found.to_sample > CLOSE_MM)) & (found.mm < REACH_MM)
    return at[counted], found.mm[counted]


def skin_errors(head: Head, scan: Scan) -> dict[str, Floats]:
    """By part of a head's skin, (m,) mm from each vertex at rest to the scan's surface; NaN where the scan has nothing
    near. Both are in the head's frame."""
    tree = ClosestTree(scan.vertices, scan.triangles)
    out = {}
    for part in head.parts:
        if part.material == "skin":
            points = part.vertices.astype(np.float64)
            mm = tree.distances(points, np.zeros(len(points), np.int64))
            out[part.name] = np.where(mm < REACH_MM, mm, np.nan)
    return out
