"""Keep what lines the mouth behind the skin of lips and chin, also where lips are closed over an open jaw.

A scan may have a flatter chin than the head that the expressions come from. The lining follows the jaw, and the skin
before it is drawn up by mouthClose: so what lies some millimetres behind the skin at rest may come out through it.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.check.raster import NOTHING, View
from surface.head import Head, HeadData
from surface.head.posing.contact import weights_at
from surface.head.posing.part import SkinPart

POSES: tuple[dict[str, float], ...] = (
    {},
    {"jawOpen": 1.0},
    {"jawOpen": 0.5, "mouthClose": 0.5},
    {"jawOpen": 1.0, "mouthClose": 1.0},
    {"mouthShrugLower": 1.0},
    {"mouthRollLower": 1.0},
    {"mouthPucker": 1.0},
    {"jawForward": 1.0},
    {"jawLeft": 1.0},
    {"jawRight": 1.0},
)
STEP_MM = 0.4  # size of a pixel in which skin and lining are compared
BEHIND_MM = 1.0  # least distance of the lining behind the skin
MAX_BEFORE_MM = 8.0  # what is further before the skin than this has nothing to do with it
TOLD_MM = 0.05  # no remark is made on less, which would be called 0.0 mm
ROUNDS, GAIN = 6, 1.5  # of moving control points; each moves them by so much more than is missing


def keep_lining_behind(head: HeadData) -> tuple[HeadData, list[str]]:
    """Return the head whose mouth's lining stays behind the skin in :data:`POSES`, and remarks on it.

    Control points of the lining move straight back, at rest and so in every pose. A head without lips or lining is
    returned as it is.
    """
    lips = next((c for c in head.contacts if c.name == "lips"), None)
    if lips is None:
        return head, []
    posed = Head(head)
    linings = [p for p in posed.parts if isinstance(p, SkinPart) and p.name in lips.followers]
    moved = {part.name: _moved_back(posed, lips.part, part) for part in linings}
    most = max((float(np.abs(moved[p.name] - p.points).max()) for p in head.parts if p.name in moved), default=0.0)
    if most == 0.0:
        return head, []
    parts = [replace(p, points=moved[p.name]) if p.name in moved else p for p in head.parts]
    note = f"the lining of the mouth was moved back by up to {most:.1f} mm, to stay behind the skin"
    return replace(head, parts=parts), [note] if most >= TOLD_MM else []


def _moved_back(posed: Head, lips: str, lining: SkinPart) -> Floats:
    """Return the control points (n, 3) of one lining at rest, moved back as far as it takes."""
    start, ids, share = weights_at(lining.surface, np.asarray(lining.mesh.uv, float))
    lining.rig.rest = lining.rig.rest.copy()  # the head's data have the same array
    for _ in range(ROUNDS):
        lack = np.zeros(len(lining.mesh.uv))
        for pose in POSES:
            posed.pose(posed.values(pose))
            np.maximum(lack, _lack(posed, lips, lining)[: len(lack)], out=lack)
        if not lack.any():
            break
        lining.rig.rest[:, 2] -= GAIN * _spread(lack, start, ids, share, len(lining.rig.rest))
        lining.rig.invalidate()
    return lining.rig.rest


def _lack(posed: Head, lips: str, lining: SkinPart) -> Floats:
    """Return (m,): how far each vertex of the lining is to go back in the present pose, mm, 0 for most.

    Pixels are compared, not vertices: triangles of the lining are large. Each corner of one takes what its worst pixel
    lacks.
    """
    skin, at = posed.part(lips), lining.vertices
    low, high = at[:, :2].min(axis=0), at[:, :2].max(axis=0)
    view = View((low[0], high[0]), (low[1], high[1]), STEP_MM)
    front, inside = (view.draw([(part.vertices, part.triangles)]) for part in (skin, lining))
    both = (front.parts != NOTHING) & (inside.parts != NOTHING)
    before = np.where(both, inside.depth, 0.0) - np.where(both, front.depth, 0.0) + BEHIND_MM
    rows, columns = np.nonzero(both & (before > 0.0) & (before < MAX_BEFORE_MM))
    lack = np.zeros(len(at))
    for corner in lining.triangles[inside.rows[rows, columns]].T:
        np.maximum.at(lack, corner, before[rows, columns])
    return lack


def _spread(lack: Floats, start: Ints, ids: Ints, share: Floats, n: int) -> Floats:
    """Return (n,): how far control points go so that vertices go by ``lack (m,)``, each point as the vertices that it
    moves want it in the mean, by their ``share``; weights are as :func:`.contact.weights_at` gives them."""
    total, wanted = np.zeros(n), np.zeros(n)
    for k, (a, b) in enumerate(pairwise(start.tolist())):
        if lack[k] > 0.0:
            weight = share[a:b] ** 2
            total[ids[a:b]] += weight
            wanted[ids[a:b]] += weight * lack[k]
    spread: Floats = np.divide(wanted, total, out=np.zeros(n), where=total > 0.0)
    return spread
