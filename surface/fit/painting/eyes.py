"""What eyes look like from the front: pieces of a mesh one behind the other, as a picture that an eyeball wears.

Balls, half shells, and the flat irises of drawn characters, which lie on or behind the white, become pictures alike.
"""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.fit.eyes.colours import faces_by_side
from surface.fit.eyes.names import is_cover, is_iris
from surface.fit.eyes.search import Eyes
from surface.fit.painting.lookup import looked_up, spread
from surface.fit.painting.raster import covering
from surface.fit.source.mesh import FitMesh, face_of_triangles, triangles

SIDE = 256  # texels along the picture of an eye
LEAST = 0.1  # of the picture, which must be covered: an iris alone covers more
SEEN = 0.5  # opacity from which on a texel is known


def eye_pictures(mesh: FitMesh, eyes: Eyes) -> list[Floats | None]:
    """(SIDE, SIDE, 3) linear RGB of the left and of the right eye, from the left to the right and from the top down,
    each as wide as its eyeball; None where the mesh has no texture for it."""
    if eyes.radius <= 0.0:
        return [None, None]
    sides = zip(faces_by_side(mesh, eyes), eyes.centres, strict=True)
    return [_picture(mesh, _coloured(mesh, ids), centre, eyes.radius) for ids, centre in sides]


def _coloured(mesh: FitMesh, faces: Ints) -> Ints:
    """Those of the faces of an eye that give it colours: no cornea, no highlight, nothing without a texture."""
    names = [mesh.piece_of(int(f)) for f in faces]
    own = np.array([is_iris(name) or not is_cover(name) for name in names], bool)
    textured = np.array([m is not None and m.texture is not None for m in mesh.materials], bool)
    return faces[own & textured[mesh.piece[faces]]] if len(textured) else faces[:0]


def _picture(mesh: FitMesh, faces: Ints, centre: Floats, radius: float) -> Floats | None:
    """The picture of one eye: what lies further in front covers what is behind it, where it is not clear."""
    at = (mesh.vertices - centre) / radius
    total = np.zeros((SIDE, SIDE, 4))
    for piece in _from_the_back(mesh, faces, at):
        rgba = _layer(mesh, faces[mesh.piece[faces] == piece], at)
        cover = rgba[..., 3:]
        total[..., :3] = cover * rgba[..., :3] + (1.0 - cover) * total[..., :3]
        total[..., 3:] = cover + (1.0 - cover) * total[..., 3:]
    known = total[..., 3] >= SEEN
    if known.mean() < LEAST:
        return None
    return spread(total[..., :3] / np.maximum(total[..., 3:], SEEN), known)


def _from_the_back(mesh: FitMesh, faces: Ints, at: Floats) -> list[int]:
    """Pieces of an eye, by how far in front they are; irises come last, because the rims of a white may lie before
    those of drawn characters."""
    depth = at[mesh.faces[faces, :3], 2].mean(axis=1)
    pieces = np.unique(mesh.piece[faces])
    front = {int(k): float(np.percentile(depth[mesh.piece[faces] == k], 90)) for k in pieces}
    return sorted(front, key=lambda k: (is_iris(mesh.pieces[k]), front[k]))


def _layer(mesh: FitMesh, faces: Ints, at: Floats) -> Floats:
    """(SIDE, SIDE, 4) linear RGB and opacity of some faces that look forwards, the foremost of each texel."""
    tri, rows = triangles(mesh.faces[faces]), triangles(mesh.face_uv[faces], mesh.faces[faces])
    number = faces[face_of_triangles(mesh.faces[faces])]
    corner = at[tri]
    ahead = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[:, 2] > 0.0
    order = np.flatnonzero(ahead)[np.argsort(corner[ahead, :, 2].mean(axis=1))]  # what comes last covers the others
    flat = 0.5 * SIDE * (corner[order, :, :2] * [1.0, -1.0] + 1.0)
    owner, share = covering(np.ascontiguousarray(flat), SIDE, SIDE)
    seen = owner >= 0
    rgba = np.zeros((SIDE, SIDE, 4))
    own = order[owner[seen]]
    rgba[seen] = looked_up(mesh, number[own], rows[own], share[seen])
    return rgba
