"""Look up the colours of a mesh's materials at places in its faces, and spread them over what has none."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import distance_transform_edt

from surface.base.arrays import Bools, Floats, Ints
from surface.base.pictures import decoded
from surface.fit.source.mesh import FitMesh
from surface.fit.source.textures import filtered, linear_picture
from surface.readers.meshdata import Material

LARGEST = 2048  # pixels to each side that are looked at


def looked_up(mesh: FitMesh, faces: Ints, rows: Ints, share: Floats) -> Floats:
    """(m, 4) linear RGB and opacity at places in faces (m,), of which the corners have these ``rows`` (m, 3) of texture
    coordinates; 0 where nothing is known."""
    out = np.zeros((len(faces), 4))
    known = (faces >= 0) & (rows >= 0).all(axis=1)
    for k in np.unique(mesh.piece[faces[known]]):
        own: Bools = known & (mesh.piece[np.maximum(faces, 0)] == k)
        material = mesh.materials[k] if mesh.materials else None
        if material is not None:
            out[own] = _of_material(material, np.einsum("mk,mkx->mx", share[own], mesh.uv[rows[own]]))
    return out


def _of_material(material: Material, uv: Floats) -> Floats:
    picture = linear_picture(material.texture, LARGEST) if material.texture else None
    if picture is None:
        return np.zeros((len(uv), 4))
    if material.alpha == "OPAQUE":
        picture[..., 3] = 1.0
    found: Floats = filtered(picture, material.in_picture(uv)) * [*material.colour[:3], 1.0]
    return found


def pixels_of(material: Material) -> float:
    """How many pixels a material's texture has, as it is looked at; 0 where it has none that can be read."""
    try:
        width, height = decoded(material.texture or b"").size
    except (ImportError, ValueError):
        return 0.0
    return float(width * height * min(1.0, LARGEST / max(width, height)) ** 2)


def spread(colour: Floats, known: Bools) -> Floats:
    """(h, w, c) a picture whose texels that are not ``known`` (h, w) have the colour of the nearest that is, of which
    there must be one."""
    y, x = distance_transform_edt(~known, return_distances=False, return_indices=True)
    nearest: Floats = colour[y, x]
    return nearest
