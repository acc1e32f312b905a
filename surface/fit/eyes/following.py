"""Let lids follow the gaze where the mesh has no shapes that do so: looks down and up are made from its blink.

Lids turn about the eyeball's x axis. The upper lid and what hangs on it, such as lashes, goes the way of the blink; the
lower lid, which blinks hardly move, as far round the eyeball as a lengthened blink does. It draws on the cheek, so
under eyes that are larger than people's, as drawn ones are, it goes no more millimetres than under those.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from surface.base.arrays import Bools, Floats
from surface.fit.eyes.blink import FADE_RAD, MAX_LEFT_OPEN, LidEdges, angle_of, lid_edges
from surface.fit.eyes.openings import Opening
from surface.fit.eyes.pieces import USUAL_SIZE
from surface.fit.source.mesh import FitMesh
from surface.fit.source.names import sources_of
from surface.head.model.parameters import EYE_RAD, smoothstep

LOOKS = {"eyeLookDown": (-0.66, -0.34), "eyeLookUp": (0.37, 0.24)}
"""By shape, how far upper and lower lids go at 1, in heights of the opening: as those of the head ICT do."""
STILL = 0.05  # of the opening's height: a shape that moves the upper lid less far leaves it still
AS_THE_BLINK = 0.5  # of the way of the lid's edge: what a blink takes down at least so far belongs to the upper lid
REACH = (1.7, 2.2)  # of radii from the eye's centre: where the change begins to fade out, and where it is 0
BEHIND = (0.1, 0.4)  # of radii in front of the eye's centre: where it is 0, and where it is whole
MIN_WAY_RAD = 0.1  # of the upper lid's edge in a blink: what is less is none


@dataclass(frozen=True)
class _Lids:
    """What of a mesh (n vertices) goes with the lids of one eye.

    upper : (n, 3) how the blink moves what belongs to the upper lid, as polar coordinates about the eye's x axis: mm
        along x, mm away from the axis, rad up. way : rad, of its edge at most.
    lower : (n,) rad, the opening's height in the column of every vertex, as far as the vertex goes with the lower lid.
    height : rad, the opening's greatest.
    """

    upper: Floats
    way: float
    lower: Floats
    height: float


def follow_gaze(mesh: FitMesh, openings: list[Opening], eyes: Floats, radius: float) -> tuple[FitMesh, list[str]]:
    """The mesh with lids that follow the gaze, and what was made, in words.

    mesh : with shapes for all directions; those that leave lids still move nothing of them. eyes : (2, 3) centres, left
    first, and radius, mm. Lids of an eye that no blink of its upper lid shuts stay as they are.
    """
    deltas, made, sources = mesh.deltas.copy(), list[str](), sources_of(mesh.names)
    size = min(1.0, USUAL_SIZE * float(np.linalg.norm(eyes[0] - eyes[1])) / radius)
    for opening, eye in zip(openings, eyes, strict=True):
        rest = mesh.vertices - eye
        still = [n for n in LOOKS if _is_still(mesh, sources[f"{n}{opening.side}"], opening, rest)]
        lids = _lids(mesh, sources.get(f"eyeBlink{opening.side}", []), opening, rest, radius) if still else None
        if lids is None:
            continue
        for name in still:
            made.append(f"{name}{opening.side}")
            upper, lower = LOOKS[name]
            deltas[sources[made[-1]][0]] += _moved(rest, lids, upper, size * lower)
    notes = [f"lids follow the gaze in {', '.join(made)}: made from blinks, as the mesh moves no lids there"]
    return replace(mesh, deltas=deltas), notes if made else []


def _is_still(mesh: FitMesh, indices: list[int], opening: Opening, rest: Floats) -> bool:
    """Whether the shape of some ``indices`` leaves the upper lid where it is."""
    before = lid_edges(rest, opening.edge, rest)
    after = lid_edges(rest + mesh.deltas[indices].sum(axis=0), opening.edge, rest)
    return float(np.abs(after.upper - before.upper).max()) < STILL * float(before.gap.max())


def _lids(mesh: FitMesh, blink: list[int], opening: Opening, rest: Floats, radius: float) -> _Lids | None:
    """What goes with lids that a blink shuts; None where it does not, or moves the lower lid only."""
    if not blink:
        return None
    shut = rest + mesh.deltas[blink].sum(axis=0)
    before, after = (lid_edges(at, opening.edge, rest) for at in (rest, shut))
    most = float((before.upper - after.upper).max())
    if float(after.gap.max()) > MAX_LEFT_OPEN * float(before.gap.max()) or most < MIN_WAY_RAD:
        return None
    near, moves = _near(rest, radius), _polar(shut) - _polar(rest)
    way, upper, lower, height = (
        _in_column(rest, before, at)
        for at in (before.upper - after.upper, before.upper, before.lower, np.maximum(before.gap, 0.0))
    )
    above = 2.0 * angle_of(rest) >= upper + lower
    is_upper: Bools = above | (-moves[:, 2] > AS_THE_BLINK * np.maximum(way, MIN_WAY_RAD))
    follows = np.where(is_upper, 0.0, 1.0 - smoothstep(lower - angle_of(rest), 0.0, FADE_RAD))
    moves *= np.where(is_upper, near, 0.0)[:, None]
    return _Lids(moves, most, follows * near * height, float(before.gap.max()))


def _polar(points: Floats) -> Floats:
    """(n, 3) points as x, distance from the x axis, and angle about it, 0 ahead, + up."""
    return np.column_stack([points[:, 0], np.hypot(points[:, 1], points[:, 2]), angle_of(points)])


def _near(rest: Floats, radius: float) -> Floats:
    """(n,) 1 in front of the eyeball, 0 far from it and beside it."""
    away = np.linalg.norm(rest, axis=1) / radius
    out: Floats = (1.0 - smoothstep(away, *REACH)) * smoothstep(rest[:, 2] / radius, *BEHIND)
    return out


def _in_column(rest: Floats, edges: LidEdges, values: Floats) -> Floats:
    """(n,) values of the opening's columns at the x of every vertex."""
    return np.interp(rest[:, 0], edges.x, values)


def _moved(rest: Floats, lids: _Lids, upper: float, lower: float) -> Floats:
    """(n, 3) displacements, mm, in a look that takes the lids by shares of the opening's height, + up.

    No lid turns further than the eye itself, and the upper one no further than in a blink.
    """
    less = min(1.0, EYE_RAD[1] / (abs(upper) * lids.height))
    blink = -np.sign(upper) * min(abs(upper) * lids.height * less / lids.way, 1.0)
    x, away, angle = (_polar(rest) + blink * lids.upper).T
    angle = angle + less * lower * lids.lower
    moved = np.column_stack([x, away * np.sin(angle), away * np.cos(angle)])
    return np.where((lids.upper.any(axis=1) | (lids.lower > 0.0))[:, None], moved - rest, 0.0)
