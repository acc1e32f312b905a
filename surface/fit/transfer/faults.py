"""Decide whether a transferred head is refused: its face does not follow the scan, or parts of it are inside out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from surface.base.arrays import Bools, Floats
from surface.fit.measures.mend import ASTRAY_MM, REFUSED_MM2
from surface.fit.points.report import PartReport
from surface.head import Head, HeadData
from surface.head.posing.part import HeadPart

MATCHED = 0.25  # least share of the face's front that has a match on the scan
OPPOSED = -0.2  # cosine between a normal of the head and the one in the same (u, v) of the head it was made from
HINT = (
    "correct the landmarks (omote landmarks MESH -o landmarks.toml, then --landmarks landmarks.toml), leave out what "
    "hides the face (--without NAME)"
)


def faults_of_transfer(parts: Sequence[PartReport], matched: float, data: HeadData, source: Head) -> list[str]:
    """Messages that say why a head transferred onto a scan is refused; empty for a usable head.

    parts : the errors of the face, then of eyes and lids. matched : share of the face's front that has a match on the
    scan. data : the head, in the size of ``source``, the head that it was made from.
    """
    out = []
    if not parts or not parts[0].samples:
        out.append("no part of the face's front lies on the scan")
    elif matched < MATCHED:
        out.append(f"only {100 * matched:.0f} % of the face's front lies on the scan")
    elif parts[0].neutral.p99 > ASTRAY_MM:
        out.append(f"the face does not follow the scan: 1 % of it is {parts[0].neutral.p99:.0f} mm away or more")
    over = turned_over(data, source)
    return out + ([f"{over:.0f} mm² of the face are inside out at rest"] if over > REFUSED_MM2 else [])


def turned_over(data: HeadData, source: Head) -> float:
    """Area (mm²) of a head's face that is inside out at rest: its normals oppose those in the same (u, v) of the head
    that it was made from."""
    face = Head(data).part(data.parts[0].name)
    own, area = _normals(face, face.vertices.astype(np.float64))
    theirs, _ = _normals(face, source.part(face.name).surface.evaluate(np.asarray(face.uv, np.float64)))
    opposed: Bools = (own * theirs).sum(axis=1) < OPPOSED
    return float(area[opposed].sum())


def _normals(part: HeadPart, vertices: Floats) -> tuple[Floats, Floats]:
    """Unit normals (t, 3) of a part's triangles over vertices (n, 3), and their areas (t,), mm²."""
    a, b, c = (vertices[part.triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    return normal / np.maximum(length, 1e-12)[:, None], 0.5 * length
