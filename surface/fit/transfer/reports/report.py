"""The report of a transfer: landmarks, openings, changed shapes, gaps and errors."""

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

HOLE_MM = 3.0  # distance from a border of the scan within which the rim of an opening lies at a hole
INSIDE_MM, DEPTH_MM = 5.0, 25.0  # range behind the line of the lips in which samples lie inside the mouth
SHARE = 0.5  # least share of a rim at a hole for the whole opening to be one
LEAST_INSIDE = 20  # samples inside the mouth from which on the scan continues into it
CHANGED = 0.01  # relative change of a displacement from which on its shape counts as changed
OPENINGS = (("mouth", "lips"), ("left eye", "left_lids"), ("right eye", "right_lids"))


@dataclass(frozen=True)
class Found:
    """A landmark on the scan.

    how, sure : as in :class:`surface.fit.transfer.register.Mark`. place : in the scan's own coordinates. off_mm :
    distance of the head's landmark from it.
    """

    name: str
    how: str
    sure: float
    place: tuple[float, float, float]
    off_mm: float


@dataclass(frozen=True)
class TransferReport:
    """The report of a transfer.

    fit : parts, their errors, notes and faults. source : name of the head that the expressions come from.
    registration : distances of the face's front, after the map, from the scan. matched : share of the front that has a
    match on the scan.
    openings : what the scan has in the place of mouth and eyes, in words. reseated : by shape, least and greatest
    factor by which displacements were changed after the map, so that lids lie on the eyeballs and close.
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
    """The landmarks of a scan. head, marks : in the frame that ``found`` maps the file's coordinates to."""
    own = find_landmarks(head, {c.name: c for c in head.data.contacts})
    out = []
    for name, mark in marks.items():
        x, y, z = ((mark.place - found.shift) @ found.turn / found.scale).tolist()
        out.append(Found(name, mark.how, mark.sure, (x, y, z), float(np.linalg.norm(own[name] - mark.place))))
    return out


def openings_of(head: Head, samples: Samples) -> dict[str, str]:
    """What a scan has at the openings of the head that lies on it, in words by opening."""
    contacts = {c.name: c for c in head.data.contacts}
    return {title: _opening(head, contacts[name], samples) for title, name in OPENINGS}


def _opening(head: Head, contact: Contact, samples: Samples) -> str:
    rims = head.part(contact.part).surface.evaluate(contact.places[:, :, 0].reshape(-1, 2))
    border = samples.points[samples.border]
    if len(border) and (cKDTree(border).query(rims)[0] < HOLE_MM).mean() > SHARE:
        return "a hole in the scan"
    if contact.eye < 0 and _continues_inside(rims, samples.points):
        return "open: the scan continues into it"
    return "closed in the scan: it was cut open along the line of the landmarks"


def _continues_inside(rims: Floats, points: Floats) -> bool:
    """Whether samples (m, 3) of a scan also lie behind the rims (k, 3) of the lips."""
    low, high = rims.min(axis=0), rims.max(axis=0)
    middle = np.abs(points[:, 0] - 0.5 * (low[0] + high[0])) < 0.35 * (high[0] - low[0])
    level = (points[:, 1] > low[1] - 2.0) & (points[:, 1] < high[1] + 2.0)
    behind = (points[:, 2] < low[2] - INSIDE_MM) & (points[:, 2] > low[2] - DEPTH_MM)
    return int((middle & level & behind).sum()) > LEAST_INSIDE


def reseated(before: HeadData, after: HeadData) -> dict[str, tuple[float, float]]:
    """Shapes whose displacements differ between two versions of a head, with the least and greatest factor."""
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
    """Lengths of displacements relative to those before, for points that move at least a tenth of the greatest."""
    if old is None or len(old.ids) != len(new.ids) or not np.array_equal(old.ids, new.ids):
        return np.zeros(0)
    a, b = (np.linalg.norm(g.moves.astype(float), axis=1) for g in (old, new))
    moving = a > 0.1 * a.max(initial=0.0)
    factors: Floats = b[moving] / np.maximum(a[moving], 1e-9)
    return factors
