"""Data classes for everything a head's files hold: parts, groups, seams, jaw, neck, contacts, rules."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Array, Floats, Floats32, Ints
from surface.head.model.parameters import smoothstep
from surface.head.model.placement import Placement
from surface.mesh.domain import Slit

WRINKLE = "wrinkle"  # with which the names of groups begin that sink the skin along lines
GREATEST_ERROR = "greatest_error"  # in the provenance: how far a fit is from its mesh at most, in which shape and where


@dataclass(frozen=True)
class Group:
    """Control points of one part, ``ids (k,)``, and their displacements per unit of the parameter ``name``,
    ``moves (k, 3)``, mm."""

    name: str
    ids: NDArray[np.int32]
    moves: Floats32


@dataclass(frozen=True)
class PartData:
    """One DCP surface of the head and how it follows the parameters.

    follows : "skin" (control points move one by one), or what it is fixed to: "skull", "jaw", "left_eye",
        "right_eye".
    points (n, 3), weights (n,), knots_u, knots_v (n, w), degrees (n, 2) : the surface, padded as in
        :attr:`surface.DCPSurface.padded`.
    loops : closed polylines (k, 2) in (u, v) that trim it; slits : (s, 3) v, u from, u to.
    budget : (max_points per cell, chord_error in mm, max_depth) for the tessellation.
    groups : displacements of its control points.
    jaw : (n,) share of the jaw's rotation that each point follows.
    lids : (n,) signed: how closely a point keeps to the left (+) or right (-) eyeball when lids move.
    mesh : the stored tessellation as arrays (see :mod:`surface.head.model.meshes`); may be empty.
    closed_u, closed_v : (start, end) of a direction that is joined at its ends; None for one that is not.
    rect : (u0, u1, v0, v1) in which the part is drawn; None for the rectangle around ``loops``.
    flip : the outside is where S_v x S_u points, instead of S_u x S_v.
    cuts : segments of (u, v) along which the mesh is cut; ``slits`` only say where openings are.
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
    closed_u: tuple[float, float] | None = None
    closed_v: tuple[float, float] | None = None
    rect: tuple[float, float, float, float] | None = None
    flip: bool = False
    cuts: tuple[Slit, ...] = ()


@dataclass(frozen=True)
class Seam:
    """A border that two islands share: polylines (k, 2) in the (u, v) of either part, of equal points."""

    part_a: str
    part_b: str
    uv_a: Floats
    uv_b: Floats


@dataclass(frozen=True)
class Jaw:
    """The jaw's path: ``angle_rad`` per unit about the x axis through ``centre``, and a translation ``glide``, mm.

    ``tilts`` are the affine displacements (3, 4) of the lower teeth per unit of the sideways and forward shapes.
    """

    centre: tuple[float, float, float]
    angle_rad: float
    glide: tuple[float, float, float]
    tilts: dict[str, Floats] = field(default_factory=dict)


@dataclass(frozen=True)
class Neck:
    """How the neck bends when the head turns about ``pivot``, mm.

    Points with y + slope * z above ``whole`` at rest follow fully, those below ``still`` not at all.
    """

    pivot: tuple[float, float, float]
    slope: float = 0.35
    still: float = -152.0
    whole: float = -78.0

    def share(self, points: Floats) -> Floats:
        """Return (n,): share of the head's rotation that each point at rest (n, 3) follows, 0..1."""
        return smoothstep(points[:, 1] + self.slope * points[:, 2], self.still, self.whole)


@dataclass(frozen=True)
class Seal:
    """How lips stay together until a pose really opens them.

    opens : shares of shapes, by name, of what opens them; below 0 of what keeps them closed. Those of a Left or Right
        shape count for that side, and the greater side counts. Up to ``closed`` lips that lie together at rest stay so;
        from ``parted`` on they are where the groups take them.
    """

    opens: dict[str, float]
    closed: float
    parted: float


@dataclass(frozen=True)
class Contact:
    """Two sides of an opening that meet and do not pass through each other.

    part : the one with the opening; followers : parts after it that move along with its sides.
    eye : 0 or 1 for the lids of the left or right eye, whose heights are arcs round the eyeball; -1 for lips.
    reach_mm : distance from the rim at which the correction has faded out. share : the upper side's part of it, 0..1.
    places : (2, columns, rows, 2) samples in (u, v), the upper side first, columns in the order of x, rows from the
        rim on; two thirds of the rows can touch the other side, in the rest the correction fades out.
    cling : whether lids are also brought back onto the eyeball when shapes lift them off; if not, they only stay out of
        it. Lips that are slightly apart at rest are closed over their whole length; if not, less towards the corners.
    seal : of lips; None for sides that only stay apart.
    """

    name: str
    part: str
    followers: tuple[str, ...]
    eye: int
    reach_mm: float
    share: float
    places: Floats
    cling: bool = True
    seal: Seal | None = None


@dataclass(frozen=True)
class Rule:
    """Amount of a group that is no parameter: the product of ``terms``, each a weighted sum of parameters by name,
    clipped to 0..1, raised to ``power`` (2 sets in softly)."""

    group: str
    terms: tuple[dict[str, float], ...]
    power: float = 1.0


@dataclass(frozen=True)
class HeadData:
    """All of a head.

    provenance : free text by key (source, licence, how it was made, :data:`GREATEST_ERROR`).
    eyes : centres (2, 3), left then right, mm; eye_radius : mm.
    placement : from the frame of the mesh it was fitted to; None for a head of which that is not known.
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
    placement: Placement | None = None


def with_greatest_error(head: HeadData, said: str) -> HeadData:
    """The head with the greatest error of its fit, in words, in its provenance; with none where nothing is said."""
    others = {key: text for key, text in head.provenance.items() if key != GREATEST_ERROR}
    return replace(head, provenance=others | ({GREATEST_ERROR: said} if said else {}))
