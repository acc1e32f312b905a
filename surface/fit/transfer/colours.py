"""Transfer the colours of a scan, from its vertices or textures, to the paint of the head that is made from it.

A head's paint is a list of layers over (u, v), such as skin, cheeks, lips and brows. Where the scan shows the area of a
layer, the layer gets the value that reproduces the scan's colour there. Other layers keep their relation to the skin.
The result is still a list of layers, which a user can edit.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from surface.base.arrays import Bools, Floats
from surface.fit.eyes.colours import EYE_RANGE, SKIN_RANGE, USUAL_IRIS, EyeColours, by_rings
from surface.fit.eyes.names import is_cover, is_eye, is_iris
from surface.fit.points.eyeball import IRIS
from surface.fit.source.mesh import FitMesh, triangles
from surface.fit.source.textures import Samples, sample_colours
from surface.head import Head, HeadData, HeadPart
from surface.head.model.face import face_of
from surface.head.posing.paint import BASE, layer_field
from surface.readers.meshdata import MeshData

MANY, DETAILED = 300_000, 1_500_000  # samples of a scan's colours, of vertices and of textures
PLAIN = 0.02  # standard deviation below which colours are one grey, or white, all over, and are not used
NEAR_MM = 2.0  # greatest distance from a vertex of the head to the samples that give its colour
FRONT = 0.3  # least z of the normals of the vertices whose median colour is that of the skin
STRONG, LEAST = 0.6, 20  # strength of a layer at the vertices that give its colour; least number of such vertices
SHOWN = 0.3  # least amount of a layer that its colour is computed with
EYE_REACH = (0.93, 1.12)  # distance from an eyeball's centre, in radii, within which samples belong to the eyeball
PIECE_REACH = 1.5  # greatest distance of samples of an eye's own piece, in radii
WHITER = 0.75  # greatest saturation of the white of an eye, relative to that of the skin
LEAST_EYE = 60  # least number of samples on an eye
SIDES = ("left_eye", "right_eye")


def scan_colours(raw: MeshData, kept: Bools | None = None) -> Samples | None:
    """Samples of the colours of a mesh, in its own coordinates; None where it has none, or one grey all over.

    kept : (f,) which faces belong to it.
    """
    if raw.colours is None and not any(raw.materials):
        return None
    mesh = FitMesh(
        raw.vertices, raw.faces, raw.uv, raw.face_uv, (), np.zeros((0, len(raw.vertices), 3)), raw.piece, raw.pieces,
        raw.materials,
    )  # fmt: skip
    faces = np.arange(len(raw.faces)) if kept is None else np.flatnonzero(kept)
    textured = any(m is not None and m.texture is not None for m in raw.materials)
    many, most = (DETAILED, 40) if textured else (MANY, 12)
    steps = int(np.clip(np.sqrt(2.0 * many / max(len(triangles(raw.faces[faces])), 1)) - 1.5, 0, most))
    found = sample_colours(mesh, faces, steps=steps, tint=raw.colours)
    if found is None:
        return None
    rgb = found.colour[found.colour[:, 3] > 0.5, :3]
    grey = len(rgb) and float(np.ptp(rgb.mean(axis=0))) < PLAIN
    return None if not len(rgb) or (grey and float(rgb.std(axis=0).max()) < PLAIN) else found


def eye_faces(raw: MeshData, kept: Bools) -> Bools:
    """(f,) which of the faces ``kept`` (f,) belong to eyes by name, less corneas and highlights."""
    drawn = [is_eye(n) and (is_iris(n) or not is_cover(n)) for n in raw.pieces]
    return kept & np.isin(raw.piece, np.flatnonzero(drawn))


def moved(samples: Samples, turn: Floats, scale: float, shift: Floats) -> Samples:
    """The samples with every point p moved to scale * turn @ p + shift."""
    return replace(samples, points=scale * samples.points @ turn.T + shift)


def with_colours(data: HeadData, samples: Samples, eyes: Samples | None = None) -> tuple[HeadData, list[str]]:
    """A head that lies on a scan, painted with the scan's colours; and notes for the report on which were found.

    eyes : of the scan's pieces that are eyes; None where it has none, or one skin with the face.
    """
    solid = samples.colour[:, 3] > 0.5
    tree, rgb = cKDTree(samples.points[solid]), np.sqrt(samples.colour[solid, :3])  # means of roots look right
    head = Head(data)
    face = face_of(head.parts, data.contacts)
    if face is None:
        return data, []
    skin = _front_colour(face, *_looked_up(face.vertices.astype(float), tree, rgb))
    if skin is None:
        return data, []
    old = np.asarray(next((la["value"] for la in data.paint if _is_base(la, face.name)), BASE["albedo"]), float)
    layers: list[dict[str, Any]] = []
    for part in head.parts:
        own = [la for la in data.paint if la["part"] == part.name]
        if part.material == "skin":
            own = _painted(
                part, own, skin, skin / np.maximum(old, 1e-3), *_looked_up(part.vertices.astype(float), tree, rgb)
            )
        layers += own
    layers, said = _with_eyes(layers, data, samples, skin) if eyes is None else _with_pieces(layers, data, eyes)
    colours = [f"skin {_words(skin)}", *said]
    return replace(data, paint=layers), [f"colours taken from the scan (linear RGB): {'; '.join(colours)}"]


def _is_base(layer: dict[str, Any], part: str) -> bool:
    return bool(layer["part"] == part and layer["attribute"] == "albedo" and layer["kind"] == "all")


def _looked_up(points: Floats, tree: cKDTree, rgb: Floats) -> tuple[Floats, Bools]:
    """(m, 3) linear RGB of the scan at points (m, 3), and (m,) whether the scan has a colour there."""
    count = min(6, tree.n)
    off, near = tree.query(points, k=count, distance_upper_bound=NEAR_MM)
    off, near = np.asarray(off).reshape(-1, count), np.asarray(near).reshape(-1, count)
    weight = np.where(np.isfinite(off), 1.0 / (0.2 + off), 0.0)
    total = weight.sum(axis=1)
    mean = np.einsum("mk,mkc->mc", weight, np.vstack([rgb, np.zeros((1, 3))])[near]) / np.maximum(total, 1e-9)[:, None]
    return mean**2, total > 0


def _front_colour(face: HeadPart, seen: Floats, known: Bools) -> Floats | None:
    """(3,) median colour of the vertices of a face that look forward; None where the scan covers too few of them."""
    chosen = known & (face.normals[:, 2] > FRONT)
    return np.clip(np.median(seen[chosen], axis=0), *SKIN_RANGE) if chosen.sum() >= LEAST else None


def _painted(
    part: HeadPart, layers: list[dict[str, Any]], skin: Floats, ratio: Floats, seen: Floats, known: Bools
) -> list[dict[str, Any]]:  # fmt: skip
    """The layers of a part of skin, their albedo set to the scan's colours, or multiplied by ``ratio`` without any.

    skin, ratio : (3,) colour of the skin, and its ratio to the old one. seen, known : (m, 3) and (m,), colours of the
    scan at the part's vertices, and whether there is one.
    """
    uv = part.uv.astype(float)
    at = np.tile(np.asarray(BASE["albedo"]), (len(uv), 1))
    out = [] if any(_is_base(la, part.name) for la in layers) else [_all_over(part.name, "albedo", skin)]
    for layer in layers:
        if layer["attribute"] == "albedo":
            amount, field = float(layer.get("amount", 1.0)), layer_field(layer, uv)
            strong = known & (field > STRONG)
            if _is_base(layer, part.name):
                value = skin if part.follows == "skin" and part.name != "sockets" else layer["value"] * ratio
            elif strong.sum() >= LEAST:
                below = np.median(at[strong], axis=0)
                wanted = np.median(seen[strong], axis=0)
                value = below + (wanted - below) / max(amount, SHOWN)
                if (value < SKIN_RANGE[0]).any() or (value > SKIN_RANGE[1]).any():  # out of range: take the full colour
                    value, amount = wanted, 1.0
            else:
                value = layer["value"] * ratio
            value = np.clip(value, *SKIN_RANGE)
            at += amount * field[:, None] * (value - at)
            layer = {**layer, "value": np.round(value, 4).tolist(), "amount": amount}
        out.append(layer)
    return out


def _with_eyes(
    layers: list[dict[str, Any]], data: HeadData, samples: Samples, skin: Floats
) -> tuple[list[dict[str, Any]], list[str]]:  # fmt: skip
    """The layers with the colours of eyes that the scan shows open, and words for the report.

    Closed eyes, whose samples are as red as skin, are left as they are.
    """
    colours = []
    for side in (0, 1):
        local = (samples.points - data.eyes[side]) / data.eye_radius
        off = np.linalg.norm(local, axis=1)
        own = (off > EYE_REACH[0]) & (off < EYE_REACH[1]) & (local[:, 2] > 0.0)
        if own.sum() < LEAST_EYE:
            continue
        found = _ringed(data, side, samples, own)
        if found.white is not None and _saturation(found.white) <= WHITER * _saturation(skin):
            layers, said = _coloured(layers, data, side, found)
            colours += said
    return layers, colours


def _with_pieces(layers: list[dict[str, Any]], data: HeadData, eyes: Samples) -> tuple[list[dict[str, Any]], list[str]]:
    """The layers with the colours of eyes that are pieces of their own, and words for the report.

    They may lie at another depth than the head's: a texture's iris is often set back behind a clear cornea.
    """
    near = np.linalg.norm(eyes.points[:, None] - data.eyes, axis=2)
    colours = []
    for side in (0, 1):
        own = (near[:, side] < near[:, 1 - side]) & (near[:, side] < PIECE_REACH * data.eye_radius)
        if own.sum() >= LEAST_EYE:
            layers, said = _coloured(layers, data, side, _ringed(data, side, eyes, own))
            colours += said
    return layers, colours


def _ringed(data: HeadData, side: int, samples: Samples, own: Bools) -> EyeColours:
    """The colours of one eye, from those samples (m,) that are its ``own``."""
    usual = USUAL_IRIS * float(np.linalg.norm(data.eyes[0] - data.eyes[1])) / data.eye_radius
    return by_rings(Samples(samples.points[own], samples.colour[own], samples.weight[own]), data.eyes[side], usual)


def _coloured(
    layers: list[dict[str, Any]], data: HeadData, side: int, found: EyeColours
) -> tuple[list[dict[str, Any]], list[str]]:  # fmt: skip
    """The layers with one eye's colours, and words for the report; the same where no iris was found."""
    if found.iris is None or found.white is None:
        return layers, []
    name = SIDES[side]
    parts = [p.name for p in data.parts if p.follows == name]
    values = {"iris": found.iris, "sclera": found.white}
    values |= {"iris_radius": np.array([found.iris_radius])} if abs(found.iris_radius - IRIS) > 0.01 else {}
    layers = [la for la in layers if not (la["part"] in parts and la["attribute"] in values)]
    layers += [_all_over(part, key, np.clip(v, *EYE_RANGE)) for part in parts for key, v in values.items()]
    return layers, [f"iris of the {name.replace('_', ' ')} {_words(found.iris)}"]


def _saturation(colour: Floats) -> float:
    root = np.sqrt(colour)
    return float(1.0 - root.min() / max(float(root.max()), 1e-6))


def _all_over(part: str, attribute: str, value: Floats) -> dict[str, Any]:
    return {"part": part, "attribute": attribute, "kind": "all", "value": np.round(value, 4).tolist()}


def _words(colour: Floats) -> str:
    return " ".join(f"{c:.2f}" for c in colour)
