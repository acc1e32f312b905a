"""What a transfer found in a scan and made of it: landmarks, openings, shapes that were changed, gaps, errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from surface.base.arrays import Floats
from surface.fit.points.report import Errors, FitReport, errors_of
from surface.fit.transfer.align import Similarity, face_region
from surface.fit.transfer.register import Mark, Matcher, Registered
from surface.fit.transfer.reports.gaps import Gap
from surface.fit.transfer.scan import Samples
from surface.fit.transfer.template import Template, find_landmarks
from surface.head import Contact, Group, Head, HeadData

HOLE_MM, INSIDE_MM, DEPTH_MM = 3.0, 5.0, 25.0  # a border so near a rim; what lies so far behind a line, and no further
SHARE = 0.5  # of a rim that lies at a border: there is a hole
LEAST_INSIDE = 20  # samples of the scan behind the line of the lips: the skin goes on into the mouth
CHANGED = 0.01  # a share by which a shape is larger: it was changed
OPENINGS = (("mouth", "lips"), ("left eye", "left_lids"), ("right eye", "right_lids"))


@dataclass(frozen=True)
class Found:
    """A landmark: how it was found and how sure, 0..1; its place in the scan's own coordinates; and how far from there
    the head's own landmark lies now, mm."""

    name: str
    how: str
    sure: float
    place: tuple[float, float, float]
    off_mm: float


@dataclass(frozen=True)
class TransferReport:
    """All of it.

    source : the head that the expressions come from. registration : of the face's front after the map, from the scan's
    surface, where it shows any; ``matched`` is the share of the front where it does.
    openings : what the scan had in the place of mouth and eyes. reseated : by shape, least and greatest factor of its
    displacements beside those that the map alone gives.
    """

    fit: FitReport
    source: str
    registration: Errors
    matched: float
    landmarks: list[Found]
    openings: dict[str, str]
    reseated: dict[str, tuple[float, float]]
    gaps: list[Gap]


def registration_errors(
    template: Template, done: Registered, matcher: Matcher, farthest: float
) -> tuple[Errors, float]:
    """Distances along normals from the template's face after the map to the scan, and the share that has a match."""
    front = face_region(template)
    at, out = done.warp.turned(template.points[front], template.normals[front])
    match = matcher.find(at, out, farthest, 0.0)
    off = np.linalg.norm(match.goals - at, axis=1)[match.found]
    return errors_of(off), float(match.found.mean()) if len(at) else 0.0


def landmarks_of(head: Head, marks: dict[str, Mark], found: Similarity) -> list[Found]:
    """The landmarks of a scan; ``head`` and ``marks`` lie in the frame to which ``found`` leads from the file's."""
    own = find_landmarks(head, {c.name: c for c in head.data.contacts})
    out = []
    for name, mark in marks.items():
        x, y, z = ((mark.place - found.shift) @ found.turn / found.scale).tolist()
        out.append(Found(name, mark.how, mark.sure, (x, y, z), float(np.linalg.norm(own[name] - mark.place))))
    return out


def openings_of(head: Head, samples: Samples) -> dict[str, str]:
    """What a scan has where the head, which lies on it, has openings."""
    contacts = {c.name: c for c in head.data.contacts}
    return {title: _opening(head, contacts[name], samples) for title, name in OPENINGS}


def _opening(head: Head, contact: Contact, samples: Samples) -> str:
    rims = head.part(contact.part).surface.evaluate(contact.places[:, :, 0].reshape(-1, 2))
    border = samples.points[samples.border]
    if len(border) and (cKDTree(border).query(rims)[0] < HOLE_MM).mean() > SHARE:
        return "a hole in the scan"
    if contact.eye < 0 and _goes_on(rims, samples.points):
        return "open: the scan goes on into it"
    return "closed in the scan: cut open along the line that was found"


def _goes_on(rims: Floats, points: Floats) -> bool:
    """Does a scan (m, 3) lie behind the rims (k, 3) of the lips, too?"""
    low, high = rims.min(axis=0), rims.max(axis=0)
    middle = np.abs(points[:, 0] - 0.5 * (low[0] + high[0])) < 0.35 * (high[0] - low[0])
    level = (points[:, 1] > low[1] - 2.0) & (points[:, 1] < high[1] + 2.0)
    behind = (points[:, 2] < low[2] - INSIDE_MM) & (points[:, 2] > low[2] - DEPTH_MM)
    return int((middle & level & behind).sum()) > LEAST_INSIDE


def reseated(before: HeadData, after: HeadData) -> dict[str, tuple[float, float]]:
    """Shapes whose displacements differ between two states of a head, and by which factors."""
    out: dict[str, tuple[float, float]] = {}
    for old, new in zip(before.parts, after.parts, strict=True):
        moves = {g.name: g for g in old.groups}
        for group in new.groups:
            factors = _factors(moves.get(group.name), group)
            if len(factors) and np.abs(factors - 1.0).max() > CHANGED:
                least, most = out.get(group.name, (np.inf, 0.0))
                out[group.name] = min(least, float(factors.min())), max(most, float(factors.max()))
    return out


def _factors(old: Group | None, new: Group) -> Floats:
    """Lengths of displacements relative to those before, of points that move by a tenth of the greatest at least."""
    if old is None or len(old.ids) != len(new.ids) or not np.array_equal(old.ids, new.ids):
        return np.zeros(0)
    a, b = (np.linalg.norm(g.moves.astype(float), axis=1) for g in (old, new))
    moving = a > 0.1 * a.max(initial=0.0)
    factors: Floats = b[moving] / np.maximum(a[moving], 1e-9)
    return factors
