"""Computes how control points follow a drag of the skin: with a falloff, on one side or both, or a single added point.

This module does not depend on the window library.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from controller.base.parameters import Floats
from controller.face.skin_lines import mirror_uv
from controller.face.skin_model import SkinModel

MIRROR = np.array([-1.0, 1.0, 1.0])
_MIN_CARRIED = 0.25  # weight that control points within the falloff must have at the point, lest they move too far
_WIDENING_FACTOR = 1.2  # of a falloff with too few control points, in each step
_MAX_WIDENING = 4.0  # of a falloff in all
_MIN_SOLVED = 0.05  # smallest weight by which the solution without falloff is scaled up
_MIN_TIED = 0.1  # smallest amount of a tied pull that is scaled up; near the middle both sides cancel sideways


class SculptDrag:
    """A held point of the skin that control points follow.

    model : of the head. uv : (1, 2) the point. place : (3,) mm, its position when it was picked. offset : (3,) mm, from
    the place under the mouse to it. allowed : (n,) bool, which control points may move. falloff_mm : distance from the
    point up to which control points move; None: they move as :class:`controller.stage.inverse.SculptSolver` computes.
    tied : whether both sides of the face change alike.

    Attributes
    ----------
    ids : (k,) the control points that move. share : (k, 3) their motion, relative to that of the point, along x, y, z.
    """

    def __init__(
        self, model: SkinModel, uv: Floats, place: Floats, offset: Floats, allowed: NDArray[np.bool_],
        falloff_mm: float | None = None, *, tied: bool = False,
    ) -> None:  # fmt: skip
        self.place, self.offset = place, offset
        rest, row = model.surface.evaluate(uv)[0], np.asarray(model.surface.basis_matrix(uv).todense()).ravel()
        jaw = float(row @ model.jaw)
        share = np.repeat(_follow_weights(model, uv, row, rest, jaw, allowed, falloff_mm)[:, None], 3, axis=1)
        if tied:
            uv = mirror_uv(model.surface, uv, *model.mesh_rest)
            across = np.asarray(model.surface.basis_matrix(uv).todense()).ravel()
            opposite = _follow_weights(model, uv, across, rest * MIRROR, jaw, allowed, falloff_mm)
            share = share + opposite[:, None] * MIRROR
            share *= _tied_scale(1.0 + float(row @ opposite) * MIRROR)
        self.ids = np.flatnonzero(np.abs(share).max(axis=1) > 1e-4)
        self.share: Floats = share[self.ids]


def _tied_scale(amount: Floats) -> Floats:
    """Return the factors (3,) with which a point follows although it moves by ``amount``; 0 where that is too small.

    That drops a sideways pull near the middle of the face, where the two sides cancel each other.
    """
    return np.where(amount > _MIN_TIED, 1.0 / np.maximum(amount, _MIN_TIED), 0.0)


def _follow_weights(
    model: SkinModel, uv: Floats, row: Floats, rest: Floats, jaw: float, allowed: NDArray[np.bool_],
    falloff_mm: float | None,
) -> Floats:  # fmt: skip
    """Return how far each control point moves (n,) so that the point with the weights ``row`` : (n,) moves by 1."""
    radius_mm = falloff_mm or np.inf
    while falloff_mm is not None and radius_mm <= _MAX_WIDENING * falloff_mm:
        squared = ((model.surface.points - rest) ** 2).sum(axis=1) / radius_mm**2
        share: Floats = (
            np.clip(1.0 - squared, 0.0, None) ** 2 * (1.0 - np.abs(model.jaw - jaw)).clip(0.0, 1.0) * allowed
        )
        carried = float(row @ share)
        if carried > _MIN_CARRIED:
            return share / carried
        radius_mm *= _WIDENING_FACTOR
    unit = model.sculptor.solve(uv, np.array([[1.0, 0.0, 0.0]]), least_mm=1e-4)
    out = np.zeros(len(row))
    out[unit.ids] = unit.moves[:, 0]
    return out * allowed / max(float(row @ (out * allowed)), _MIN_SOLVED)


class LightDrag:
    """A held light control point (one that the user added), perhaps with the one on the other side.

    ids : (1,) or (2,) the control points. uv : (1, 2) or (2, 2) their centres. A light control point has to move far to
    move the skin a little; ``share`` : (1, 3) or (2, 3) is how far for a millimetre.
    """

    def __init__(self, model: SkinModel, ids: NDArray[np.integer], uv: Floats, place: Floats, offset: Floats) -> None:
        self.place, self.offset, self.ids = place, offset, ids
        rows = np.asarray(model.surface.basis_matrix(uv).todense())
        weights = rows[np.arange(len(ids)), ids]
        self.share: Floats = np.repeat(1.0 / np.maximum(weights, 1e-9)[:, None], 3, axis=1)
        self.share[1:] *= MIRROR
