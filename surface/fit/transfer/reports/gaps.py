"""Measure how far the lips and lids of a head are open in poses that should close them."""

from __future__ import annotations

from dataclasses import dataclass

from surface.check.lids import eye_opening
from surface.check.mouth import find_mouth, lips_gap
from surface.check.subject import Subject
from surface.head import Head, HeadData

MOST_MM = 0.5  # greatest gap that counts as closed, on a head of usual size
BLINKS = ("eyeBlinkLeft", "eyeBlinkRight")


@dataclass(frozen=True)
class Gap:
    """The largest height of an opening in a pose, mm, and how much of it is allowed."""

    what: str
    pose: str
    mm: float
    most_mm: float

    def __str__(self) -> str:
        word = "closed" if self.mm <= self.most_mm else "OPEN"
        return f"{self.what}, {self.pose}: {word}, {self.mm:.2f} mm of at most {self.most_mm:.2f}"


def measure_gaps(data: HeadData) -> list[Gap]:
    """Gaps of the lips at rest and where mouthClose closes them over an open jaw, and of the lids in a blink.

    They are measured in pictures from the front, 0.15 mm a pixel, of the triangles that are drawn.
    """
    subject = Subject(Head(data))
    most = MOST_MM * max(subject.scale, 1.0)
    mouth = find_mouth(subject)
    found = []
    if mouth is not None:
        found.append(Gap("lips", "at rest", lips_gap(subject, mouth, subject.rest)[0], most))
        if "mouthClose" in subject.claimed:
            closed = lips_gap(subject, mouth, subject.at_one("mouthClose"))[0]
            found.append(Gap("lips", "jawOpen 1 with mouthClose 1", closed, most))
    for side, blink in enumerate(BLINKS):
        if blink in subject.claimed:
            name = f"{('left', 'right')[side]} lids"
            found.append(Gap(name, f"{blink} 1", eye_opening(subject, side, subject.at_one(blink)), most))
    return found
