"""The texture of a head that has the form of a scan: the scan's colours, wherever its skin lies on the scan.

Photographs show brows, lips, pores and hair, which layers of paint over (u, v) cannot. So the paint of a head that gets
a texture has one colour, and the brows are those of the scan.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

from surface.base.arrays import Bools, Floats
from surface.fit.painting.raster import covering
from surface.fit.painting.skin import Square, room_for
from surface.fit.painting.texture import joined
from surface.fit.source.textures import Samples
from surface.head import Head, HeadData, HeadPart
from surface.head.model.face import face_of
from surface.head.model.parameters import smoothstep
from surface.head.model.texture import HeadTexture
from surface.head.posing.paint import BASE

SIDE, OTHERS = 1024, 512  # texels along (u, v) of the face, and of other parts
NEAR_MM = 2.0  # between skin and the samples that it has its colour from
NEIGHBOURS = 4  # samples that a texel's colour is a mean of, by their distances
EYE_REACH = 1.12  # radii about an eyeball's centre within which samples in front of it show the eye
LEAST = 0.3  # of the face that must lie on the scan
FEW = 30_000  # samples on a head: fewer are too coarse for a picture, and become paint alone
BESIDE = 4.0, 60.0  # texels beside the scan over which its colours turn into the skin's own


def scan_texture(data: HeadData, samples: Samples) -> tuple[HeadData, HeadTexture | None]:
    """A head that lies on a scan, painted with the scan's colours, and its texture; without one, the head is as it was.

    samples : the scan's colours, in the head's place.
    """
    solid = (samples.colour[:, 3] > 0.5) & ~_on_eyes(data, samples.points)
    head = Head(data)
    face = face_of(head.parts, data.contacts)
    if face is None or solid.sum() < FEW:
        return data, None
    tone = _tone(data, face.name)
    tree, rgb = cKDTree(samples.points[solid]), np.sqrt(samples.colour[solid, :3])  # means of roots look right
    parts = [face, *(p for p in head.parts if p.material == "skin" and p.follows == "skin" and p is not face)]
    squares = {part.name: _square(part, OTHERS if k else SIDE, tree, rgb, tone) for k, part in enumerate(parts)}
    if squares[face.name].known < LEAST:
        return data, None
    texture = joined({name: [square] for name, square in squares.items() if square.known > 0.0}, tone)
    return _painted(data, texture, tone), texture


def _tone(data: HeadData, part: str) -> Floats:
    """(3,) linear RGB that a part has all over, below other layers of paint."""
    layers = (la for la in data.paint if la["part"] == part and la["attribute"] == "albedo" and la["kind"] == "all")
    return np.asarray(next((la["value"] for la in layers), BASE["albedo"]), float)


def _on_eyes(data: HeadData, points: Floats) -> Bools:
    """(m,) which points show an eye: skin that closes over it must not have its colour."""
    local = (points[:, None] - data.eyes) / max(data.eye_radius, 1e-9)
    near = (np.linalg.norm(local, axis=2) < EYE_REACH) & (local[..., 2] > 0.0)
    on: Bools = near.any(axis=1)
    return on


def _square(part: HeadPart, scale: int, tree: cKDTree, rgb: Floats, tone: Floats) -> Square:
    """The picture of a part over (u, v); where the scan has nothing, the skin's own tone."""
    vertices, triangles = part.vertices.astype(float), part.triangles
    places = scale * part.uv.astype(float)[triangles]
    origin, side = room_for(places)
    owner, share = covering(np.ascontiguousarray(places + origin), side, side)
    seen = owner >= 0
    at = np.einsum("mk,mkx->mx", share[seen], vertices[triangles[owner[seen]]])
    off, near = tree.query(at, k=NEIGHBOURS, distance_upper_bound=NEAR_MM, workers=-1)
    weight = np.where(np.isfinite(off), 1.0 / (0.1 + off), 0.0)
    total = weight.sum(axis=1)
    mean = np.einsum("mk,mkc->mc", weight, np.vstack([rgb, np.zeros((1, 3))])[near])
    colour, known = np.zeros((side, side, 3)), np.zeros((side, side), bool)
    known[seen] = total > 0.0
    colour[seen] = (mean / np.maximum(total, 1e-9)[:, None]) ** 2
    if not known.any():
        return Square(np.tile(tone, (side, side, 1)), scale, origin, 0.0)
    beside, (y, x) = distance_transform_edt(~known, return_indices=True)
    own = smoothstep(beside, *BESIDE)[..., None]
    return Square((1.0 - own) * colour[y, x] + own * tone, scale, origin, float(known[seen].mean()))


def _painted(data: HeadData, texture: HeadTexture, tone: Floats) -> HeadData:
    """The head with skin of one tone where it has a texture, and without brows of its own."""
    kept = [la for la in data.paint if la["part"] not in texture.tiles or la["attribute"] != "albedo"]
    value = np.round(tone, 4).tolist()
    base = [{"part": name, "attribute": "albedo", "kind": "all", "value": value} for name in texture.tiles]
    brows = {part.name for part in data.parts if part.material == "brow"}
    return replace(
        data, parts=[p for p in data.parts if p.name not in brows],
        paint=[*base, *(la for la in kept if la["part"] not in brows)],
    )  # fmt: skip
