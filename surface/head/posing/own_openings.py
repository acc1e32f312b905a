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

    solver : of the lips. before : (n, 3) control points at rest, of the head's file.
    """

    def __init__(self, solver: ContactSolver, before: Floats) -> None:
        self._solver, self._before = solver, before
        self._closed_mm: float | None = None  # how far the lips of the file stand open, once it is needed
        self._own: Sequence[OwnMoves] = ()
        self._at_rest, self._shares = 0.0, list[tuple[int, float, float]]()

    def measure(self, rest: Floats, own: Sequence[OwnMoves]) -> None:
        """Take control points at rest (n, 3), as the user moved them, and the user's groups."""
        self._at_rest = 0.0 if np.array_equal(self._before, rest) else self._share(rest)
        if own is not self._own:
            self._own, self._shares = own, [(each.index, *self._both_ways(each)) for each in own]

    def amount(self, pose: Pose) -> float:
        """Return what they add in a pose."""
        amount = self._at_rest
        for index, more, less in self._shares:
            shown = float(pose.own[index])
            amount += shown * more if shown > 0.0 else -shown * less
        return amount

    def _both_ways(self, own: OwnMoves) -> tuple[float, float]:
        """Shares of a group at 1 and at -1."""
        points = np.stack([self._before, self._before])
        points[:, own.ids] += np.array([1.0, -1.0])[:, None, None] * own.moves
        return self._share(points[0]), self._share(points[1])

    def _share(self, points: Floats) -> float:
        """By what share of :data:`PARTED_MM` points (n, 3) part the lips further than those of the file."""
        if self._closed_mm is None:
            self._closed_mm = _gap(self._solver, self._before)
        return max(_gap(self._solver, points) - self._closed_mm, 0.0) / PARTED_MM


def _gap(solver: ContactSolver, points: Floats) -> float:
    """How far lips stand open at most, mm, where nothing but the contact itself moves ``points (n, 3)``."""
    solver.apply(FORWARD, points.copy())
    return max(float(solver.gaps().max()), 0.0)
