"""The part of (u, v) to draw: a rectangle, slits that cut it, and loops that trim it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from surface.base.arrays import Floats
from surface.base.checks import numbers
from surface.spline.controlpoints import ControlPoints


@dataclass(frozen=True)
class Slit:
    """A segment of (u, v) across which the surface is cut.

    axis : "u" for a segment that runs along u at v = ``at``, "v" for one that runs along v at u = ``at``
    at : the fixed coordinate
    start, end : the running coordinate, start < end; both end points stay joined
    """

    axis: str
    at: float
    start: float
    end: float

    def __post_init__(self) -> None:
        if self.axis not in ("u", "v"):
            raise ValueError(f'Slit.axis: must be "u" or "v", not {self.axis!r}')
        ends = numbers([self.at, self.start, self.end], "Slit")
        if not np.isfinite(ends).all() or not self.start < self.end:
            raise ValueError(f"Slit: needs finite at and start < end, got {self}")

    def holds(self, uv: Floats) -> np.ndarray:
        """Return (m,) bool: which of ``uv (m, 2)`` lie on the open segment."""
        across, along = (uv[:, 1], uv[:, 0]) if self.axis == "u" else (uv[:, 0], uv[:, 1])
        held: np.ndarray = (across == self.at) & (along > self.start) & (along < self.end)
        return held


@dataclass(frozen=True)
class Domain:
    """Where a surface is drawn.

    rect : u0, u1, v0, v1
    loops : closed polylines ``(k, 2)``; (u, v) is inside where it is inside an odd number of them, so outlines,
        holes and several islands may be in any order; the rectangle cuts off what reaches beyond it. No loops:
        the whole rectangle.
    slits : segments across which the surface is cut; one that reaches beyond the rectangle cuts through its border
    marks : (k, 2) points on the loops at which the border gets a vertex, as at their sharp corners

    ``ValueError`` for an empty rectangle, loops of fewer than three points, slits of another type, or numbers that are
    not finite; names the argument and the index.
    """

    rect: tuple[float, float, float, float]
    loops: Sequence[ArrayLike] = ()
    slits: Sequence[Slit] = ()
    marks: ArrayLike = ()
    segments: Floats = field(init=False, repr=False, compare=False, default_factory=lambda: np.zeros((0, 4)))

    def __post_init__(self) -> None:
        if np.shape(self.rect) != (4,):
            raise ValueError(f"rect: needs (u0, u1, v0, v1), got {self.rect!r}")
        u0, u1, v0, v1 = self.rect
        if not np.isfinite(self.rect).all() or not (u0 < u1 and v0 < v1):
            raise ValueError(f"rect: needs finite u0 < u1 and v0 < v1, got {tuple(self.rect)}")
        for i, slit in enumerate(self.slits):
            if not isinstance(slit, Slit):
                raise ValueError(f"slits[{i}]: must be a Slit, not {slit!r}")
        loops = tuple(_check_loop(loop, i) for i, loop in enumerate(self.loops))
        object.__setattr__(self, "loops", loops)
        object.__setattr__(self, "slits", tuple(self.slits))
        object.__setattr__(self, "marks", _check_marks(self.marks))
        parts = [np.hstack([loop, np.roll(loop, -1, axis=0)]) for loop in loops]
        segments = np.concatenate(parts) if parts else np.zeros((0, 4))
        segments.flags.writeable = False
        object.__setattr__(self, "segments", segments)

    @classmethod
    def of(cls, surface: ControlPoints) -> Domain:
        """Return the rectangle that holds every subdomain of ``surface``."""
        return cls(surface.rect)

    def inside(self, uv: ArrayLike) -> np.ndarray:
        """Return (m,) bool: which of ``uv (m, 2)`` are in the rectangle and inside by the even-odd rule."""
        from . import loops  # compiled: loaded when first used

        samples = np.ascontiguousarray(np.asarray(uv, dtype=np.float64))
        u0, u1, v0, v1 = self.rect
        u, v = samples[:, 0], samples[:, 1]
        within = (u >= u0) & (u <= u1) & (v >= v0) & (v <= v1)
        if len(self.segments):
            within &= loops.inside(self.segments, samples)
        return within

    @property
    def area(self) -> float:
        """Area of the domain in units of u times v; exact for loops inside the rectangle that do not cross."""
        if not len(self.segments):
            u0, u1, v0, v1 = self.rect
            return (u1 - u0) * (v1 - v0)
        total = 0.0
        for i, loop in enumerate(self.loops):
            ring = np.asarray(loop)
            others = [np.asarray(other) for j, other in enumerate(self.loops) if j != i]
            depth = sum(bool(Domain(self.rect, [other]).inside(ring[:1])[0]) for other in others)
            after = np.roll(ring, -1, axis=0)
            area = abs(float((ring[:, 0] * after[:, 1] - ring[:, 1] * after[:, 0]).sum() / 2))
            total += -area if depth % 2 else area
        return total


def _check_marks(marks: ArrayLike) -> Floats:
    """Return marks as (k, 2) float64."""
    points = numbers(marks, "marks")
    if not points.size:
        return np.zeros((0, 2))
    if points.ndim > 2 or points.shape[-1] != 2:
        raise ValueError(f"marks: shape {points.shape}, expected (k, 2)")
    if not np.isfinite(points).all():
        raise ValueError("marks: must be finite")
    return points.reshape(-1, 2)


def _check_loop(loop: ArrayLike, index: int) -> Floats:
    """Return a loop as (k, 2) float64 without repeated points."""
    ring = numbers(loop, f"loops[{index}]")
    if ring.ndim != 2 or ring.shape[1] != 2:
        raise ValueError(f"loops[{index}]: shape {ring.shape}, expected (k, 2)")
    if not np.isfinite(ring).all():
        raise ValueError(f"loops[{index}]: must be finite")
    kept: Floats = ring[(ring != np.roll(ring, 1, axis=0)).any(axis=1)]
    if len(kept) < 3:
        raise ValueError(f"loops[{index}]: {len(kept)} distinct points, needs at least 3")
    kept.flags.writeable = False
    return kept
