"""Where hair grows: inside a line round the head, given by points on its left side."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.spatial import cKDTree

from surface.base.arrays import Floats
from surface.fit.wardrobe.skin import CENTRE, Skin, unit

#: Points of the line from the forehead's middle to the nape's, mm: temple, in front of the ear, over it, behind it.
POINTS = np.array(
    [
        (0, 113, 85), (22, 112, 82), (40, 107, 72), (53, 96, 64), (61, 80, 62), (66, 64, 56), (73, 46, 42),
        (76, 24, 30), (78, 8, 23), (79, 16, 15), (81, 40, 5), (80, 38, -14), (74, 14, -25), (62, -16, -32),
        (47, -44, -40), (22, -54, -54), (0, -56, -58),
    ],
    float,
)  # fmt: skip
#: The same where hair hangs down over the temple: in one slant, seen from the side, without a corner between forehead
#: and temple.
SLANTED = np.vstack([POINTS[:2], [(38, 105, 76), (50, 92, 70), (59, 77, 62), (66, 62, 53)], POINTS[6:]]).astype(float)
#: The same where hair has receded: high corners at the temples beside what is left in the middle.
RECEDED = np.vstack(
    [[(0, 122, 76), (14, 124, 71), (28, 129, 50), (42, 124, 38), (54, 108, 40), (63, 86, 45), (68, 64, 47)], POINTS[6:]]
)
#: The same where hair is drawn back: with a point over the forehead's middle, close above the ears' roots and behind
#: them, and higher at the nape.
TIED = np.array(
    [
        (0, 107, 87), (9, 110, 86), (22, 113, 82), (38, 109, 71), (51, 97, 63), (60, 80, 61), (66, 62, 56),
        (72, 49, 46), (77, 37, 36), (80, 33, 26), (81, 37, 14), (81, 38, 2), (80, 35, -8), (76, 20, -15),
        (68, -6, -22), (56, -34, -33), (24, -51, -58), (0, -52, -63),
    ],
    float,
)  # fmt: skip


def angles(points: Floats) -> tuple[Floats, Floats]:
    """Angle from the crown (n,) and round it from the front (n,), rad, of points (n, 3) from the skull's centre."""
    x, y, z = unit(points - CENTRE).T
    return np.arccos(np.clip(y, -1.0, 1.0)), np.arctan2(x, z)


def directions(down: Floats, round_it: Floats) -> Floats:
    """Unit vectors (n, 3) at such angles."""
    return np.column_stack([np.sin(down) * np.sin(round_it), np.cos(down), np.sin(down) * np.cos(round_it)])


class Hairline:
    """The line as a function of the angle round the crown.

    skin : of the head. points : (k, 3) of the left side, from the front's middle to the nape's.
    """

    def __init__(self, skin: Skin, points: Floats = POINTS) -> None:
        down, round_it = angles(points)
        round_it = np.maximum.accumulate(np.abs(round_it) + 1e-4 * np.arange(len(round_it)))
        round_it[-1] = np.pi
        self._down = PchipInterpolator(round_it, down, extrapolate=True)
        every = np.linspace(-np.pi, np.pi, 1440)
        lines = directions(self.down(every), every)
        self.line: Floats = CENTRE + lines * skin.reach(lines)[:, None]
        self._tree = cKDTree(self.line)

    def down(self, round_it: Floats) -> Floats:
        """(n,) angle from the crown at which hair ends."""
        return np.asarray(self._down(np.abs(round_it)))

    def inside(self, points: Floats) -> Floats:
        """(n,) how far inside the line points on the skin (n, 3) lie, mm; negative outside."""
        down, round_it = angles(points)
        away, _ = self._tree.query(points)
        return np.asarray(np.where(down < self.down(round_it), away, -away))
