"""Rig fitted displacements: groups, the jaw's path, shares of jaw and lids."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.interpolate import PchipInterpolator

from surface.base.arrays import Floats, Ints
from surface.fit.points.rigidfit import rigid_fit
from surface.fit.source.mesh import FitMesh
from surface.head.model.data import Group, Jaw, Rule
from surface.head.model.parameters import TONGUE_JAW, smoothstep
from surface.head.posing.rig import jaw_path

LEAST_MM = 0.004  # displacements smaller than this are dropped
LEAST_GROUP_MM = 0.25  # a part gets no group for a shape that moves nothing in it further than this
LEFT_BEHIND = 0.4  # of the jaw's way: a tongue that goes less far is no tongue of that jaw
DROOP = "tongueDroop"
DROOP_RULE = Rule(DROOP, ({"tongueOut": 1.0},), 4.0)
LOW = "tongueLow"
LOW_RULE = Rule(LOW, ({"jawOpen": 1.0, "jawLeft": 0.4, "jawRight": 0.4},))  # upper teeth do not go aside with the jaw
LOW_NARROWER, LOW_BACK = 0.04, 0.5  # of the width, and back by this share of how much it sinks
BACK = "tongueBack"
BACK_RULE = Rule(BACK, ({"mouthRollLower": 1.0},))  # the lower lip goes in over the teeth: the tongue's tip gives way
TILTS = ("jawForward", "jawLeft", "jawRight")


def find_jaw(mesh: FitMesh, sources: dict[str, list[int]], teeth: Ints, hinge: Floats) -> Jaw:
    """The jaw's path from the lower teeth, which are rigid: rotation about the hinge, and the remainder as a glide."""
    rest = mesh.vertices[teeth]
    if "jawOpen" not in sources or not len(teeth):
        return Jaw(tuple(hinge.tolist()), 0.0, (0.0, 0.0, 0.0))
    moves = {n: mesh.deltas[sources[n]].sum(axis=0)[teeth] for n in ("jawOpen", *TILTS) if n in sources}
    turn, shift = rigid_fit(rest, rest + moves.pop("jawOpen"))
    angle = float(np.arctan2(turn[2, 1], turn[1, 1]))
    glide = turn @ hinge + shift - hinge
    glide[0] = 0.0
    tilts = {n: affine_fit(rest, move) for n, move in moves.items()}
    return Jaw(tuple(hinge.tolist()), angle, tuple(glide.tolist()), tilts)


def take_tongue(mesh: FitMesh, tongue: Ints, chin: Ints) -> tuple[FitMesh, list[str]]:
    """The mesh with a tongue that goes down with the jaw where its maker's jawOpen leaves it at the palate, so that it
    would hang before the upper teeth; and what was made, in words.

    tongue, chin : vertices; the latter move with the jaw as a whole.
    """
    if not len(tongue) or not len(chin) or "jawOpen" not in mesh.names:
        return mesh, []
    k, rest = mesh.names.index("jawOpen"), mesh.vertices
    turn, shift = rigid_fit(rest[chin], rest[chin] + mesh.deltas[k][chin])
    whole = rest[tongue] @ turn.T + shift - rest[tongue]
    goes, jaw = (float(np.linalg.norm(moves, axis=1).mean()) for moves in (mesh.deltas[k][tongue], whole))
    if goes >= LEFT_BEHIND * jaw:
        return mesh, []
    deltas = mesh.deltas.copy()
    deltas[k][tongue] = whole
    return replace(mesh, deltas=deltas), [f"jawOpen left the tongue behind, {jaw - goes:.0f} mm: it follows the jaw"]


def affine_fit(points: Floats, moves: Floats) -> Floats:
    """(3, 4) matrix with moves = points @ matrix[:, :3].T + matrix[:, 3], in least squares."""
    system = np.column_stack([points, np.ones(len(points))])
    return np.linalg.lstsq(system, moves, rcond=None)[0].T.astype(np.float64)


def jaw_share(points: Floats, opening: Floats, jaw: Jaw) -> Floats:
    """(n,) how much of the jaw's rotation each point follows, so that little is left of its opening (n, 3)."""
    turn, shift = jaw_path(jaw, 1.0)
    whole = points @ turn.T + shift - points
    share = (opening * whole).sum(axis=1) / np.maximum((whole * whole).sum(axis=1), 1e-9)
    return np.clip(np.where(np.linalg.norm(opening, axis=1) > 0.05, share, 0.0), 0.0, 1.0)


