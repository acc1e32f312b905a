"""How much of each eye shows, seen from the front, at rest and in a blink."""

from __future__ import annotations

from surface.base.arrays import Floats32
from surface.check.raster import View
from surface.check.subject import Subject

STEP_MM = 0.15  # pixel size, times the head's scale


def eye_opening(subject: Subject, side: int, vertices: list[Floats32]) -> float:
    """Return the largest height of the left (0) or right (1) eyeball that shows, mm; 0 without an eyeball."""
    number = subject.eye(side)
    if number is None:
        return 0.0
    at = vertices[number]
    (x0, y0), (x1, y1) = at[:, :2].min(axis=0), at[:, :2].max(axis=0)
    picture = View((x0, x1), (y0, y1), STEP_MM * subject.scale).draw(subject.shapes(vertices))
    return float((picture.parts == number).sum(axis=0).max() * picture.view.step)
