"""Round skin off where it leaves the scan for good, as at the back of a head that has a knot of hair.

Up to there the skin follows the scan, and beyond it keeps the form of the head that it comes from. Where the scan goes
on in another direction, both would meet at a corner.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from surface.base.arrays import Bools, Floats
from surface.head.model.parameters import smoothstep

LOST_MM = 14.0  # from the nearest skin that is on the scan: from there on skin has left it; holes are smaller
BAND_MM = (15.0, 80.0)  # from skin that has left it, where skin becomes round, and from which on it stays
FRONT_MM = (12.0, 40.0)  # from the front of the face: the same, seen from there
STIFF, LOOSE = 1e4, 1e-8  # weights of where skin is, where it stays and where it becomes round
LEAST = 30  # vertices that have left the scan; of fewer nobody sees a corner


def looseness(at: Floats, on: Bools, able: Floats, front: Floats, scale: float) -> Floats:
    """(n,) how freely vertices ``at (n, 3)`` may leave the scan to become round, 0..1; 0 far from where they leave it.

    on : (n,) which of them lie on the scan. able : (n,) 0..1, which may move at all. front : (k, 3) samples of the
    front of the face. scale : size of the head, relative to one of usual size.
    """
    none = np.zeros(len(at))
    if not on.any() or on.all():
        return none
    lost = ~on & (able > 0.5) & (cKDTree(at[on]).query(at)[0] > LOST_MM * scale)
    if lost.sum() < LEAST:
        return none
    near = 1.0 - smoothstep(cKDTree(at[lost]).query(at)[0], *(scale * np.array(BAND_MM)))
    beside = smoothstep(cKDTree(front).query(at)[0], *(scale * np.array(FRONT_MM))) if len(front) else 1.0
    out: Floats = near * beside * able
    return out


def weights(loose: Floats) -> Floats:
    """(n,) how strongly vertices stay where they are, by how freely they may move (n,)."""
    out: Floats = STIFF * (LOOSE / STIFF) ** loose
    return out
