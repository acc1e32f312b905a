"""Let lids follow the gaze where the mesh has no shapes that do so: looks down and up are made from its blink.

Lids turn about the eyeball's x axis. The upper lid and what hangs on it, such as lashes, goes as the blink takes it;
the lower lid, which blinks hardly move, as far round the eyeball as a lengthened blink does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from surface.base.arrays import Bools, Floats
from surface.fit.eyes.blink import FADE_RAD, MAX_LEFT_OPEN, LidEdges, angle_of, lid_edges
from surface.fit.eyes.openings import Opening
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

    upper : (n,) rad, down, by which the blink turns what belongs to the upper lid. way : rad, of its edge at most.
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
    for opening, eye in zip(openings, eyes, strict=True):
        rest = mesh.vertices - eye
        still = [n for n in LOOKS if _is_still(mesh, sources[f"{n}{opening.side}"], opening, rest)]
        lids = _lids(mesh, sources.get(f"eyeBlink{opening.side}", []), opening, rest, radius) if still else None
        for name in still if lids else ():
            made.append(f"{name}{opening.side}")
            deltas[sources[made[-1]][0]] += _turned(rest, _turn(lids, *LOOKS[name]))
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
    near, turned = _near(rest, radius), angle_of(rest) - angle_of(shut)
    way, upper, lower, height = (
        _in_column(rest, before, at)
        for at in (before.upper - after.upper, before.upper, before.lower, np.maximum(before.gap, 0.0))
    )
    above = 2.0 * angle_of(rest) >= upper + lower
    is_upper: Bools = above | (turned > AS_THE_BLINK * np.maximum(way, MIN_WAY_RAD))
    follows = np.where(is_upper, 0.0, 1.0 - smoothstep(lower - angle_of(rest), 0.0, FADE_RAD))
    return _Lids(np.where(is_upper, turned, 0.0) * near, most, follows * near * height, float(before.gap.max()))


def _near(rest: Floats, radius: float) -> Floats:
    """(n,) 1 in front of the eyeball, 0 far from it and beside it."""
    away = np.linalg.norm(rest, axis=1) / radius
    out: Floats = (1.0 - smoothstep(away, *REACH)) * smoothstep(rest[:, 2] / radius, *BEHIND)
    return out


def _in_column(rest: Floats, edges: LidEdges, values: Floats) -> Floats:
    """(n,) values of the opening's columns at the x of every vertex."""
    return np.interp(rest[:, 0], edges.x, values)


def _turn(lids: _Lids, upper: float, lower: float) -> Floats:
    """(n,) angle by which everything turns, rad, + up, in a look that takes the lids by shares of the opening's height.
    No lid turns further than the eye itself, and the upper one no further than in a blink."""
    less = min(1.0, EYE_RAD[1] / (abs(upper) * lids.height))
    blink = min(abs(upper) * lids.height * less / lids.way, 1.0)
    out: Floats = np.sign(upper) * blink * lids.upper + less * lower * lids.lower
    return out


def _turned(rest: Floats, turn: Floats) -> Floats:
    """(n, 3) displacements by turns (n,) about the eye's x axis."""
    c, s = np.cos(turn), np.sin(turn)
    y, z = c * rest[:, 1] + s * rest[:, 2], c * rest[:, 2] - s * rest[:, 1]
    return np.column_stack([np.zeros(len(rest)), y - rest[:, 1], z - rest[:, 2]])
