"""Level the seams of a skin with itself: its two borders there are fitted one by one, and meet at a crease."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_matrix, diags, hstack, identity, kron, vstack
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

from surface.base.arrays import Bools, Floats
from surface.head.model.data import HeadData, PartData, Seam
from surface.head.model.meshes import domain_of, make_surface

CREASE_DEG = 6.0  # between the normals of the two borders: less is no crease
STEPS = 6  # places between two points of a seam
NEAR_MM, FAR_MM = 4.0, 11.0  # from the seam: between these the skin around tells how it should lie
GRID = 260  # places along u and v of a part that are looked through
ROUNDS = 6
FLAT, MEET, HELD, STIFF = 5.0, 1.5, 6.0, 0.03  # weights of what is asked for


def level_seams(head: HeadData) -> HeadData:
    """The head in which skin goes smoothly over the seams that it has with itself; its points at rest move."""
    parts = {part.name: part for part in head.parts}
    for seam in head.seams:
        part = parts[seam.part_a]
        if seam.part_a == seam.part_b and part.material == "skin":
            parts[part.name] = level_seam(part, seam)
    return replace(head, parts=[parts[part.name] for part in head.parts])


def level_seam(part: PartData, seam: Seam) -> PartData:
    """A part, levelled at one seam with itself, if there is a crease."""
    borders = _between(seam.uv_a), _between(seam.uv_b)
    for _ in range(ROUNDS):
        if crease_deg(part, *borders).max() < CREASE_DEG:
            break
        part = replace(part, points=part.points + _moves(part, borders))
    return part


def crease_deg(part: PartData, one: Floats, two: Floats) -> Floats:
    """(k,) angles between the normals of two borders (k, 2) in (u, v) of a part."""
    a, b = (_placed(part, uv)[1] for uv in (one, two))
    return np.asarray(np.degrees(np.arccos(np.clip((a * b).sum(axis=1), -1.0, 1.0))))


def _between(line: Floats) -> Floats:
    """Places along a polyline (k, 2), a few to each piece."""
    at = np.linspace(0.0, len(line) - 1.0, STEPS * (len(line) - 1) + 1)
    return np.column_stack([np.interp(at, np.arange(len(line)), line[:, k]) for k in (0, 1)])


def _placed(part: PartData, uv: Floats) -> tuple[Floats, Floats]:
    """Points and outward unit normals, each (k, 3), at places (k, 2)."""
    at, along_u, along_v = make_surface(part).derivatives(uv)
    return at, _unit(np.cross(along_u, along_v) * (-1.0 if part.flip else 1.0))


def _unit(x: Floats) -> Floats:
    return np.asarray(x / np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-12))


def _moves(part: PartData, borders: tuple[Floats, Floats]) -> Floats:
    """(n, 3) by which control points move: the borders meet and lie as the skin around them does, which stays."""
    around = _drawn(part)
    places, normals = _placed(part, around)
    seam = 0.5 * (_placed(part, borders[0])[0] + _placed(part, borders[1])[0])
    away = cKDTree(seam).query(places)[0]
    wanted = _as_around(seam, places, normals, (away > NEAR_MM) & (away < FAR_MM))
    asked = [row for uv in borders for row in _asked(part, uv, seam, wanted)]
    kept = make_surface(part).basis_matrix(around[away >= NEAR_MM])
    held = kron(kept, identity(3)) * (HELD * np.sqrt(len(seam) / max(kept.shape[0], 1)))
    rows = vstack([*(rows for rows, _ in asked), held, identity(3 * len(part.points)) * STIFF]).tocsc()
    reaching = np.unique(vstack([rows for rows, _ in asked]).tocsr().indices)  # others cannot help, and stay
    rows, values = rows[:, reaching], np.concatenate([value for _, value in asked])
    out = np.zeros(3 * len(part.points))
    out[reaching] = spsolve((rows.T @ rows).tocsc(), rows[: len(values)].T @ values)
    return out.reshape(-1, 3)


def _drawn(part: PartData) -> Floats:
    """Places (m, 2) all over what is drawn of a part."""
    domain = domain_of(part)
    u0, u1, v0, v1 = domain.rect
    uv = np.stack(np.meshgrid(np.linspace(u0, u1, GRID), np.linspace(v0, v1, GRID)), axis=-1).reshape(-1, 2)
    drawn: Bools = domain.inside(uv)
    return np.asarray(uv[drawn & make_surface(part).covered(uv)])


def _as_around(seam: Floats, places: Floats, normals: Floats, ring: Bools) -> Floats:
    """(k, 3) normals that a seam (k, 3) has if it lies as the skin beside it, which is that in the ring (m,)."""
    near = cKDTree(places[ring]).query_ball_point(seam, FAR_MM + NEAR_MM)
    return _unit(np.array([normals[ring][found].sum(axis=0) for found in near]))


def _asked(part: PartData, uv: Floats, seam: Floats, wanted: Floats) -> Iterator[tuple[csr_matrix, Floats]]:
    """Rows over the moves of all control points, (m, 3 n), and what they should be: a border lies on the seam, and its
    tangents are level with the wanted normals (k, 3)."""
    surface = make_surface(part)
    yield kron(surface.basis_matrix(uv), identity(3)) * MEET, MEET * (seam - surface.evaluate(uv)).ravel()
    for kind, tangents in zip(((1, 0), (0, 1)), surface.derivatives(uv)[1:], strict=True):
        weight = FLAT / np.maximum(np.linalg.norm(tangents, axis=1), 1e-9)  # of a sine
        slopes = surface.basis_matrix(uv, kind)
        by_axis = [diags(weight * wanted[:, axis]) @ slopes for axis in range(3)]
        columns = np.arange(3 * len(part.points)).reshape(3, -1).T.ravel()  # from x, y, z apart to together
        yield hstack(by_axis).tocsr()[:, columns], -weight * (tangents * wanted).sum(axis=1)
