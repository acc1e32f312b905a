"""Accessories of a mesh, such as hair, hats and glasses, that a head keeps as they are: triangles with a texture.

What they are is said by :mod:`surface.fit.source.kinds`. They are placed as the head is, and keep their form.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.features.worn_limits import some_triangles, within_limits
from surface.fit.source.kinds import kind_of, kinds, listed
from surface.fit.source.load import Loaded
from surface.fit.source.mesh import FitMesh, face_areas, triangles
from surface.fit.source.pictures import Reduced, reduced_picture
from surface.fit.source.placing.bust import outline
from surface.fit.source.placing.frame import EYES_AT
from surface.fit.source.placing.place import HeadSize, head_size
from surface.fit.source.textures import average_colour
from surface.head.model.accessories import Accessory
from surface.head.model.placement import Placement
from surface.readers.meshdata import Material

CREASE_DEG = 55.0  # faces that meet at a sharper angle do not share their normals
MAX_PAIRS = 20_000_000  # of corners of faces at one vertex; a mesh with more gets smooth normals
PAIRS_AT_ONCE = 1_000_000  # that are held in memory together, 100 bytes each; a vertex with more gets smooth normals
ROUND = 1.6  # of hair: weight of directions from the middle of the head beside its cards' own normals
SKULL = np.array([0.0, -15.0, -75.0])  # from the middle of the eyes to that of the hair, mm, on a head of usual size
DEEP_MM, DARKEST = 30.0, 0.5  # of a head of usual size: how deep in hair it is darkest; how dark, linear
DIRECTIONS, OUTERMOST = 500, 90.0  # around the middle; percentile of distances in each that counts as outermost
INSIDE = 0.5  # of an accessory's area, which must be on head and shoulders: what is worn elsewhere is left out
KEPT = "kept as they are"
UNMAPPED = "some of their faces have no texture coordinates"
MOST_REPEATS = 1e4  # of a texture on an accessory; coordinates further away are damage


@dataclass(frozen=True)
class Kept:
    """Accessories of a head, notes on them, and what the pieces of the mesh became of which they were made."""

    accessories: tuple[Accessory, ...]
    notes: list[str]
    pieces: dict[str, str]


def make_accessories(loaded: Loaded) -> Kept:
    """The accessories of a mesh that is in its place, in head space."""
    known = loaded.marks.eyes is not None
    return keep_accessories(loaded.worn, loaded.placement, EYES_AT if known else None, head_size(loaded.marks))


def keep_accessories(
    worn: FitMesh | None, placement: Placement, eyes: Floats | None, size: HeadSize
) -> Kept:  # fmt: skip
    """The accessories of a head whose mesh was placed so.

    worn : what is kept as it is, in the file's coordinates. eyes : (3,) their middle, mm; None where it is not known.
    """
    if worn is None:
        return Kept((), [], {})
    placed = placement.points(worn.vertices)
    near, middle = _near(placed, worn, eyes, size), _middle(placed, eyes, size)
    found, named, gone = list[Accessory](), dict[str, str](), list[str]()
    lost: dict[str, list[str]] = {}
    for k, name in enumerate(worn.pieces):
        if not (worn.piece == k).any():
            continue
        named[name] = kind_of(name).name
        if not near[k]:
            gone.append(name)
            continue
        made, why = _accessories(worn, k, placed, middle, size.across)
        found += made
        if why:
            lost.setdefault(why, []).append(name)
    limited = within_limits(found)
    notes = [
        *_kept_notes(found, limited.gone),
        *(f"without their texture, {why}: {listed(names)}" for why, names in lost.items()),
    ]
    notes += [f"left out, because it is not worn on the head: {listed(gone)}"] * bool(gone)
    out = {*gone, *limited.gone}
    pieces = {name: f"{kind}, left out" if name in out else f"{kind}, kept as it is" for name, kind in named.items()}
    return Kept(limited.accessories, notes + limited.notes, pieces)


def _kept_notes(found: list[Accessory], gone: list[str]) -> list[str]:
    """What is kept with a texture, and what in one colour, by kind; not what is ``gone``."""
    every = dict[tuple[bool, str], dict[str, None]]()
    for one in found:
        if one.name in gone:
            continue
        every.setdefault((bool(one.texture), one.kind), {})[one.name] = None
    rows = ((how, [f"{kind} {listed([*names])}" for (has, kind), names in every.items() if has == how])
            for how in (True, False))  # fmt: skip
    return [f"{KEPT}, {'with their texture' if how else 'in one colour'}: {'; '.join(row)}" for how, row in rows if row]


def _near(placed: Floats, worn: FitMesh, eyes: Floats | None, size: HeadSize) -> Bools:
    """(pieces,) whether each is worn on the head or the shoulders; hair always is."""
    hair = np.array([kind_of(name).name == "hair" for name in worn.pieces])
    if eyes is None:
        return np.ones(len(worn.pieces), bool)
    areas = face_areas(placed, worn.faces)
    within = outline(placed, eyes, max(size.across, size.along))[worn.faces[:, 0]] < 0
    inside, whole = (np.bincount(worn.piece, a, len(worn.pieces)) for a in (areas * within, areas))
    near: Bools = hair | (inside >= INSIDE * whole)
    return near


def _middle(placed: Floats, eyes: Floats | None, size: HeadSize) -> Floats:
    """(3,) mm the middle of the skull, or of what is worn where the eyes are not known."""
    if eyes is None:
        middle: Floats = 0.5 * (placed.min(axis=0) + placed.max(axis=0))
        return middle
    skull: Floats = eyes + size.across * SKULL
    return skull


def _accessories(
    worn: FitMesh, k: int, placed: Floats, middle: Floats, scale: float
) -> tuple[list[Accessory], str]:  # fmt: skip
    """One piece, with a vertex for each of its texture coordinates and normals; and why it or some of it lost its
    texture. Faces without texture coordinates are one of their own, in one colour."""
    own, kind = worn.piece == k, kind_of(worn.pieces[k])
    hair = kind.name == "hair"
    tri, rows = triangles(worn.faces[own]), triangles(worn.face_uv[own], worn.faces[own])
    material = (worn.materials[k] if worn.materials else None) or Material()
    normals = corner_normals(placed, tri)
    normals = _rounded(normals, placed[tri], middle) if hair else normals
    uv, mapped = _places(material.in_picture(worn.uv), rows)
    at, corner = _unique_corners(tri, np.where(mapped[:, None], rows, -1), normals)
    points = placed[tri.ravel()[at]]
    made = Accessory(
        worn.pieces[k], kind.name, points.astype(np.float32),
        normals.reshape(-1, 3)[at].astype(np.float32), uv.reshape(-1, 2)[at].astype(np.float32),
        corner.astype(np.int32), (_shade(points, middle, DEEP_MM * scale) if hair else np.ones(len(at))).astype("f4"),
        two_sided=material.two_sided or hair,
    )  # fmt: skip
    return _coloured(made, mapped, material)


def _coloured(made: Accessory, mapped: Bools, material: Material) -> tuple[list[Accessory], str]:
    """An accessory with the colours of its material, less triangles that are not ``mapped`` (t,), which are another;
    and why any lost its texture. One of which nothing is clear is solid, whatever its material says."""
    picture, clear, lost = Reduced(b"", False, material.lost)
    if material.texture is not None:
        picture, clear, lost = reduced_picture(material) if mapped.any() else Reduced(b"", False)
        lost = lost or UNMAPPED * (not mapped.all())
    solid = material.alpha if material.colour[3] < 1.0 else "OPAQUE"
    made = replace(made, alpha=solid, cutoff=material.cutoff)
    full = replace(made, colour=material.colour, texture=picture, alpha=material.alpha if clear else solid)
    if picture and mapped.all():
        return [full], lost
    bare = replace(made, colour=_plain(made, material, picture, lost), uv=np.zeros_like(made.uv))
    return [some_triangles(full, mapped), some_triangles(bare, ~mapped)] if picture else [bare], lost


def _plain(made: Accessory, material: Material, picture: bytes, lost: str) -> tuple[float, float, float, float]:
    """The colour of what has no texture: its material's, with the mean of its texture where others have it; or that of
    its kind, where white or the grey beside a lost texture tells nothing."""
    mean = average_colour(picture) if picture else None
    colour = np.array(material.colour[:3])
    told = np.ptp(colour) > 0.0 or not (lost or (colour == 1.0).all())
    r, g, b = (colour if told else kinds()[made.kind].colour) if mean is None else (colour * mean).tolist()
    return float(r), float(g), float(b), material.colour[3]


def _places(at: Floats, rows: Ints) -> tuple[Floats, Bools]:
    """Places (t, 3, 2) of triangles in a texture, of rows (t, 3) among all (n, 2), less whole repeats, so that small
    floats hold them exactly; and which triangles (t,) have any that are not far from all others. Others get 0."""
    uv = np.vstack([at, np.zeros((1, 2))])[rows]
    mapped: Bools = np.all(rows >= 0, axis=1)
    if mapped.any():
        ranked = uv[mapped, 0]
        middle = ranked[np.argsort(ranked[:, 0])[(len(ranked) - 1) // 2]]
        near: Bools = np.all(np.abs(uv - middle) < MOST_REPEATS, axis=(1, 2))
        mapped &= near
    if mapped.any():
        uv -= np.floor(uv[mapped].min(axis=(0, 1)))
    return np.where(mapped[:, None, None], uv, 0.0), mapped


def _shade(points: Floats, middle: Floats, deep_mm: float) -> Floats:
    """(m,) light that reaches hair: less of it, the deeper a vertex lies below the outermost hair in its direction."""
    away = points - middle
    far, ways = np.linalg.norm(away, axis=1), _directions(DIRECTIONS)
    own = cKDTree(ways).query(_unit(away))[1]
    seen = np.unique(own)
    most = np.array([np.percentile(far[own == k], OUTERMOST) for k in seen])
    distance, near = cKDTree(ways[seen]).query(_unit(away), k=min(4, len(seen)))
    share = 1.0 / np.maximum(np.atleast_2d(distance.reshape(len(points), -1)), 1e-6)
    out = (most[near.reshape(len(points), -1)] * share).sum(axis=1) / share.sum(axis=1)
    depth = np.clip((out - far) / deep_mm, 0.0, 1.0)
    light: Floats = 1.0 - (1.0 - DARKEST) * depth
    return light


def _directions(count: int) -> Floats:
    """(count, 3) unit vectors, evenly all around (a Fibonacci sphere)."""
    k = np.arange(count) + 0.5
    up, turn = 1.0 - 2.0 * k / count, np.pi * (1.0 + 5.0**0.5) * k
    level = np.sqrt(1.0 - up**2)
    return np.column_stack([level * np.cos(turn), up, level * np.sin(turn)])


def corner_normals(points: Floats, tri: Ints) -> Floats:
    """(t, 3, 3) unit normals at the corners of triangles (t, 3): means of the faces around a vertex, by their areas,
    which meet at less than :data:`CREASE_DEG`."""
    corner = points[tri]
    face = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area = np.linalg.norm(face, axis=1, keepdims=True)
    direction = face / np.maximum(area, 1e-30)
    order = np.argsort(tri.ravel(), kind="stable")
    _, first, count = np.unique(tri.ravel()[order], return_index=True, return_counts=True)
    pairs = np.cumsum(count.astype(float) ** 2)
    if pairs[-1] > MAX_PAIRS or count.max() ** 2 > PAIRS_AT_ONCE:
        return _smooth(points, tri, face)
    out = np.zeros((tri.size, 3))
    for runs in np.split(np.arange(len(count)), np.flatnonzero(np.diff(pairs // PAIRS_AT_ONCE)) + 1):
        mine, other = _pairs(first[runs], count[runs])
        a, b = order[mine] // 3, order[other] // 3
        soft = (direction[a] * direction[b]).sum(axis=1) > np.cos(np.radians(CREASE_DEG))
        np.add.at(out, order[mine[soft]], face[b[soft]])
    return _unit(out).reshape(*tri.shape, 3)


def _pairs(first: Ints, count: Ints) -> tuple[Ints, Ints]:
    """All pairs within runs that begin at ``first``, one after the other, and are ``count`` long, each with itself,
    too."""
    run = np.repeat(np.arange(len(count)), count)
    of = np.repeat(np.arange(len(run)), count[run])
    start = np.concatenate([[0], np.cumsum(count[run])[:-1]])
    return of + first[0], first[run][of] + np.arange(len(of)) - start[of]


def _smooth(points: Floats, tri: Ints, face: Floats) -> Floats:
    out = np.zeros_like(points)
    for k in range(3):
        np.add.at(out, tri[:, k], face)
    smooth: Floats = _unit(out)[tri]
    return smooth


def _unit(rows: Floats) -> Floats:
    length = np.linalg.norm(rows, axis=-1, keepdims=True)
    return np.where(length > 1e-12, rows / np.maximum(length, 1e-12), np.array([0.0, 0.0, 1.0]))


def _rounded(normals: Floats, corner: Floats, middle: Floats) -> Floats:
    """Normals of cards of hair, turned outwards and towards those of the whole that they make: light then falls on hair
    and not on each card."""
    away = _unit(corner - middle)
    outward = np.where((normals * away).sum(axis=-1, keepdims=True) < 0.0, -normals, normals)
    return _unit(outward + ROUND * away)


def _unique_corners(tri: Ints, rows: Ints, normals: Floats) -> tuple[Ints, NDArray[np.int64]]:
    """Corners that differ in vertex, texture coordinates or normal: the first of each, and triangles of these."""
    steps = np.rint(normals.reshape(-1, 3) * 500.0).astype(np.int64)
    key = np.column_stack([tri.ravel(), rows.ravel(), steps])
    _, at, inverse = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return at, inverse.reshape(tri.shape)
