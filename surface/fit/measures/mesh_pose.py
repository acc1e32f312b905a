"""The mesh in the pose that shows one of its shapes, to measure a head against.

A jaw that is open in part is on an arc in every head, half-way through the file's straight displacement: what the
mesh's own shape of it gives there is a chord, up to some millimetres beside the arc. So the mesh follows the arc, too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from surface.base.arrays import Floats
from surface.check.subject import pose_of
from surface.fit.features.rigging import jaw_share
from surface.fit.points.report import NEUTRAL
from surface.fit.source.mesh import FitMesh
from surface.head.model.data import Jaw
from surface.head.model.parameters import TONGUE_JAW
from surface.head.posing.rig import jaw_path


def displacement(mesh: FitMesh, sources: Mapping[str, Sequence[int]], shape: str, jaw: Jaw) -> Floats:
    """Return (n, 3), mm: how the vertices of a mesh are moved in the pose that shows a shape.

    sources : by parameter, the shapes of the mesh that add up to it. shape : a parameter, or :data:`NEUTRAL`.
    jaw : the head's path of the jaw, followed where the shape opens it in part, as tongueOut does.
    """
    out = np.zeros_like(mesh.vertices)
    for name, amount in _amounts(shape).items():
        if name in sources:
            whole = mesh.deltas[list(sources[name])].sum(axis=0)
            out += opening(mesh.vertices, whole, jaw, amount) if name == "jawOpen" else amount * whole
    return out


def opening(rest: Floats, whole: Floats, jaw: Jaw, amount: float) -> Floats:
    """Return (n, 3): how an open jaw moves vertices ``rest (n, 3)`` when it is open by ``amount``, 0..1.

    whole : (n, 3) the same at 1. Each vertex follows the jaw's arc by its own share; the rest of the way is straight.
    """
    share = jaw_share(rest, whole, jaw)[:, None]
    part, full = (turned - rest for turned in (_turned(rest, jaw, amount), _turned(rest, jaw, 1.0)))
    moved: Floats = share * part + amount * (whole - share * full)
    return moved


def _amounts(shape: str) -> dict[str, float]:
    """Parameters of the mesh in the pose that shows a shape."""
    if shape == NEUTRAL:
        return {}
    return pose_of(shape) | ({"jawOpen": TONGUE_JAW} if shape == "tongueOut" else {})  # as far as the tongue needs


def _turned(rest: Floats, jaw: Jaw, amount: float) -> Floats:
    turn, shift = jaw_path(jaw, amount)
    moved: Floats = rest @ turn.T + shift
    return moved
