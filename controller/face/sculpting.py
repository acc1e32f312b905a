"""Drags of the skin by its control points: with a falloff, on one side or both, and of single points that were added.

Independent of the window library.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from controller.base.parameters import Floats
from controller.face.skin_lines import mirrored
from controller.face.skin_model import SkinModel

MIRROR = np.array([-1.0, 1.0, 1.0])
_LEAST_SHARE = 0.25  # of a pull that control points within the falloff must carry: with less they would go too far
_WIDER, _WIDEST = 1.2, 4.0  # by what a falloff is widened that holds too few of them, and by how much at most
_LEAST_KEPT = 0.05  # as little as is left of a pull where added points would have to carry it
_BESIDE = 0.1  # of a sideways pull that is left at the middle of the face, where both sides work against each other


class SculptDrag:
    """A held point that control points ``ids`` : (k,) follow, each by its ``share`` : (k, 3) of the way along x, y, z.

    model : of the head. uv : (1, 2) the point. place, offset : (3,) mm, see :class:`.point_editing.PointEditor`.
    allowed : (n,) which control points may move. falloff_mm : how far from the point the last one lies that moves;
    without, control points move as :class:`controller.stage.inverse.SculptSolver` finds. tied : both sides of the face
    change alike.
    """

    def __init__(
        self, model: SkinModel, uv: Floats, place: Floats, offset: Floats, allowed: NDArray[np.bool_],
        falloff_mm: float | None = None, *, tied: bool = False,
    ) -> None:  # fmt: skip
        self.place, self.offset = place, offset
        rest, row = model.surface.evaluate(uv)[0], np.asarray(model.surface.basis_matrix(uv).todense()).ravel()
        jaw = float(row @ model.jaw)
        share = np.repeat(_carrying(model, uv, row, rest, jaw, allowed, falloff_mm)[:, None], 3, axis=1)
        if tied:
            uv = mirrored(model.surface, uv, *model.mesh_rest)
            across = np.asarray(model.surface.basis_matrix(uv).todense()).ravel()
            opposite = _carrying(model, uv, across, rest * MIRROR, jaw, allowed, falloff_mm)
            share = share + opposite[:, None] * MIRROR
            share *= _kept(1.0 + float(row @ opposite) * MIRROR)
        self.ids = np.flatnonzero(np.abs(share).max(axis=1) > 1e-4)
        self.share: Floats = share[self.ids]


def _kept(amount: Floats) -> Floats:
    """(3,) by what shares are multiplied so that the point follows; a pull across the middle of the face is let go."""
    return np.where(amount > _BESIDE, 1.0 / np.maximum(amount, _BESIDE), 0.0)


def _carrying(
    model: SkinModel, uv: Floats, row: Floats, rest: Floats, jaw: float, allowed: NDArray[np.bool_],
    falloff_mm: float | None,
) -> Floats:  # fmt: skip
    """(n,) how far each control point goes so that the point with weights ``row`` (n,) goes by 1."""
    radius_mm = falloff_mm or np.inf
    while falloff_mm is not None and radius_mm <= _WIDEST * falloff_mm:
        squared = ((model.surface.points - rest) ** 2).sum(axis=1) / radius_mm**2
        share: Floats = (
            np.clip(1.0 - squared, 0.0, None) ** 2 * (1.0 - np.abs(model.jaw - jaw)).clip(0.0, 1.0) * allowed
        )
        carried = float(row @ share)
        if carried > _LEAST_SHARE:
            return share / carried
        radius_mm *= _WIDER
    unit = model.sculptor.solve(uv, np.array([[1.0, 0.0, 0.0]]), least_mm=1e-4)
    out = np.zeros(len(row))
    out[unit.ids] = unit.moves[:, 0]
    return out * allowed / max(float(row @ (out * allowed)), _LEAST_KEPT)


class LightDrag:
    """A held control point that was added, ``ids`` : (1,) or with the one on the other side (2,).

    A light control point goes far for a little of the skin: ``share`` says how far for a millimetre.

    uv : (1, 2) or (2, 2) their middles.
    """

    def __init__(self, model: SkinModel, ids: NDArray[np.integer], uv: Floats, place: Floats, offset: Floats) -> None:
        self.place, self.offset, self.ids = place, offset, ids
        rows = np.asarray(model.surface.basis_matrix(uv).todense())
        own = rows[np.arange(len(ids)), ids]
        self.share: Floats = np.repeat(1.0 / np.maximum(own, 1e-9)[:, None], 3, axis=1)
        self.share[1:] *= MIRROR
