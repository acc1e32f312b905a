"""Pictures of a posed head as arrays: what is nearest to the viewer at every pixel. No OpenGL is needed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Bools, Floats, Floats32, Ints
from surface.base.jit import kernel

Shape = tuple[Floats32, NDArray[np.int32]]
NOTHING = -1  # part and triangle of a pixel where there is none


@kernel
def _draw(points: Any, triangles: Any, part: int, corner: Any, step: float, depth: Any, parts: Any, rows: Any) -> None:
    """Draw triangles (t, 3) of points (m, 3) into ``depth``, ``parts`` and ``rows`` (h, w), row 0 is the lowest y."""
    h, w = depth.shape
    for t in range(triangles.shape[0]):
        a, b, c = points[triangles[t, 0]], points[triangles[t, 1]], points[triangles[t, 2]]
        x0, x1 = (min(a[0], b[0], c[0]) - corner[0]) / step, (max(a[0], b[0], c[0]) - corner[0]) / step
        y0, y1 = (min(a[1], b[1], c[1]) - corner[1]) / step, (max(a[1], b[1], c[1]) - corner[1]) / step
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if not abs(area) > 1e-12:
            continue
        for j in range(max(0, int(np.ceil(y0))), min(h - 1, int(np.floor(y1))) + 1):
            for i in range(max(0, int(np.ceil(x0))), min(w - 1, int(np.floor(x1))) + 1):
                x, y = corner[0] + i * step, corner[1] + j * step
                p = ((b[0] - x) * (c[1] - y) - (b[1] - y) * (c[0] - x)) / area
                q = ((c[0] - x) * (a[1] - y) - (c[1] - y) * (a[0] - x)) / area
                z = p * a[2] + q * b[2] + (1.0 - p - q) * c[2]
                if p >= 0 and q >= 0 and p + q <= 1 and z > depth[j, i]:
                    depth[j, i], parts[j, i], rows[j, i] = z, part, t


@dataclass(frozen=True)
class View:
    """A rectangle of the picture plane, seen against ``turn``'s third row.

    x, y : from, to, mm; step : of a pixel, mm; turn : (3, 3) rotation of head space before it is drawn.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    step: float
    turn: Floats = field(default_factory=lambda: np.eye(3))

    def draw(self, shapes: Sequence[Shape | None]) -> Picture:
        """Return the picture of vertices (m, 3) and triangles (t, 3); None leaves a part out and keeps its number."""
        size = tuple(max(2, int((b - a) / self.step) + 1) for a, b in (self.y, self.x))
        depth = np.full(size, -np.inf)
        parts, rows = np.full(size, NOTHING, np.int64), np.full(size, NOTHING, np.int64)
        corner = np.array([self.x[0], self.y[0]])
        for k, shape in enumerate(shapes):
            if shape is not None:
                points = np.ascontiguousarray(shape[0].astype(np.float64) @ self.turn.T)
                _draw(points, shape[1], k, corner, self.step, depth, parts, rows)
        return Picture(self, depth, parts, rows)


@dataclass(frozen=True)
class Picture:
    """What is nearest at each pixel (h, w): its depth, mm; the number of its part; the row of its triangle."""

    view: View
    depth: Floats
    parts: Ints
    rows: Ints

    def at(self, row: Any, column: Any) -> tuple[Any, Any]:
        """x and y of a pixel, mm; of many where rows and columns are arrays (k,)."""
        return self.view.x[0] + column * self.view.step, self.view.y[0] + row * self.view.step


def view_rotation(yaw_deg: float, pitch_deg: float = 0.0) -> Floats:
    """Return the view rotation (3, 3) of a viewer at ``yaw_deg`` to the subject's left and ``pitch_deg`` above."""
    yaw, pitch = np.radians(yaw_deg), np.radians(pitch_deg)
    about_y = np.array([[np.cos(yaw), 0, -np.sin(yaw)], [0, 1, 0], [np.sin(yaw), 0, np.cos(yaw)]])
    about_x = np.array([[1, 0, 0], [0, np.cos(pitch), -np.sin(pitch)], [0, np.sin(pitch), np.cos(pitch)]])
    turn: Floats = about_x @ about_y
    return turn


def enclosed(open_: Bools, solid: Bools) -> Bools:
    """Return (h, w): pixels of ``open_`` that have ``solid`` ones below and above them in their column."""
    below = np.maximum.accumulate(solid, axis=0)
    above = np.maximum.accumulate(solid[::-1], axis=0)[::-1]
    return open_ & below & above
