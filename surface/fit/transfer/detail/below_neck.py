"""Place what lies below the end of a scan's neck, throat, nape and shoulders, as the end of the neck lies.

A scan's neck is often thicker than the head's, or stands elsewhere, as that of a head that is turned. If only the skin
near its end followed it, and the rest stayed where the whole head puts it, the throat would bulge above the end.
"""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Bools, Floats
from surface.fit.transfer.place_parts import ScaleShift
from surface.head.model.data import Neck
from surface.head.model.parameters import smoothstep

ABOVE_MM = 20.0  # above what bends with the neck: from there up nothing is placed as the neck is
LOW_MM = 12.0  # above the lowest matches of a neck, over which the weight of others falls to 1/e
SECTORS = 8  # round the neck; in all of them there must be matches


def neck_place(points: Floats, goals: Floats, found: Bools, neck: Neck, whole: ScaleShift) -> ScaleShift:
    """``whole``, which places the whole head on a scan, shifted in x and z so that the lowest part of the neck that the
    scan shows lies as it does there; ``whole`` itself where the scan does not show the neck all round.

    points : (n, 3) on a head with this neck. goals : (n, 3) where they belong on the scan; only those ``found (n,)``
    count. Neither height nor size follow the neck, because points may slide along it, and shoulders are those of the
    head whatever its neck is.
    """
    height, sector = _height(points, neck), _sector(points, neck)
    ring = found & (height < neck.whole + ABOVE_MM)
    if len(np.unique(sector[ring])) < SECTORS:
        return whole
    lowest = np.array([height[ring & (sector == k)].min() for k in range(SECTORS)])
    weight = np.exp((lowest[sector] - height) / LOW_MM)[ring]
    weight /= np.bincount(sector[ring], weight, SECTORS)[sector[ring]] * SECTORS  # each side counts the same
    off = weight @ (goals[ring] - whole.points(points[ring]))
    return ScaleShift(whole.scale, whole.shift + off * [1.0, 0.0, 1.0])


def neck_share(points: Floats, neck: Neck) -> Floats:
    """(n,) how much each of points (n, 3) on a head belongs to the neck and to what is below it, 0..1."""
    share: Floats = 1.0 - smoothstep(_height(points, neck), neck.whole, neck.whole + ABOVE_MM)
    return share


def _height(points: Floats, neck: Neck) -> Floats:
    height: Floats = points[:, 1] + neck.slope * points[:, 2]
    return height


def _sector(points: Floats, neck: Neck) -> np.ndarray:
    """(n,) number of the sector round the neck's axis that each point lies in."""
    angle = np.arctan2(points[:, 0] - neck.pivot[0], points[:, 2] - neck.pivot[2])
    return np.floor((angle / (2.0 * np.pi) + 0.5) * SECTORS).astype(np.int64) % SECTORS
