"""Screen-space bounds of a head: bands of the picture's rows, each from its leftmost to its rightmost pixel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from surface.base.jit import kernel

ROWS = 16
_MARGIN = 3


@kernel
def project(points: Any, matrix: Any, near: Any, pixels: Any) -> bool:
    """Write ``pixels (m, 2)`` of ``points (m, 3)``, all float32; False where one is nearer than ``near``.

    ``matrix`` (4, 4) gives a pixel's coordinates times the depth in its first two rows, and the depth in its last.
    """
    a, b, c, d = matrix[0, 0], matrix[0, 1], matrix[0, 2], matrix[0, 3]
    e, f, g, h = matrix[1, 0], matrix[1, 1], matrix[1, 2], matrix[1, 3]
    p, q, r, s = matrix[3, 0], matrix[3, 1], matrix[3, 2], matrix[3, 3]
    least, one = near, np.float32(1.0)
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        depth = p * x + q * y + r * z + s
        least = min(least, depth)
        over = one / (depth if depth != 0.0 else one)  # none is drawn where it is 0, but dividing would end the loop
        pixels[i, 0] = (a * x + b * y + c * z + d) * over
        pixels[i, 1] = (e * x + f * y + g * z + h) * over
    return bool(least >= near)


@kernel
def sweep(triangles: Any, pixels: Any, rows: int, margin: float, low: Any, high: Any) -> None:
    """Widen the bands ``low``, ``high`` (k,) float64, ``rows`` pixels high each, by the boxes around ``triangles``
    (t, 3) of ``pixels (m, 2)``, with a margin on every side."""
    last, share = low.shape[0] - 1.0, 1.0 / rows
    for t in range(triangles.shape[0]):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        x, y = pixels[a, 0], pixels[a, 1]
        left, right, bottom, top = x, x, y, y
        for k in (b, c):
            x, y = pixels[k, 0], pixels[k, 1]
            left, right = (x if x < left else left), (x if x > right else right)
            bottom, top = (y if y < bottom else bottom), (y if y > top else top)
        first, end = (bottom - margin) * share, (top + margin) * share
        if first >= last + 1.0 or end < 0.0:
            continue
        for band in range(int(max(first, 0.0)), int(min(end, last)) + 1):
            if left - margin < low[band]:
                low[band] = left - margin
            if right + margin > high[band]:
                high[band] = right + margin


@dataclass(frozen=True)
class Bands:
    """Pixels of a picture of ``size``: of each :data:`ROWS` rows from below, those from ``low`` up to ``high``.

    ``low`` and ``high`` are (k,) int64, whole pixels within the picture; a band with ``high`` <= ``low`` is empty.
    """

    size: tuple[int, int]
    low: np.ndarray
    high: np.ndarray

    @classmethod
    def whole(cls, size: tuple[int, int]) -> Bands:
        """All pixels."""
        count = -(-size[1] // ROWS)
        return cls(size, np.zeros(count, np.int64), np.full(count, size[0], np.int64))

    def joined(self, other: Bands) -> Bands:
        """The pixels of both, and those between them in a band; both are of one size."""
        mine, theirs = self.low < self.high, other.low < other.high
        low = np.where(mine & theirs, np.minimum(self.low, other.low), np.where(mine, self.low, other.low))
        high = np.where(mine & theirs, np.maximum(self.high, other.high), np.where(mine, self.high, other.high))
        return Bands(self.size, low, high)

    def boxes(self) -> np.ndarray:
        """(k, 4) int64: left, bottom, right and top of every band that is not empty."""
        some = np.flatnonzero(self.low < self.high)
        top = np.minimum((some + 1) * ROWS, self.size[1])
        return np.column_stack([self.low[some], some * ROWS, self.high[some], top])

    def box(self) -> tuple[int, int, int, int]:
        """The rectangle around all of them: left, bottom, width and height; zeros if there are none."""
        boxes = self.boxes()
        if not len(boxes):
            return 0, 0, 0, 0
        (x, y), (right, top) = boxes[:, :2].min(axis=0).tolist(), boxes[:, 2:].max(axis=0).tolist()
        return x, y, right - x, top - y


class Silhouette:
    """Finds the bands of a picture that parts can cover.

    ``size`` is the picture's, pixels; ``matrix`` (4, 4) maps to clip space; ``near`` is the nearest depth drawn, mm.
    """

    def __init__(self, size: tuple[int, int], matrix: np.ndarray, near: float) -> None:
        self._size, self._near = size, np.float32(near)
        to_pixels = np.array(matrix, np.float64)
        to_pixels[:2] = (0.5 * to_pixels[:2] + 0.5 * to_pixels[3]) * np.array(size)[:, None]
        self._matrix = to_pixels.astype(np.float32)
        count = -(-size[1] // ROWS)
        self._low, self._high = np.full(count, np.inf), np.full(count, -np.inf)

    def add(self, vertices: np.ndarray, triangles: np.ndarray) -> bool:
        """Add a part's ``vertices (m, 3)`` and ``triangles (t, 3)``; False if one is nearer than the camera draws."""
        pixels = np.empty((len(vertices), 2), np.float32)
        if not project(np.asarray(vertices, np.float32), self._matrix, self._near, pixels):
            return False
        sweep(triangles, pixels, ROWS, float(_MARGIN), self._low, self._high)
        return True

    def bands(self) -> Bands:
        """The bands of the parts added, in whole pixels of the picture."""
        width = self._size[0]
        low, high = np.clip(np.floor(self._low), 0, width), np.clip(np.ceil(self._high), 0, width)
        return Bands(self._size, low.astype(np.int64), high.astype(np.int64))


def corners(boxes: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """(6 k, 2) float32: two triangles in clip space for each of ``boxes (k, 4)``, pixels of a picture."""
    box = 2.0 * np.asarray(boxes, np.float64).reshape(-1, 4) / (*size, *size) - 1.0
    return box[:, [0, 1, 2, 1, 2, 3, 0, 1, 2, 3, 0, 3]].reshape(-1, 2).astype(np.float32)