def make_groups(points: Floats, moves: Floats, sources: dict[str, list[int]], jaw: Jaw) -> tuple[list[Group], Floats]:
    """Groups by parameter, and the jaw's shares; jawOpen keeps only what the rotation leaves over.

    ``moves (k, n, 3)`` are the displacements of the control points for the mesh's k shapes.
    """
    share = np.zeros(len(points))
    groups = []
    for name, indices in sources.items():
        field = moves[indices].sum(axis=0)
        if name == "jawOpen":
            share = jaw_share(points, field, jaw)
            turn, shift = jaw_path(jaw, 1.0)
            field = field - share[:, None] * (points @ turn.T + shift - points)
        ids = np.flatnonzero(np.linalg.norm(field, axis=1) > LEAST_MM)
        if np.linalg.norm(field, axis=1).max(initial=0.0) > LEAST_GROUP_MM:
            groups.append(Group(name, ids.astype(np.int32), np.round(field[ids], 4).astype(np.float32)))
    return groups, share


def tongue_groups(points: Floats, path: Floats, jaw: Jaw) -> list[Group]:
    """The tongue put out between the lips, over a jaw that is open by :data:`TONGUE_JAW`: ``tongueOut``, straight
    ahead, and :data:`DROOP`, which bends it down once it is out.

    points : (n, 3) control points of the tongue at rest.
    path : (k, 7) rows: z of a cross-section at rest, y of its middle at rest, y and z where its middle goes, how much
        of its thickness and of its width is left, and how much further down it hangs at :data:`DROOP` 1.
    """
    hanging = path[:, 1:6].copy()
    hanging[:, 1] -= path[:, 6]
    straight, hung = (
        _along_path(points, path[0, 0], path[-1, 0], PchipInterpolator(path[:, 0], rows))
        for rows in (path[:, 1:6], hanging)
    )
    turn, shift = jaw_path(jaw, TONGUE_JAW)
    held = np.clip((points[:, 2] - path[0, 0]) / 20.0, 0.0, 1.0)[:, None]
    ids = np.arange(len(points), dtype=np.int32)
    moves = straight - (points @ turn.T + shift), hung - straight
    named = zip(("tongueOut", DROOP), moves, strict=True)
    return [Group(name, ids, np.round(held * move, 4).astype(np.float32)) for name, move in named]


def lowered_tongue(points: Floats, path: Floats, by_mm: float) -> Group:
    """:data:`LOW`: the tongue of an open mouth lies on its floor, within the lower teeth, its front lower by ``by_mm``,
    narrower and further back.

    points, path : as for :func:`tongue_groups`.
    """
    share = smoothstep(points[:, 2], path[1, 0], path[-2, 0])
    moves = np.zeros((len(points), 3), np.float32)
    moves[:] = np.round(share[:, None] * (points * [-LOW_NARROWER, 0, 0] - [0.0, by_mm, LOW_BACK * by_mm]), 4)
    ids = np.flatnonzero(moves[:, 1]).astype(np.int32)
    return Group(LOW, ids, moves[ids])


def drawn_back_tongue(points: Floats, path: Floats, by_mm: float) -> Group:
    """:data:`BACK`: the front of the tongue goes back by ``by_mm``, its tip the furthest, and leaves its place to the
    lip.

    points, path : as for :func:`tongue_groups`.
    """
    moves = np.zeros((len(points), 3), np.float32)
    moves[:, 2] = np.round(-by_mm * smoothstep(points[:, 2], path[1, 0], path[-2, 0]), 4)
    ids = np.flatnonzero(moves[:, 2]).astype(np.int32)
    return Group(BACK, ids, moves[ids])


def _along_path(points: Floats, first: float, last: float, path: Callable[..., Floats]) -> Floats:
    """Points (n, 3) moved along a path of z, its cross-sections square to the line of their middles."""
    z = np.clip(points[:, 2], first, last)
    middle, to_y, to_z, thickness, width = path(z).T
    _, slope_y, slope_z, _, _ = path(z, 1).T
    over, length = thickness * (points[:, 1] - middle), np.hypot(slope_y, slope_z)
    return np.column_stack([
        width * points[:, 0],
        to_y + over * slope_z / length,
        to_z - over * slope_y / length + (points[:, 2] - z),
    ])  # fmt: skip


def lid_share(points: Floats, eyes: Floats, radius: float) -> Floats:
    """(n,) how closely each point keeps to an eyeball: 1 on it, 0 some millimetres away; negative: right eye."""
    out = np.zeros(len(points))
    for eye, sign in zip(eyes, (1.0, -1.0), strict=True):
        local = points - eye
        above = np.linalg.norm(local, axis=1) - radius
        near = np.clip((8.0 - above) / 5.0, 0.0, 1.0) * np.clip(local[:, 2] / 3.0 + 1.0, 0.0, 1.0)
        out += sign * smoothstep(near)
    return out
