"""A bust that rises with each breath: a displacement by place, so that every head whose neck ends in one has it."""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats
from surface.head.model.data import Neck
from surface.head.model.parameters import smoothstep

STEP_MM = 1.0 / 64.0
"""Breaths that differ by less are drawn alike, so that a chest that hardly moves is not computed again."""
WIDEST = 0.25
"""Share by which pupils may be wider or narrower than the light makes them."""
_FRONT = -0.6, 0.9  # from the neck's pivot, in lengths of the neck's bend: from behind it to the breast bone
_SIDE, _HALF = 0.35, 1.7  # how far shoulders go outwards, and half the width of a bust, in the same lengths
_LEAST = 1e-4


def breath_moves(points: Floats, neck: Neck) -> Floats:
    """Return (n, 3): displacement of points at rest (n, 3) for each mm by which the chest rises.

    Where the neck follows the head nothing moves, and from there down more and more. The front goes up and forwards
    alike, as the third ribs do, less to the sides (De Groote et al., "Chest wall motion during tidal breathing", J.
    Appl. Physiol. 83, 1997); the back goes up only.
    """
    length = neck.whole - neck.still
    share = (1.0 - neck.share(points)) ** 2
    local = (points - np.array(neck.pivot)) / length
    front = smoothstep(local[:, 2], *_FRONT)
    side = _SIDE * np.clip(local[:, 0] / _HALF, -1.0, 1.0)
    moves: Floats = share[:, None] * np.column_stack([side, 0.6 + 0.4 * front, front])
    moves[np.abs(moves).max(axis=1, initial=0.0) < _LEAST] = 0.0
    return moves
