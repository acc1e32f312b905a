"""All checks of a head, in order."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from surface.check import borders, motions, overlaps, spikes, stance
from surface.check.accessories import damaged_textures
from surface.check.findings import AGAIN, Finding
from surface.check.mouth import Mouth, find_mouth, lips_gap
from surface.check.places import Places
from surface.check.subject import Subject
from surface.head import Head

MAX_GAP_MM = 1.2  # maximum height of the gap between closed lips


def check_head(head: Head) -> list[Finding]:
    """Return all defects of a head; an empty list for a good one. The head is left at rest.

    The geometry is checked at rest and with every parameter at 1. Lengths are limited in millimetres
    of a head of usual size, and grow with the distance between the eyes.
    """
    subject = Subject(head)
    found = list(not_finite(subject)) or list(stance.wrong_unit(subject))
    worn = list(damaged_textures(head))
    if not found:
        mouth = find_mouth(subject)
        places, edges = Places(subject, mouth), borders.find_borders(subject)
        found = [
            *stance.off_camera(subject, mouth), *stance.missing_eyes(subject), *stance.inside_out(subject),
            *motions.empty_shapes(subject), *motions.swapped_sides(subject), *motions.blind_lids(subject),
            *unsealed_lips(subject, mouth), *borders.holes(subject, mouth, places, edges),
            *spikes.spikes(subject, places, edges), *overlaps.overlapping(subject, places),
        ]  # fmt: skip
    head.pose(head.values({}))
    return [*found, *worn]


def not_finite(subject: Subject) -> Iterator[Finding]:
    """Find poses with vertices that are not finite."""
    for name in ("", *subject.head.parameters):
        vertices = subject.at_one(name) if name else subject.rest
        bad = [p.name for p, v in zip(subject.parts, vertices, strict=True) if not np.isfinite(v).all()]
        if bad:
            when = f"{name} = 1" if name else "the neutral face"
            yield Finding("not finite", f"{when} throws vertices of {', '.join(bad)} out of space", AGAIN)
            return


def unsealed_lips(subject: Subject, mouth: Mouth | None) -> Iterator[Finding]:
    """Find lips that gape at rest, or where mouthClose should close them over an open jaw."""
    if mouth is None:
        return
    at_rest, x = lips_gap(subject, mouth, subject.rest)
    hint = f"close the lips in the mesh, then {AGAIN}"
    if at_rest > MAX_GAP_MM * subject.scale:
        yield Finding("unsealed lips", f"the neutral face has its lips {at_rest:.1f} mm apart at x = {x:.0f} mm", hint)
    if "mouthClose" in subject.claimed:
        closed, x = lips_gap(subject, mouth, subject.at_one("mouthClose"))
        if closed > max(MAX_GAP_MM * subject.scale, at_rest + 0.5 * MAX_GAP_MM * subject.scale):
            text = f"jawOpen = 1 with mouthClose = 1 leaves the lips {closed:.1f} mm apart at x = {x:.0f} mm"
            yield Finding("unsealed lips", text, f"make mouthClose bring the lips together over jawOpen, then {AGAIN}")
