"""How far a user's own changes part the lips of a head: groups of the user, and control points moved at rest.

Lips stay together in poses that hardly open them (see :class:`surface.head.model.data.Seal`), which is judged by the
shapes of the face. Own changes have no such shares, so how far they part the lips is measured.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from surface.base.arrays import Floats
from surface.head.model.own_groups import OwnMoves
from surface.head.model.parameters import Pose
from surface.head.posing.contact import FORWARD, ContactSolver

PARTED_MM = 2.0
"""Own changes that part the lips by so much open them in full; by what share of it lips stay together, their seal
says."""


class OwnOpenings:
    """What own changes add to what opens one pair of lips, for :meth:`surface.head.model.rules.SealDriver.amount`.

    solver : of the lips. before, rest : (n, 3) control points at rest, of the head's file and as the user moved them.
    own : the user's groups.
    """

    def __init__(self, solver: ContactSolver, before: Floats, rest: Floats, own: Sequence[OwnMoves]) -> None:
        self._indices = [each.index for each in own]
        self._at_rest, self._shares = 0.0, np.zeros((len(own), 2))
        moved = not np.array_equal(before, rest)
        if not moved and not own:
            return
        now = _gap(solver, rest)
        self._at_rest = max(now - _gap(solver, before), 0.0) / PARTED_MM if moved else 0.0
        for k, each in enumerate(own):
            for way in (0, 1):
                points = rest.copy()
                points[each.ids] += (1.0, -1.0)[way] * each.moves
                self._shares[k, way] = max(_gap(solver, points) - now, 0.0) / PARTED_MM

    def amount(self, pose: Pose) -> float:
        """Return what they add in a pose."""
        amount = self._at_rest
        for index, (more, less) in zip(self._indices, self._shares, strict=True):
            shown = float(pose.own[index])
            amount += shown * more if shown > 0.0 else -shown * less
        return amount


def _gap(solver: ContactSolver, points: Floats) -> float:
    """How far lips stand open at most, mm, where nothing but the contact itself moves ``points (n, 3)``."""
    solver.apply(FORWARD, points.copy())
    return max(float(solver.gaps().max()), 0.0)
