"""Blinks that a squint opens again: lids that both move further than either alone, or along another way."""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats32
from surface.check.lids import eye_opening
from surface.check.subject import Subject
from surface.fit.features.finish import add_correctives
from surface.head import Head
from surface.head.model.data import HeadData

OPEN_MM = 0.5  # of a head of usual size: so much of an eye may show
SHUT, OTHER = "eyeBlink{}", "eyeSquint{}"
SIDES = ("Left", "Right")


def shut_with_squints(head: HeadData) -> tuple[HeadData, list[str]]:
    """The head with a corrective shape where a blink together with a squint leaves an eye open that the blink alone
    shuts, and what was added, in words: as far as an eye blinks, its squint is taken back."""
    names = {g.name for p in head.parts for g in p.groups}
    pairs = [(SHUT.format(side), OTHER.format(side)) for side in SIDES]
    known = [k for k, pair in enumerate(pairs) if names.issuperset(pair)]
    if head.eye_radius <= 0 or not known:
        return head, []
    face = Head(head)
    subject = Subject(face)
    wanted, notes = [], []
    for k in known:
        blink, squint = pairs[k]
        alone, both = (_open(face, subject, k, pose) for pose in ({blink: 1.0}, {blink: 1.0, squint: 1.0}))
        if both > max(alone, OPEN_MM * subject.scale):
            wanted.append({"shapes": [blink, squint], "subtract": {squint: 1.0}})
            notes.append(
                f"{squint} left {both:.1f} mm of a blinking eye open: it is taken back as far as the eye blinks"
            )
    return add_correctives(head, wanted), notes


def _open(face: Head, subject: Subject, side: int, pose: dict[str, float]) -> float:
    """Height of the left (0) or right (1) eyeball that shows in a pose, mm."""
    face.pose(face.values(pose))
    at: list[Floats32] = [np.array(part.vertices) for part in face.parts]
    return eye_opening(subject, side, at)
