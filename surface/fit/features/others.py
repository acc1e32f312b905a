"""Decide what becomes of the pieces of a mesh that are neither its face nor its eyeballs, by their kind and size.

The rule of each kind is in ``surface/fit/source/kinds.toml``. Clothes, hats and glasses were left out before, when the
mesh was loaded.
"""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.source.kinds import SKIN, Kind, kind_of, kinds
from surface.fit.source.mesh import FitMesh, renumbered
from surface.fit.source.textures import sample_colours

TOOTH_MM, TEETH = 24.0, 12  # so many pieces no larger than this are teeth
INNER = ("teeth", "mouth")  # kinds whose texture often draws teeth, gums and tongue alike
RED, PALE = 0.45, 0.65  # green by red, linear: at most that of a tongue, at least that of teeth
BRIGHT = 0.3  # linear: least mean of the channels of teeth


def by_object(mesh: FitMesh, label: Ints, pieces: list[int], scale: float) -> dict[tuple[str, Kind], list[int]]:
    """Pieces by the object they belong to and its kind; a row of small ones without a kind is teeth.

    label : (f,) piece of each face; pieces : those to sort. scale : of the head, 1 for usual size.
    """
    out: dict[tuple[str, Kind], list[int]] = {}
    small: dict[str, list[int]] = {}
    for k in pieces:
        name = mesh.piece_of(int(np.argmax(label == k)))
        kind = _by_colour(mesh, label == k, kind_of(name))
        tiny = np.ptp(points_of(mesh, label == k), axis=0).max() < TOOTH_MM * scale
        if kind.name == SKIN and tiny:
            small.setdefault(name, []).append(k)
        else:
            out.setdefault((name, kind), []).append(k)
    for name, own in small.items():
        out.setdefault((name, kinds()["teeth" if len(own) >= TEETH else SKIN]), []).extend(own)
    return out


def _by_colour(mesh: FitMesh, chosen: Bools, kind: Kind) -> Kind:
    """The kind of a piece inside the mouth by its colour, where the mesh has colours: one object often has both teeth
    and tongue, and as teeth all of it would be white."""
    found = sample_colours(mesh, np.flatnonzero(chosen), steps=2) if kind.name in INNER else None
    if found is None:
        return kind
    red, green, blue = np.average(found.colour[:, :3], axis=0, weights=found.weight + 1e-12)
    if green < RED * red:
        return kinds()["tongue"] if kind.name == "teeth" else kind
    return kinds()["teeth"] if green > PALE * red and red + green + blue > 3.0 * BRIGHT else kind


def points_of(mesh: FitMesh, chosen: Bools) -> Floats:
    """(m, 3) the vertices that chosen faces use."""
    return mesh.vertices[renumbered(mesh.faces[chosen])[0]]


def is_skin(mesh: FitMesh, label: Ints, count: int) -> Bools:
    """(count,) whether each piece may be skin, by the name of its first face."""
    first = np.full(count, -1)
    first[label[::-1]] = np.arange(len(label))[::-1]
    return np.array([k < 0 or kind_of(mesh.piece_of(int(k))).rule == SKIN for k in first], bool)


def why_out(name: str, kind: Kind, islands: int, most: int) -> str:
    """Why an object is not fitted, in words; "" for one that is. ``islands`` is how many charts it has."""
    if kind.rule == "eye":
        word = kind.name.replace("_", " ")
        return f"{name!r}: left out: {word if kind.name == 'eye' else f'{word}, part of an eye'}"
    if islands == 0:
        return f"{name!r}: left out: no area"
    return f"{name!r}: left out: {islands} separate pieces are too many to fit" if islands > most else ""
