"""Correctives that cancel a squint while its eye blinks, where both together would leave the eye open.

A blink alone may close an eye that blink and squint open again, because the two displacements add up to lids that pass
each other or slide along another way.
"""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats32
from surface.check.lids import eye_opening
from surface.check.subject import Subject
from surface.fit.features.finish import add_correctives
from surface.head import Head
from surface.head.model.data import HeadData

MAX_OPENING_MM = 0.5  # of an eye that counts as closed, on a head of average size
BLINK, SQUINT = "eyeBlink{}", "eyeSquint{}"
SIDES = ("Left", "Right")


def cancel_squints_in_blinks(head: HeadData) -> tuple[HeadData, list[str]]:
    """Return the head with a corrective for each eye that a blink alone closes and a squint opens again, and lines for
    the report. The corrective subtracts the squint in proportion to the blink."""
    names = {g.name for p in head.parts for g in p.groups}
    pairs = [(BLINK.format(side), SQUINT.format(side)) for side in SIDES]
    sides = [k for k, pair in enumerate(pairs) if names.issuperset(pair)]
    if head.eye_radius <= 0 or not sides:
        return head, []
    face = Head(head)
    subject = Subject(face)
    wanted, notes = [], []
    for k in sides:
        blink, squint = pairs[k]
        alone, both = (_opening_mm(face, subject, k, pose) for pose in ({blink: 1.0}, {blink: 1.0, squint: 1.0}))
        if both > max(alone, MAX_OPENING_MM * subject.scale):
            wanted.append({"shapes": [blink, squint], "subtract": {squint: 1.0}})
            notes.append(
                f"{squint} left {both:.1f} mm of a blinking eye open: it is now subtracted in proportion to the blink"
            )
    return add_correctives(head, wanted), notes


def _opening_mm(face: Head, subject: Subject, side: int, pose: dict[str, float]) -> float:
    """Visible height of the left (0) or right (1) eyeball in a pose, mm."""
    face.pose(face.values(pose))
    vertices: list[Floats32] = [np.array(part.vertices) for part in face.parts]
    return eye_opening(subject, side, vertices)
