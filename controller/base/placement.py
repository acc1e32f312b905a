"""Where a head is in a room that several share, and points of the room as the head sees them."""

from __future__ import annotations

import math
from dataclasses import dataclass

Point = tuple[float, float, float]
"""x, y, z, mm."""


@dataclass(frozen=True)
class Placement:
    """Position of the middle between a head's eyes in the room, mm, and where it looks.

    The room's axes: y up; x to the left of a head whose yaw is 0, and z where that head looks.

    position_mm : (x, y, z). yaw_deg : rotation about y; positive to the head's own left.
    """

    position_mm: Point = (0.0, 0.0, 0.0)
    yaw_deg: float = 0.0

    def to_head(self, point_mm: Point) -> Point:
        """A point of the room in the axes of the head: x to its left, y up, z forward from between its eyes."""
        x, y, z = (a - b for a, b in zip(point_mm, self.position_mm, strict=True))
        sine, cosine = math.sin(math.radians(self.yaw_deg)), math.cos(math.radians(self.yaw_deg))
        return cosine * x - sine * z, y, sine * x + cosine * z

    def to_room(self, point_mm: Point) -> Point:
        """A point in the axes of the head as a point of the room."""
        x, y, z = point_mm
        sine, cosine = math.sin(math.radians(self.yaw_deg)), math.cos(math.radians(self.yaw_deg))
        turned = cosine * x + sine * z, y, -sine * x + cosine * z
        return tuple(a + b for a, b in zip(turned, self.position_mm, strict=True))  # type: ignore[return-value]
