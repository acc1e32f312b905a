"""Correct control points of a fitted head that the samples hardly determine: where the surface sticks out of the mesh,
or is inside out.

Such a point is moved to where its neighbours suggest, at rest or in one shape. A change that does not bring the surface
nearer to the mesh is undone. :func:`faults_of` says why a face is refused after that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.measures.dense import measure_dense
from surface.fit.points.report import NEUTRAL, Both, DenseErrors, FittedPart
from surface.fit.source.islands import find_islands, signed_areas
from surface.fit.source.mesh import FitMesh
from surface.head.model.data import Group, HeadData, PartData
from surface.head.model.meshes import make_surface
from surface.head.posing.contact import weights_at

STICKS_OUT_MM = 6.0  # of a head of usual size: a surface so far from the mesh is mended
TURNED_MM2 = 10.0  # area that is inside out, on a head of usual size, from which on it is mended
GONE_MM2 = 1.0  # area inside out, for less of which nothing more is tried
REFUSED_MM, REFUSED_MM2 = 20.0, 100.0  # distance from the mesh, and area inside out, for which a face is refused
ASTRAY_MM = 4.0  # and one of which at rest a hundredth is further from it
MAX_ROUNDS = 3
RINGS = 0, 1, 2, 3  # of neighbours that are corrected with the points that hold a place, tried in turn until it is good
MIN_HOLD = 0.1  # least weight of a control point at a place that sticks out
NO_PLACES = np.zeros((0, 2))
NEIGHBOURS = 12  # control points that show where one belongs


def mend_spikes(
    head: HeadData, mesh: FitMesh, sources: dict[str, list[int]], parts: Sequence[FittedPart], scale: float
) -> tuple[HeadData, DenseErrors, list[str]]:  # fmt: skip
    """The head without spikes, its errors, also of the fit alone, and what was mended, in words.

    scale : size of the head relative to a usual one.
    """
    limit = STICKS_OUT_MM * scale
    notes: list[str] = []
    dense = measure_dense(head, mesh, sources, parts, limit, fit_alone=True)
    for _ in range(MAX_ROUNDS):
        wanted = _wanted(dense, limit) + _turned(dense, scale)
        if not wanted:
            break
        best: tuple[HeadData, int, DenseErrors] | None = None
        for rings in RINGS:
            trial, moved = _mended(head, wanted, dense, rings)
            after = measure_dense(trial, mesh, sources, parts, limit)
            if moved > 0 and _is_better(after, dense, wanted, limit):
                if best is None or _left(after, wanted) < 0.5 * _left(best[2], wanted):
                    best = trial, moved, after
                if _left(after, wanted) <= GONE_MM2 * scale**2:
                    break
        if best is None:
            break
        head, moved, dense = best
        notes.append(f"mended: {moved} control points stuck out or were inside out: {_in_words(wanted)}")
    if notes:  # trials are measured with their contacts only
        dense = measure_dense(head, mesh, sources, parts, limit, fit_alone=True)
    return head, dense, notes


def _mended(
    head: HeadData, wanted: list[tuple[str, str, str]], dense: DenseErrors, rings: int
) -> tuple[HeadData, int]:  # fmt: skip
    """The head with its wanted parts and shapes put right, and how many control points that took."""
    moved = 0
    for part, shape in dict.fromkeys((part, shape) for part, shape, _ in wanted):
        head, count = _smoothed(head, part, shape, dense, rings)
        moved += count
    return head, moved


def _in_words(wanted: list[tuple[str, str, str]]) -> str:
    return ", ".join(f"{part} ({shape}: {much})" for part, shape, much in wanted[:3])


def _wanted(dense: DenseErrors, limit: float) -> list[tuple[str, str, str]]:
    """Parts and shapes that stick out, and by how much; of a part that does at rest only that, for all shapes show
    it."""
    out = []
    for part, by_shape in dense.parts.items():
        far = {s: b.to_mesh.max for s, b in by_shape.items() if b.to_mesh.max > limit}
        out += [(part, s, f"{most:.1f} mm") for s, most in far.items() if NEUTRAL not in far or s == NEUTRAL]
    return out


def _turned(dense: DenseErrors, scale: float) -> list[tuple[str, str, str]]:
    """Parts and shapes that are inside out somewhere, and how much; of a part that is so at rest only that."""
    far = {key: over.mm2 for key, over in dense.turned.items() if over.mm2 > TURNED_MM2 * scale**2}
    return [(p, s, f"{mm2:.0f} mm²") for (p, s), mm2 in far.items() if s == NEUTRAL or (p, NEUTRAL) not in far]


def _is_better(after: DenseErrors, before: DenseErrors, wanted: list[tuple[str, str, str]], limit: float) -> bool:
    """Whether everything that was mended sticks out less, or less of it is inside out, and nothing else got worse.

    limit : mm; parts may stick out by half of it, since points moved along a bent surface end a little beside it.
    """
    was, now = _furthest(before), _furthest(after)
    gained = all(now.get(w[:2], np.inf) < 0.8 * was[w[:2]] for w in wanted if w[2].endswith("mm"))
    gained &= _left(after, wanted) <= 0.5 * _left(before, wanted) or not any(w[2].endswith("²") for w in wanted)
    return gained and max(now.values(), default=0.0) <= max([0.5 * limit, *was.values()])


def _left(dense: DenseErrors, wanted: list[tuple[str, str, str]]) -> float:
    """Area, mm², that is inside out of what is mended."""
    return sum(over.mm2 for key, over in dense.turned.items() if key in {w[:2] for w in wanted})


def _furthest(dense: DenseErrors) -> dict[tuple[str, str], float]:
    every = (((p, s), both.to_mesh) for p, by_shape in dense.parts.items() for s, both in by_shape.items())
    return {key: errors.max for key, errors in every if errors.measured}


def _smoothed(head: HeadData, name: str, shape: str, dense: DenseErrors, rings: int) -> tuple[HeadData, int]:
    """The head with the control points of one part put right in one shape, ``rings`` of neighbours with them, and how
    many they are."""
    part = next(p for p in head.parts if p.name == name)
    over = dense.turned.get((name, shape))
    found = [dense.sticking.get((name, shape), NO_PLACES), over.uv if over is not None else NO_PLACES]
    rows = np.concatenate(found)
    if not len(rows):
        return head, 0
    bad = _grown(part, _holding(part, rows), rings)
    if shape == NEUTRAL:
        fixed = replace(part, points=_filled(part, part.points, bad))
    else:
        fixed = replace(part, groups=[_group_filled(part, g, bad) if g.name == shape else g for g in part.groups])
    return replace(head, parts=[fixed if p is part else p for p in head.parts]), int(bad.sum())


def _holding(part: PartData, uv: Floats) -> Bools:
    """(n,) control points that have weight at places (k, 2) in (u, v)."""
    _, ids, share = weights_at(make_surface(part), uv)
    out = np.zeros(len(part.points), bool)
    out[ids[share > MIN_HOLD]] = True
    return out


def _grown(part: PartData, bad: Bools, rings: int) -> Bools:
    """Control points (n,) that are bad, and their nearest neighbours in (u, v), several times over."""
    centres = np.column_stack([part.knots_u.mean(axis=1), part.knots_v.mean(axis=1)])
    out = bad.copy()
    for _ in range(rings):
        for i in np.flatnonzero(out):
            out[np.argsort(np.linalg.norm(centres - centres[i], axis=1))[:NEIGHBOURS]] = True
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


def faults_of(dense: DenseErrors, parts: Sequence[FittedPart], scale: float) -> list[str]:
    """Messages that say why a fitted head is refused: its face, the first part, does not follow the mesh, sticks far
    out of it, or is inside out."""
    shapes = dense.parts.get(parts[0].name, {}) if parts else {}
    out = []
    if NEUTRAL in shapes and not (shapes[NEUTRAL].to_mesh.measured and shapes[NEUTRAL].to_surface.measured):
        return ["nothing of the fitted face could be measured: all of it lies in folds"]
    if NEUTRAL in shapes and not all(x <= ASTRAY_MM * scale for x in _both(shapes[NEUTRAL], "p99")):
        most = max(_both(shapes[NEUTRAL], "p99"))
        out.append(f"the fitted face does not follow the mesh: 1 % of it is {most:.0f} mm away or more")
    far = [(max(_both(b, "max")), s == NEUTRAL, s) for s, b in shapes.items()]
    far = [x for x in far if not x[0] <= REFUSED_MM * scale]
    if far:
        most, _, shape = max(far, key=lambda x: (x[1], x[0]))
        where = f": {dense.worst.place}" if dense.worst and dense.worst.shape == shape else ""
        out.append(f"the fitted face is {most:.0f} mm off the mesh {_when(shape)}{where}")
    over = {s: x.mm2 for (p, s), x in dense.turned.items() if shapes and p == parts[0].name}
    shape = max(over, key=lambda s: over[s], default=NEUTRAL)
    if over.get(shape, 0.0) > REFUSED_MM2 * scale**2:
        out.append(f"{over[shape]:.0f} mm² of the fitted face are inside out {_when(shape)}")
    return out


def _both(errors: Both, key: str) -> list[float]:
    return [getattr(errors.to_mesh, key), getattr(errors.to_surface, key)]


def _when(shape: str) -> str:
    return "at rest" if shape == NEUTRAL else f"with {shape} = 1"


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
    return [f"{n} faces{f' of {name!r}' if name else ''} are flipped in (u, v)" for name, n in flipped.items()]


def _name_of(mesh: FitMesh, vertices: Ints) -> str:
    """The object that an island belongs to."""
    return mesh.piece_of(int(np.argmax(np.isin(mesh.faces[:, 0], vertices))))
