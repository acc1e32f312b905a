"""The rigid motion nearest to a motion of points."""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats


def rigid_fit(before: Floats, after: Floats) -> tuple[Floats, Floats]:
    """Rotation (3, 3) and shift (3,) that bring points nearest to others (Kabsch, 1976)."""
    b0, a0 = before.mean(axis=0), after.mean(axis=0)
    u, _, vt = np.linalg.svd((before - b0).T @ (after - a0))
    sign = float(np.sign(np.linalg.det(vt.T @ u.T)))
    turn = vt.T @ np.diag([1.0, 1.0, sign]) @ u.T
    return turn, a0 - turn @ b0
