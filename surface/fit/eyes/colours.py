"""Colours of a head as its mesh brings them: skin, the white of the eyes, the iris and how large it is.

They become layers of paint in head.toml, where a user may change them.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.eyes.names import is_cover, is_iris
from surface.fit.eyes.search import Eyes
from surface.fit.points.eyeball import IRIS
from surface.fit.source.mesh import FitMesh
from surface.fit.source.textures import Samples, sample_colours
from surface.head.model.data import PartData

USUAL_IRIS = 0.094  # radius of an iris, in distances between the eyes: 5.9 of 63 mm
MIN_IRIS, MAX_IRIS = 0.25, 0.85  # radius of an iris, in eyeball radii
RING_WIDTH = np.radians(2.5)  # rad; a texture of an eye is averaged over rings about its axis
RINGS = 28
WHITE_RINGS = np.radians(45.0), np.radians(70.0)  # rad from the axis: rings that are white in every texture
BRIGHT_RINGS = (
    np.radians(4.0),
    np.radians(16.0),
)  # rad from an iris's edge: textures are brightest there, as lids shade the rest
MIN_CONTRAST = 0.07  # between iris and white, in square roots of linear colours
IRIS_RANGE = 0.42, 0.85  # of its radius: between pupil and rim
MIN_NORMAL_Z = 0.3  # of faces whose colour is taken as the skin's
MIN_ALPHA = 0.5
SKIN_RANGE, EYE_RANGE = (0.015, 0.85), (0.004, 0.80)  # linear: nothing on a face is darker or brighter


@dataclass(frozen=True)
class EyeColours:
    """Linear RGB, None for colours that the mesh does not have. iris_radius : in eyeball radii."""

    iris: Floats | None
    white: Floats | None
    iris_radius: float


def piece_colour(mesh: FitMesh, word: str) -> Floats | None:
    """(3,) linear RGB of most of what has a word in its name; None where nothing has, or it has no colours."""
    named = np.array([word in name for name in mesh.pieces], bool)
    ids = np.flatnonzero(named[mesh.piece]) if named.any() else np.zeros(0, np.int64)
    found = sample_colours(mesh, ids, steps=1)
    return None if found is None else _most(found, _all(found), SKIN_RANGE)


def white_colour(mesh: FitMesh, eyes: Eyes) -> Floats | None:
    """(3,) linear RGB of the white of both eyes; None where the mesh has no colours there."""
    white = [found.white for found in eye_colours(mesh, eyes) if found.white is not None]
    return np.mean(white, axis=0) if white else None


def skin_colour(mesh: FitMesh, skin: Bools) -> Floats | None:
    """(3,) linear RGB of most of the skin (f,) that faces front; None where the mesh has no colours there."""
    ids = np.flatnonzero(skin)
    tri = mesh.vertices[mesh.faces[ids, :3]]
    normal = np.cross(tri[:, 1] - tri[:, 0], tri[:, 2] - tri[:, 0])
    front = normal[:, 2] > MIN_NORMAL_Z * np.maximum(np.linalg.norm(normal, axis=1), 1e-12)
    found = sample_colours(mesh, ids[front], steps=1)
    return None if found is None else _most(found, np.ones(len(found.weight), bool), SKIN_RANGE)


def _most(samples: Samples, chosen: Bools, limits: tuple[float, float]) -> Floats | None:
    """(3,) the weighted median of each channel of chosen samples (m,) that are opaque; None without any."""
    chosen = chosen & (samples.colour[:, 3] > MIN_ALPHA)
    weight = samples.weight[chosen]
    if not weight.sum() > 0:
        return None
    out = []
    for channel in samples.colour[chosen, :3].T:
        order = np.argsort(channel)
        total = np.cumsum(weight[order])
        out.append(channel[order[np.searchsorted(total, 0.5 * total[-1])]])
    colour: Floats = np.clip(np.array(out), *limits)
    return colour


def eye_colours(mesh: FitMesh, eyes: Eyes) -> list[EyeColours]:
    """The colours of the left and the right eye, as far as the mesh has them."""
    apart = float(np.linalg.norm(eyes.centres[0] - eyes.centres[1]))
    usual = eyes.iris / eyes.radius if eyes.iris > 0 else USUAL_IRIS * apart / eyes.radius
    usual = float(np.clip(usual, MIN_IRIS, MAX_IRIS))
    sides = zip(faces_by_side(mesh, eyes), eyes.centres, strict=True)
    return [_one(mesh, ids, centre, usual) for ids, centre in sides]


def faces_by_side(mesh: FitMesh, eyes: Eyes) -> list[Ints]:
    """Faces of the left and of the right eye, as far as they are drawn."""
    ids = np.flatnonzero(eyes.drawn)
    middle = mesh.vertices[mesh.faces[ids, :3]].mean(axis=1)
    off = np.linalg.norm(middle[:, None] - eyes.centres, axis=2)
    return [ids[off[:, 0] <= off[:, 1]], ids[off[:, 0] > off[:, 1]]]


def _one(mesh: FitMesh, faces: Ints, centre: Floats, usual: float) -> EyeColours:
    names = [mesh.piece_of(int(f)) for f in faces]
    iris = np.array([is_iris(n) for n in names], bool)
    cover = np.array([is_cover(n) for n in names], bool)
    if iris.any():
        own, rest = sample_colours(mesh, faces[iris]), sample_colours(mesh, faces[~cover])
        return EyeColours(_of_iris_piece(own), None if rest is None else _most(rest, _all(rest), EYE_RANGE), usual)
    samples = sample_colours(mesh, faces[~cover])
    return EyeColours(None, None, usual) if samples is None else by_rings(samples, centre, usual)


def _all(samples: Samples) -> Bools:
    return np.ones(len(samples.weight), bool)


def _of_iris_piece(samples: Samples | None) -> Floats | None:
    """The colour of an iris of its own, between its pupil and its rim."""
    if samples is None or not (samples.colour[:, 3] > MIN_ALPHA).any():
        return None
    seen = samples.colour[:, 3] > MIN_ALPHA
    middle = 0.5 * (samples.points[seen].min(axis=0) + samples.points[seen].max(axis=0))
    off = np.linalg.norm((samples.points - middle)[:, :2], axis=1)
    off /= max(float(off[seen].max()), 1e-9)
    return _most(samples, (off > IRIS_RANGE[0]) & (off < IRIS_RANGE[1]), EYE_RANGE)


def by_rings(samples: Samples, centre: Floats, usual: float) -> EyeColours:
    """Colours of an eyeball with a texture: the iris ends where rings round the axis become white."""
    local = samples.points - centre
    angle = np.arctan2(np.hypot(local[:, 0], local[:, 1]), local[:, 2])
    white = _most(samples, (angle > WHITE_RINGS[0]) & (angle < WHITE_RINGS[1]), EYE_RANGE)
    if white is None:
        return EyeColours(None, None, usual)
    rings = [
        _most(samples, np.abs(angle - (k + 0.5) * RING_WIDTH) <= 0.5 * RING_WIDTH, (0.0, 1.0)) for k in range(RINGS)
    ]
    off = np.array([0.0 if r is None else float(np.linalg.norm(np.sqrt(r) - np.sqrt(white))) for r in rings])
    dark = np.flatnonzero(
        (off > max(MIN_CONTRAST, 0.5 * off.max())) & ((np.arange(RINGS) + 0.5) * RING_WIDTH < WHITE_RINGS[0])
    )
    if not len(dark):
        return EyeColours(None, white, usual)
    edge = float((dark.max() + 1) * RING_WIDTH)
    between = (np.sin(angle) > IRIS_RANGE[0] * np.sin(edge)) & (np.sin(angle) < IRIS_RANGE[1] * np.sin(edge))
    iris = _most(samples, between & (local[:, 2] > 0), EYE_RANGE)
    beside = (angle > edge + BRIGHT_RINGS[0]) & (angle < edge + BRIGHT_RINGS[1])
    white = _most(samples, beside, EYE_RANGE) if beside.any() else white
    return EyeColours(iris, white, float(np.clip(np.sin(edge), MIN_IRIS, MAX_IRIS)))


def paint_layers(mesh: FitMesh, eyes: Eyes, parts: Iterable[PartData]) -> list[dict[str, Any]]:
    """Layers of paint for a head's parts with the mesh's colours."""
    layers: list[dict[str, Any]] = []
    colour = skin_colour(mesh, eyes.skin)
    if colour is not None:
        layers += [_layer(p.name, "albedo", colour) for p in parts if p.material == "skin"]
    if eyes.radius <= 0:
        return layers
    for part, found in zip(("eye_left", "eye_right"), eye_colours(mesh, eyes), strict=True):
        if abs(found.iris_radius - IRIS) > 0.01:
            layers.append(_layer(part, "iris_radius", np.array([found.iris_radius])))
        layers += [_layer(part, "iris", found.iris)] if found.iris is not None else []
        layers += [_layer(part, "sclera", found.white)] if found.white is not None else []
    return layers


def _layer(part: str, attribute: str, value: Floats) -> dict[str, Any]:
    """A layer of paint all over a part."""
    return {"part": part, "attribute": attribute, "kind": "all", "value": np.round(value, 4).tolist()}
