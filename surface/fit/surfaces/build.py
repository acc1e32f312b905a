"""Parts of a head out of the surfaces of a file: the same control points, weights and knots, in head space."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from surface.fit.surfaces.pieces import Piece
from surface.head.model.data import Group, HeadData, PartData
from surface.head.model.meshes import make_surface, pack, tessellate
from surface.head.model.placement import Placement

CHORD_ERROR = 4e-4  # of a part's triangles, as a fraction of the head's size
MAX_DEPTH = 8
POSE_AMOUNT = 0.4  # of every group at once in the pose that decides how finely a part is tessellated


def make_part(piece: Piece, placement: Placement, size: float, follows: str, *, flip: bool) -> PartData:
    """The part of one surface.

    size : of the head, mm. follows : "skin" or what it is fixed to. flip : its outside is that of S_v x S_u.
    """
    surface, domain, none = piece.surface, piece.domain, np.zeros(piece.surface.n)
    knots_u, knots_v = (np.array(rows) for rows in surface.padded)
    return PartData(
        piece.name, "eye" if follows.endswith("_eye") else piece.material, follows, placement.points(surface.points),
        surface.weights.copy(), knots_u, knots_v, np.stack(surface.degrees, axis=1),
        [np.array(loop) for loop in domain.loops], np.zeros((0, 3)), (0, CHORD_ERROR * size, MAX_DEPTH), [], none, none,
        closed_u=surface.closed[0], closed_v=surface.closed[1], rect=domain.rect, flip=flip, cuts=tuple(domain.slits),
    )  # fmt: skip


def with_mesh(part: PartData, head: HeadData) -> PartData:
    """The part with its tessellation, so that a face starts at once; fine enough for a face that moves."""
    surface = make_surface(part)
    moved = part.points.copy()
    for group in part.groups:
        moved[group.ids] += POSE_AMOUNT * group.moves
    return replace(part, mesh=pack(tessellate(part, surface.with_points(moved), head.seams), part.budget))


def with_groups(part: PartData, groups: list[Group]) -> PartData:
    """The part with groups added; those of one name become one."""
    moves: dict[str, np.ndarray] = {}
    for group in (*part.groups, *groups):
        own = moves.setdefault(group.name, np.zeros((len(part.points), 3)))
        np.add.at(own, group.ids, group.moves)
    return replace(part, groups=[sparse_group(name, own) for name, own in moves.items() if own.any()])


def sparse_group(name: str, moves: np.ndarray) -> Group:
    """A group of displacements (n, 3) without the control points that stay where they are."""
    ids = np.flatnonzero(moves.any(axis=1)).astype(np.int32)
    return Group(name, ids, moves[ids].astype(np.float32))
