"""The fold of the upper lids: where skin lies relative to it at rest, and how much of it is left in a pose.

A crease runs along the upper lid over its platform, the strip of the lid that an open eye shows. As the eye shuts the
lid unfolds and a soft line remains; where the brow sinks, its skin hangs over the crease and hides it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: The crease, from the inner corner of the eye (0) to the outer one (1): how high it is over the corners, as a share of
#: its greatest height. It begins over the inner corner and runs out beyond the outer one.
_ALONG = np.array([-0.10, 0.10, 0.25, 0.50, 0.72, 0.90, 1.05, 1.25])
_HEIGHT = np.array([0.25, 0.56, 0.83, 1.00, 0.93, 0.68, 0.42, 0.10])
#: Where it begins and is whole, and where it begins to fade and has gone.
_BEGINS, _FADES = (0.0, 0.38), (0.68, 1.22)
#: How far behind the middle of the lid's rim, in widths of the eye, skin may lie that has a fold.
_BEHIND = 0.75
#: Share of the opening at rest at which the crease is whole; what is left of it when the eye is shut.
_OPEN, _SHUT = (0.15, 1.0), 0.42
#: Height of the platform, as a share of that at rest, at which the brow hides the crease and where it is whole.
_HIDDEN = 0.45, 0.85


@dataclass(frozen=True)
class Fold:
    """The fold over one eye.

    ids : (3,) vertices of the face in the eye's middle: the upper lid's rim, the lower one's, and the crease.
    at : (m, 2) of the face's vertices: height over the crease, mm, and how deep it is there, 0 where there is none.
    opening, platform : distances at rest of the rims from each other, and of the crease from the upper one, mm.
    """

    ids: np.ndarray
    at: np.ndarray
    opening: float
    platform: float

    def left(self, now: np.ndarray) -> float:
        """How deep the crease is in a pose, 0 to 1; ``now`` (3, 3): positions of :attr:`ids`."""
        opening, platform = _lengths(now)
        open_ = _SHUT + (1.0 - _SHUT) * _smooth(opening / self.opening, *_OPEN)
        return float(open_ * _smooth(platform / self.platform, *_HIDDEN))


def fold_over(vertices: np.ndarray, upper: np.ndarray, lower: np.ndarray, painted: np.ndarray) -> Fold | None:
    """The fold over an eye; None where lids say nothing of it.

    vertices : (m, 3) of the face at rest. upper, lower : (k,) of them along the lids' rims.
    painted : (m, 2) how deep the fold is, and how high its platform is seen from the front, mm.
    """
    at = np.asarray(vertices, float)
    rim = at[upper]
    ends = rim[[0, -1]]
    inner, outer = ends[np.argsort(np.abs(ends[:, 0]))]
    width = abs(outer[0] - inner[0])
    if width < 1e-6:
        return None
    along = (at[:, 0] - inner[0]) / (outer[0] - inner[0])
    line = inner[1] + along * (outer[1] - inner[1])
    top = int(np.argmax(rim[:, 1] - inner[1] - (rim[:, 0] - inner[0]) / (outer[0] - inner[0]) * (outer[1] - inner[1])))
    platform = float(painted[upper, 1].mean())
    rise = rim[top, 1] - line[upper[top]] + platform
    height = rise * _curve(along)
    slope = np.gradient(rise * _curve(_STEPS), _STEPS) / width
    across = (at[:, 1] - line - height) / np.sqrt(1.0 + np.interp(along, _STEPS, slope) ** 2)
    deep = painted[:, 0] * _smooth(along, *_BEGINS) * (1.0 - _smooth(along, *_FADES))
    deep[at[:, 2] < rim[top, 2] - _BEHIND * width] = 0.0
    middle = np.abs(along - 0.5) < 0.12
    crease = np.where(middle & (deep > 0.0), np.hypot(across, 0.5 * width * (along - 0.5)), np.inf)
    if not np.isfinite(crease).any():
        return None
    centre = [ids[np.argmin(np.abs(along[ids] - 0.5))] for ids in (upper, lower)]
    ids = np.array([*centre, np.argmin(crease)])
    opening, high = _lengths(at[ids])
    return Fold(ids, np.column_stack([across, deep]).astype(np.float32), max(opening, 1e-6), max(high, 1e-6))


_STEPS = np.linspace(_ALONG[0], _ALONG[-1], 64)


def _curve(along: np.ndarray) -> np.ndarray:
    """Shares of the crease's height, smooth between its places."""
    coarse = np.interp(_STEPS, _ALONG, _HEIGHT)
    soft = np.convolve(np.pad(coarse, 6, mode="reflect", reflect_type="odd"), np.full(13, 1.0 / 13.0), "valid")
    return np.asarray(np.interp(along, _STEPS, soft))


def _lengths(at: np.ndarray) -> tuple[float, float]:
    """Distances of the upper rim (first of (3, 3)) from the lower one and from the crease."""
    return float(np.linalg.norm(at[0] - at[1])), float(np.linalg.norm(at[2] - at[0]))


def _smooth(x: np.ndarray | float, low: float, high: float) -> np.ndarray:
    t = np.clip((np.asarray(x, float) - low) / (high - low), 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))
