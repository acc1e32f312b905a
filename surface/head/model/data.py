"""What a head consists of, as plain arrays: the content of ``head.toml`` and ``head.npz``."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Array, Floats, Floats32, Ints


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
    moves: Floats32


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
    jaw : (n,) how much of the jaw's rotation each point follows.
    lids : (n,) signed: how closely a point keeps to the left (+) or right (-) eyeball when lids move.
    mesh : the kept tessellation as arrays (see :mod:`surface.head.model.meshes`); may be empty.
    """

    name: str
    material: str
    follows: str
    points: Floats
    weights: Floats
    knots_u: Floats
    knots_v: Floats
    degrees: Ints
    loops: list[Floats]
    slits: Floats
    budget: tuple[int, float, int]
    groups: list[Group]
    jaw: Floats
    lids: Floats
    mesh: dict[str, Array] = field(default_factory=dict)


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
class Neck:
    """How the head turns on the shoulders.

    Attributes
    ----------
    pivot : (3,) mm. What lies, at rest, above y + slope * z = ``whole`` turns with the head, what lies below
        ``still`` stays, and the neck between bends.
    """

    pivot: tuple[float, float, float]
    slope: float = 0.35
    still: float = -152.0
    whole: float = -78.0

    def share(self, points: Floats) -> Floats:
        """(n,) how much of the head's rotation each point at rest (n, 3) follows, 0..1."""
        height = points[:, 1] + self.slope * points[:, 2]
        t = np.clip((height - self.still) / (self.whole - self.still), 0.0, 1.0)
        return t * t * (3.0 - 2.0 * t)


@dataclass(frozen=True)
class Contact:
    """Two sides of an opening that meet and do not pass through each other.

    Attributes
    ----------
    name : for people; part : whose opening it is.
    followers : other parts that yield with it; they come after ``part``.
    eye : 0 or 1 for the lids of the left or right eye, whose heights go round the eyeball; -1 for lips.
    reach_mm : how far from the rim what gives way fades out. share : how much of it the upper side does, 0..1.
    places : (2, columns, rows, 2) samples in (u, v), the upper side first, columns in the order of x, rows from the
        rim on; two thirds of the rows can meet the other side, in the rest motion fades out.
    """

    name: str
    part: str
    followers: tuple[str, ...]
    eye: int
    reach_mm: float
    share: float
    places: Floats


@dataclass(frozen=True)
class Rule:
    """What moves a group that is no parameter: the product of its terms.

    Attributes
    ----------
    group : its name. terms : each a mix of parameters, by name, that counts up to 1.
    power : each term is raised to it; 2 sets in softly.
    """

    group: str
    terms: tuple[dict[str, float], ...]
    power: float = 1.0


@dataclass(frozen=True)
class HeadData:
    """All of a head.

    Attributes
    ----------
    name : short name; provenance : free text by key (source, licence, how it was made).
    eyes : centres (2, 3), left then right, mm; eye_radius : mm.
    contacts : openings whose sides meet; rules : what moves groups that are no parameters.
    """

    name: str
    provenance: dict[str, str]
    neck: Neck
    eyes: Floats
    eye_radius: float
    jaw: Jaw
    parts: list[PartData]
    seams: list[Seam]
    paint: list[dict[str, Any]]
    contacts: list[Contact] = field(default_factory=list)
    rules: list[Rule] = field(default_factory=list)
