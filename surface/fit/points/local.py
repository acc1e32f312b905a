"""Let groups act only where their shape moves the skin.

Least squares spread each group over nearly all control points of a part, by hundredths of a millimetre, and captured
shapes move the whole face a little. Nobody sees that, but a pose then has to compute the whole face for one parameter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse import csc_matrix, identity
from scipy.sparse.linalg import splu

from surface.base.arrays import Bools, Floats
from surface.dcp import DCPSurface
from surface.fit.points.report import Localised
from surface.head.model.data import Contact, Group, HeadData, PartData
from surface.head.model.meshes import make_surface, tessellate, unpack
from surface.head.model.parameters import SHAPES, smoothstep
from surface.head.posing.contact import lip_weights, weights_at

STILL_MM, MOVED_MM = 0.03, 0.1  # skin that a shape moves less stays; from the second on it moves as before
OFF_MM = 0.13  # groups that would be off by more than that somewhere stay as they are
QUIET_MM = 0.05  # shapes that move the samples of a contact less leave it alone
MIN_SHARES = 0.1, 0.02, 0.005  # of a point's weights, in skin that moves: with less it stays; tried one by one
FULL_SHARE = 0.999  # with more it moves as before
RIDGE = 1e-3  # weight of keeping the points' displacements, relative to a sample's


def localised(head: HeadData, scale: float) -> tuple[HeadData, Localised]:
    """Return the head whose shapes leave skin still that they would move by less than :data:`STILL_MM`, and how much
    less of it they move.

    scale : size of the head relative to a usual one.

    A group that would be off by more than :data:`OFF_MM` somewhere stays as it is.
    """
    parts, told = [], []
    for part in head.parts:
        near = [c for c in head.contacts if c.part == part.name]
        made = _local_part(part, head, near, scale) if part.follows == "skin" else None
        parts.append(part if made is None else replace(part, groups=[g for g, _ in made if len(g.ids)]))
        told += [(part, before, *after) for before, after in zip(part.groups, made or [], strict=False)]
    return replace(head, parts=parts), _told(told)


def _told(shapes: Sequence[tuple[PartData, Group, Group, float | None]]) -> Localised:
    """What became of every shape's group of every part: before, after, and by how much it is off, mm; None for one that
    would have been off too far."""
    named = [each for each in shapes if each[1].name in SHAPES]
    whole: dict[str, list[str]] = {}
    for part, group, _, off in named:
        if off is None:
            whole.setdefault(part.name, []).append(group.name)
    before, after = (
        sum(len(g.ids) for g in groups) for groups in ([b for _, b, _, _ in named], [a for _, _, a, _ in named])
    )
    most = max(named, key=lambda each: each[3] or 0.0, default=None)
    if most is None or not most[3]:
        return Localised(before, after, whole=whole)
    return Localised(before, after, float(most[3]), most[1].name, most[0].name, whole)


def _local_part(
    part: PartData, head: HeadData, contacts: Sequence[Contact], scale: float
) -> list[tuple[Group, float | None]]:  # fmt: skip
    """The part's groups, those of shapes such that they act where these move it; and how far each is off, mm, None for
    those that stay since they would be off too far."""
    surface = make_surface(part)
    mesh = unpack(part.mesh, surface, part.budget, rough=True, flip=part.flip) or tessellate(part, surface, head.seams)
    centres = mesh.uv[mesh.triangles].mean(axis=1)  # inside triangles: at slits, borders belong to two sides
    weights = surface.basis_matrix(centres).tocsc()
    near = [_near(surface, c) for c in contacts]
    return [_local_group(g, weights, near, scale) if g.name in SHAPES else (g, 0.0) for g in part.groups]


def _near(surface: DCPSurface, contact: Contact) -> tuple[csc_matrix, Bools]:
    """Weights (s, n) of the samples of a contact, and which control points (n,) they depend on."""
    places = contact.places.reshape(-1, 2)
    start, ids, share = weights_at(surface, places) if contact.eye >= 0 else lip_weights(contact, surface)[:3]
    rows = np.repeat(np.arange(len(start) - 1), np.diff(start))
    weights = csc_matrix((share, (rows, ids)), shape=(len(start) - 1, surface.n))
    return weights, np.asarray(weights.getnnz(axis=0) > 0)


def _local_group(
    group: Group, weights: csc_matrix, near: Sequence[tuple[csc_matrix, Bools]], scale: float
) -> tuple[Group, float | None]:  # fmt: skip
    """The group with fewer points, and how far it is off, mm; the same, and None, where it cannot be told so.

    Where it hardly moves a contact, it moves none of its points, and the contact need not be solved again.
    """
    n = weights.shape[1]
    moves, held = np.zeros((n, 3)), np.zeros(n, np.bool_)
    np.add.at(moves, group.ids, group.moves.astype(np.float64))
    for samples, points in near:
        held |= points & (_most(samples @ moves) < QUIET_MM * scale)
    given = weights @ moves
    share = smoothstep(np.linalg.norm(given, axis=1) / scale, STILL_MM, MOVED_MM)
    wanted = share[:, None] * given
    for least in MIN_SHARES:
        local = _solved(moves, wanted, weights, share, held, least)
        if (off := _most(weights @ local - given)) <= OFF_MM * scale:
            ids = np.flatnonzero(local.any(axis=1))
            return Group(group.name, ids.astype(np.int32), local[ids].astype(np.float32)), off
    return group, None


def _most(moves: Floats) -> float:
    """Return the greatest length of vectors (k, 3)."""
    return float(np.linalg.norm(moves, axis=1).max(initial=0.0))


def _solved(moves: Floats, wanted: Floats, weights: csc_matrix, share: Floats, held: Bools, least: float) -> Floats:
    """Displacements (n, 3) of few points that move samples as ``wanted (s, 3)``: points all of whose samples move as
    before keep theirs, those whose samples stay have none, and those between are found by least squares.

    share : (s,) of their motion that samples keep. held : (n,) points that stay, as do
    those with ``least`` of their weights where skin moves.
    """
    reach = np.asarray(weights.sum(axis=0)).ravel()
    moving = np.asarray(weights.T @ share).ravel() / np.maximum(reach, 1e-12)
    acting = moves.any(axis=1) & ~held & (moving > least)
    kept = acting & (moving > FULL_SHARE)
    between = np.flatnonzero(acting & ~kept)
    local = np.where(kept[:, None], moves, 0.0)
    if len(between):
        own = weights[:, between]
        normal = (own.T @ own + RIDGE * identity(len(between))).tocsc()
        local[between] = splu(normal).solve(own.T @ (wanted - weights @ local) + RIDGE * moves[between])
    return local
