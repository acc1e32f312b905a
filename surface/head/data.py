"""What a head consists of, as plain arrays: the content of ``head.toml`` and ``head.npz``."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Group:
    """A named set of control points of one part that move together.

    Attributes
    ----------
    name : the parameter that moves it.
    ids : (k,) int32, control points of the part.
    moves : (k, 3) float32, displacement per unit of the parameter, mm.
    """

    name: str
    ids: NDArray[np.int32]
    moves: NDArray[np.float32]


@dataclass(frozen=True)
class PartData:
    """One DCP surface of the head and how it follows the parameters.

    Attributes
    ----------
    name, material : as the picture needs them.
    follows : "skin" (control points move one by one), or what it is fixed to: "skull", "jaw", "left_eye",
        "right_eye".
    points (n, 3), weights (n,), knots_u, knots_v (n, w), degrees (n, 2) : the surface, padded as in
        :attr:`surface.DCPSurface.padded`.
    loops : closed polylines (k, 2) in (u, v) that trim it; slits : (s, 3) v, u from, u to.
    budget : (max_points per cell, chord_error in mm, max_depth) for the tessellation.
    groups : displacements of its control points.
    jaw : (n,) how much of the jaw's rotation each point follows; neck : (n,) the same for the head's.
    lids : (n,) signed: how closely a point keeps to the left (+) or right (-) eyeball when lids move.
    mesh : the kept tessellation as arrays (see :mod:`surface.head.meshes`); may be empty.
    """

    name: str
    material: str
    follows: str
    points: Floats
    weights: Floats
    knots_u: Floats
    knots_v: Floats
    degrees: NDArray[np.int64]
    loops: list[Floats]
    slits: Floats
    budget: tuple[int, float, int]
    groups: list[Group]
    jaw: Floats
    neck: Floats
    lids: Floats
    mesh: dict[str, NDArray] = field(default_factory=dict)


@dataclass(frozen=True)
class Seam:
    """A border that two islands share: polylines (k, 2) in the (u, v) of either part, point by point equal."""

    part_a: str
    part_b: str
    uv_a: Floats
    uv_b: Floats


@dataclass(frozen=True)
class Jaw:
    """The jaw's path: rotation about the x axis through ``centre`` by ``angle_rad`` per unit, and a glide.

    ``tilts`` holds for the sideways and forward shapes the affine move of the lower teeth, (3, 4) per unit.
    """

    centre: tuple[float, float, float]
    angle_rad: float
    glide: tuple[float, float, float]
    tilts: dict[str, Floats] = field(default_factory=dict)


@dataclass(frozen=True)
class HeadData:
    """All of a head.

    Attributes
    ----------
    name : short name; provenance : free text by key (source, licence, how it was made).
    neck : pivot (3,) of the head's rotation, mm; eyes : centres (2, 3), left then right, mm.
    eye_radius : mm.
    """

    name: str
    provenance: dict[str, str]
    neck: tuple[float, float, float]
    eyes: Floats
    eye_radius: float
    jaw: Jaw
    parts: list[PartData]
    seams: list[Seam]
    paint: list[dict]
