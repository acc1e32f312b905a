"""A mouthClose made from jawOpen, for meshes that have none: the lips go back to where they met, the chin stays.

The lips are found by the jaw: along them skin that it takes down lies next to skin that stays. Around them the motion
of the jaw is taken back, whole at the lips and fading towards the chin.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from surface.base.arrays import Bools, Floats
from surface.fit.source.kinds import kind_of
from surface.fit.source.mesh import FitMesh
from surface.head.model.parameters import smoothstep

LOWER, UPPER = 0.6, 0.3  # of the jaw's largest motion: the lower lip moves at least so far, the upper lip no further
NEAR = 0.2  # of that motion: only along the lips are skin that moves and skin that stays this near to each other
MIN_VERTICES = 6  # along the lips
FADE = 0.15, 0.9  # of the way from the lips to where less than UPPER is left of the motion: where it is taken back in
# part, and not at all
OTHER = ("teeth", "gums", "tongue")  # materials of pieces that stay with the jaw
SKIN = "skin"


def made_close(mesh: FitMesh) -> Floats | None:
    """(n, 3) displacements of a mouthClose that brings the lips together over a jawOpen of 1.

    None where the mesh, which is in head space, has no jawOpen, or no lips that it opens.
    """
    if "jawOpen" not in mesh.names:
        return None
    jaw, skin = mesh.deltas[mesh.names.index("jawOpen")], _of(mesh, (SKIN,))
    along = _along(jaw, skin)
    down, still = np.flatnonzero(skin & (along > LOWER)), np.flatnonzero(skin & (along < UPPER))
    if not len(down) or not len(still):
        return None
    at, most = mesh.vertices, float(np.linalg.norm(jaw[skin], axis=1).max())
    distance, other = cKDTree(at[still]).query(at[down])
    lips = (distance < NEAR * most) & (at[still][other, 1] >= at[down, 1] - NEAR * most)
    if lips.sum() < MIN_VERTICES:
        return None
    line = 0.5 * (at[down[lips]] + at[still[other[lips]]])
    reach = float(line[:, 1].mean() - at[skin & (along > UPPER), 1].min())
    share = 1.0 - smoothstep(cKDTree(line).query(at)[0] / max(reach, 1e-9), *FADE)
    back: Floats = -np.where(_of(mesh, OTHER), 0.0, share)[:, None] * jaw
    return back


def _along(jaw: Floats, skin: Bools) -> Floats:
    """(n,) how far the jaw takes vertices in the direction in which it takes the skin furthest, at most about 1."""
    far = np.where(skin, np.linalg.norm(jaw, axis=1), 0.0)
    if not far.any():
        return far
    down = jaw[(far > LOWER * far.max()) & (jaw[:, 1] < 0.0)].sum(axis=0)
    out: Floats = jaw @ down / max(float(np.linalg.norm(down)), 1e-9) / far.max()
    return out


def _of(mesh: FitMesh, materials: tuple[str, ...]) -> Bools:
    """(n,) vertices of pieces that are one of some materials; pieces without names are skin."""
    if not mesh.pieces:
        return np.full(len(mesh.vertices), SKIN in materials)
    out = np.zeros(len(mesh.vertices), bool)
    for k, name in enumerate(mesh.pieces):
        if kind_of(name).material in materials and kind_of(name).rule != "eye":
            own = mesh.faces[mesh.piece == k]
            out[own[own >= 0]] = True
    return out
