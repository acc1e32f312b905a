"""Mend what sticks out of a fitted head though the mesh has nothing there: control points that the samples hardly hold.

Such a point is put where its neighbours say, at rest or in one shape. A mend that does not bring the surface nearer to
the mesh is taken back. A face that still sticks out far is refused, so that no such head is written.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.base.errors import FitError
from surface.fit.measures.dense import measure_dense
from surface.fit.points.report import NEUTRAL, DenseErrors, FittedPart
from surface.fit.source.islands import find_islands, signed_areas
from surface.fit.source.mesh import FitMesh
from surface.head.model.data import Group, HeadData, PartData
from surface.head.model.meshes import make_surface
from surface.head.posing.contact import weights_at

STICKS_OUT_MM = 6.0  # of a head of usual size: a surface so far from the mesh is mended
REFUSED_MM = 20.0  # a face so far from it is not written
ROUNDS = 3
HOLDS = 0.1  # least weight of a control point at a place that sticks out
NEIGHBOURS = 12  # that say where a point belongs


def mend_spikes(
    head: HeadData, mesh: FitMesh, sources: dict[str, list[int]], parts: Sequence[FittedPart], scale: float
) -> tuple[HeadData, DenseErrors, list[str]]:  # fmt: skip
    """The head without spikes, its errors, and what was mended, in words.

    scale : size of the head relative to a usual one. Raises FitError: the face still sticks out of the mesh by far.
    """
    limit = STICKS_OUT_MM * scale
    notes: list[str] = []
    dense = measure_dense(head, mesh, sources, parts, limit)
    for _ in range(ROUNDS):
        wanted = _wanted(dense, limit)
        if not wanted:
            break
        trial, moved = head, 0
        for part, shape, _ in wanted:
            trial, count = _smoothed(trial, part, shape, dense)
            moved += count
        after = measure_dense(trial, mesh, sources, parts, limit)
        if not moved or not _is_better(after, dense, wanted):
            break
        told = ", ".join(f"{part} ({shape}: {most:.1f} mm)" for part, shape, most in wanted[:3])
        notes.append(f"mended: {moved} control points stuck out of the mesh: {told}")
        head, dense = trial, after
    _refuse(dense, parts, scale)
    return head, dense, notes


def _wanted(dense: DenseErrors, limit: float) -> list[tuple[str, str, float]]:
    """Parts and shapes that stick out, and by how much; of a part that does at rest only that, for all shapes show
    it."""
    out = []
    for part, by_shape in dense.parts.items():
        far = {s: b.to_mesh.max for s, b in by_shape.items() if b.to_mesh.max > limit}
        out += [(part, s, most) for s, most in far.items() if NEUTRAL not in far or s == NEUTRAL]
    return out


def _is_better(after: DenseErrors, before: DenseErrors, wanted: list[tuple[str, str, float]]) -> bool:
    """Does everything that was mended stick out less, and nothing else more?"""
    now = {(p, s): both.to_mesh.max for p, by_shape in after.parts.items() for s, both in by_shape.items()}
    gained = all(now[part, shape] < 0.8 * most for part, shape, most in wanted)
    return gained and max(now.values()) <= max(b.to_mesh.max for x in before.parts.values() for b in x.values())


def _smoothed(head: HeadData, name: str, shape: str, dense: DenseErrors) -> tuple[HeadData, int]:
    """The head with the control points of one part put right in one shape, and how many they are."""
    part = next(p for p in head.parts if p.name == name)
    rows = dense.sticking.get((name, shape))
    if rows is None or not len(rows):
        return head, 0
    bad = _holding(part, rows)
    if shape == NEUTRAL:
        fixed = replace(part, points=_filled(part, part.points, bad))
    else:
        fixed = replace(part, groups=[_group_filled(part, g, bad) if g.name == shape else g for g in part.groups])
    return replace(head, parts=[fixed if p is part else p for p in head.parts]), int(bad.sum())


def _holding(part: PartData, uv: Floats) -> Bools:
    """(n,) control points that have weight at places (k, 2) in (u, v)."""
    _, ids, share = weights_at(make_surface(part), uv)
    out = np.zeros(len(part.points), bool)
    out[ids[share > HOLDS]] = True
    return out


def _group_filled(part: PartData, group: Group, bad: Bools) -> Group:
    moves = np.zeros((len(part.points), 3))
    moves[group.ids] = group.moves
    moves = _filled(part, moves, bad)
    ids = np.flatnonzero(np.abs(moves).max(axis=1) > 0).astype(np.int32)
    return Group(group.name, ids, np.round(moves[ids], 4).astype(np.float32))


def _filled(part: PartData, values: Floats, bad: Bools) -> Floats:
    """Values (n, 3) of control points; bad ones by a plane over (u, v) through the nearest good ones."""
    centres = np.column_stack([part.knots_u.mean(axis=1), part.knots_v.mean(axis=1)])
    good, out = np.flatnonzero(~bad), values.copy()
    for i in np.flatnonzero(bad):
        near = good[_sees(part, centres[i], centres[good])]
        distance = np.linalg.norm(centres[near] - centres[i], axis=1)
        nearest = np.argsort(distance)[:NEIGHBOURS]
        if len(nearest) < 3:
            continue
        offset = centres[near[nearest]] - centres[i]
        weight = 1.0 / (distance[nearest] + 1e-9)
        system = np.column_stack([np.ones(len(nearest)), offset]) * weight[:, None]
        out[i] = np.linalg.lstsq(system, values[near[nearest]] * weight[:, None], rcond=None)[0][0]
    return out


def _sees(part: PartData, place: Floats, others: Floats) -> Bools:
    """(k,) which places (k, 2) lie on the same side of all slits as one (2,)."""
    out = np.ones(len(others), bool)
    for v, start, end in part.slits:
        across = (others[:, 1] - v) * (place[1] - v) < 0
        out &= ~(across & (np.maximum(others[:, 0], place[0]) > start) & (np.minimum(others[:, 0], place[0]) < end))
    return out


def _refuse(dense: DenseErrors, parts: Sequence[FittedPart], scale: float) -> None:
    """Raise FitError for a face that is far out where the mesh is near the face: a spike, and no coarse fit."""
    shapes = dense.parts.get(parts[0].name, {}) if parts else {}
    far = [
        (b.to_mesh.max, s) for s, b in shapes.items() if not b.to_mesh.max <= 2.0 * max(b.to_surface.max, b.folds.max)
    ]
    worst = max(far, default=(0.0, ""), key=lambda x: (x[1] == NEUTRAL, x[0]))
    if not worst[0] <= REFUSED_MM * scale:
        where = f": {dense.worst.place}" if dense.worst and dense.worst.shape == worst[1] else ""
        when = "at rest" if worst[1] == NEUTRAL else f"with {worst[1]} = 1"
        raise FitError(
            f"the fitted face sticks out of the mesh by {worst[0]:.0f} mm {when}{where}",
            hint="unwrap the mesh anew so that no faces overlap or are turned over in (u, v), or leave that shape out",
        )


def turned_faces(mesh: FitMesh) -> list[str]:
    """Notes of faces that lie the other way round in (u, v) than most of their island: the surface folds there."""
    flipped: dict[str, int] = {}
    mapped = np.flatnonzero((mesh.face_uv[:, :3] >= 0).all(axis=1))
    for island in find_islands(mesh, mapped) if len(mapped) else []:
        areas = signed_areas(island)
        count = int(min((areas > 0).sum(), (areas < 0).sum()))
        if count:
            name = _name_of(mesh, island.vertex)
            flipped[name] = flipped.get(name, 0) + count
    return [f"{n} faces{f' of {name!r}' if name else ''} are turned over in (u, v)" for name, n in flipped.items()]


def _name_of(mesh: FitMesh, vertices: Ints) -> str:
    """The object that an island belongs to."""
    return mesh.piece_of(int(np.argmax(np.isin(mesh.faces[:, 0], vertices))))
