"""Cut a head from its body, so that a bust remains, like the shipped head."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.source.kinds import SKIN, is_known, kind_of
from surface.fit.source.mesh import FitMesh, directed_edges, face_areas, renumbered, triangles

BODY_BELOW = 300.0  # a mesh that reaches further below the eyes, mm at usual size, has a body; a bust has not
BASE, DOWN, ASIDE = -131.0, 98.0, 150.0  # the bust's outline: from this height, so far down and so far to the sides
EXPONENT = 4.0  # of the outline, a superellipse: 2 would be an ellipse
MIN_AREA_INSIDE = 0.5  # of an object; with a smaller fraction of its area inside the outline it belongs to the body
NECK = -125.0  # below the eyes, mm at usual size: between chin and shoulders
SNAP = 0.12  # of an edge: a vertex this near to the outline is on it, so that no slivers are cut
CHIN = -95.0  # below the eyes, mm on an average head: borders of skin above this are those of mouth and eyes
RAISED, NARROWED = 60.0, 54.0  # mm on an average head: how much shorter, and less deep, a bust may become
STEPS = 20  # in which it becomes shorter
CLEARANCE = 1.0  # mm on an average head: how far inside the outline a border may lie
TOUCHES = 0.3  # mm on an average head: a border this near to another one is none
UP = np.array([0.0, 1.0, 0.0])


def cut_bust(mesh: FitMesh, eyes_at: Floats, scale: float) -> tuple[FitMesh, list[str]]:
    """The mesh without its body, and notes on what was left out; the mesh itself where there is none.

    eyes_at : (3,) middle of the eyes, mm; scale : of the head, relative to the shipped one.
    """
    low = float(mesh.vertices[:, 1].min() - eyes_at[1])
    if low > -BODY_BELOW * scale:
        return mesh, []
    outside = _whole_outline(mesh, eyes_at, scale)
    gone = _body_objects(mesh, outside) & ~_necks(mesh, outside, eyes_at[1] + NECK * scale)
    gone &= ~_heads(mesh, outside, gone, eyes_at[1])
    notes = _notes(mesh, gone, -low)
    return _compact(cut(_subset(mesh, _kept_faces(mesh, gone)), outside)), notes


def _whole_outline(mesh: FitMesh, eyes_at: Floats, scale: float) -> Floats:
    """(n,) as :func:`outline`, of a bust so much shorter that no border of skin is within: under clothes, skin is often
    left out, and its ragged border would end the bust. Where no bust is short enough, of the usual one."""
    ragged = _skin_borders(mesh, eyes_at, scale)
    for share in np.linspace(0.0, 1.0, STEPS + 1):
        raised = eyes_at + share * RAISED * scale * UP
        outside: Floats = outline(mesh.vertices, raised, scale) + share * NARROWED * scale
        if (outside[ragged] > -CLEARANCE * scale).all():
            return outside
    return outline(mesh.vertices, eyes_at, scale)


def _skin_borders(mesh: FitMesh, eyes_at: Floats, scale: float) -> Ints:
    """Vertices below the chin where skin, by name, ends, and no other skin goes on."""
    if not len(mesh.piece):
        return np.zeros(0, np.int64)
    own = mesh.faces[_named_skin(mesh)[mesh.piece]]
    a, b = directed_edges(own)
    n = len(mesh.vertices)
    rim = np.unique(a[~np.isin(a * n + b, b * n + a)])
    rim = rim[mesh.vertices[rim, 1] < eyes_at[1] + CHIN * scale]
    beside = cKDTree(mesh.vertices[rim]).query_ball_point(mesh.vertices[rim], TOUCHES * scale, return_length=True)
    alone: Ints = rim[np.asarray(beside) < 2]
    return alone


def outline(points: Floats, eyes_at: Floats, scale: float) -> Floats:
    """(n,) mm that points (n, 3) lie outside the bust's outline; negative inside."""
    off = (points - eyes_at) / scale
    down = np.maximum(BASE - off[:, 1], 0.0) / DOWN
    radius = (down**EXPONENT + (np.abs(off[:, 0]) / ASIDE) ** EXPONENT) ** (1.0 / EXPONENT)
    beyond: Floats = np.where(off[:, 1] < BASE, (radius - 1.0) * DOWN, (np.abs(off[:, 0]) / ASIDE - 1.0) * ASIDE)
    head: Floats = np.where(off[:, 1] > 0.6 * BASE, -ASIDE, beyond)  # hair and ears may be as wide as they are
    return scale * head


def _body_objects(mesh: FitMesh, outside: Floats) -> Bools:
    """(objects,) which objects of the file belong to the body: most of their area is outside; never all of them."""
    if len(mesh.pieces) < 2:
        return np.zeros(len(mesh.pieces), bool)
    areas = face_areas(mesh.vertices, mesh.faces)
    first = mesh.faces[:, 0]
    inside = np.bincount(mesh.piece, areas * (outside[first] < 0), len(mesh.pieces))
    whole = np.bincount(mesh.piece, areas, len(mesh.pieces))
    moving = np.zeros(len(mesh.pieces))  # a body with a face is one object with it
    most = np.abs(mesh.deltas).max(axis=(0, 2)) if len(mesh.deltas) else np.zeros(len(mesh.vertices))
    np.maximum.at(moving, mesh.piece, most[first])
    gone: Bools = (inside < MIN_AREA_INSIDE * whole) & (moving < 1.0)
    return gone if not gone[np.unique(mesh.piece)].all() else np.zeros(len(mesh.pieces), bool)


def _necks(mesh: FitMesh, outside: Floats, height: float) -> Bools:
    """(objects,) which objects are skin, by name, and reach up to a height inside the outline: they hold the neck of a
    head that ends at the chin, and are cut like a body of one piece with its head."""
    return _named_skin(mesh) & (_tops(mesh, outside) > height)


def _heads(mesh: FitMesh, outside: Floats, gone: Bools, height: float) -> Bools:
    """(objects,) which objects hold a head and its body in one: they reach above a height, the eyes', and no word says
    that they are anything but skin. None where another such object is not ``gone``: that one is the head."""
    skin = np.array([kind_of(n).name == SKIN for n in mesh.pieces], bool)
    held: Bools = skin & (_tops(mesh, outside) > height)
    return held if not (held & ~gone).any() else np.zeros(len(held), bool)


def _tops(mesh: FitMesh, outside: Floats) -> Floats:
    """(objects,) how high each object reaches inside the outline, y in mm."""
    first = mesh.faces[:, 0]
    most = np.full(len(mesh.pieces), -np.inf)
    np.maximum.at(most, mesh.piece, np.where(outside[first] < 0, mesh.vertices[first, 1], -np.inf))
    return most


def _named_skin(mesh: FitMesh) -> Bools:
    """(objects,) which objects are skin, by name."""
    return np.array([is_known(n) and kind_of(n).name == SKIN for n in mesh.pieces], bool)


def _kept_faces(mesh: FitMesh, gone: Bools) -> Bools:
    return ~gone[mesh.piece] if len(mesh.pieces) and len(mesh.piece) else np.ones(len(mesh.faces), bool)


def _notes(mesh: FitMesh, gone: Bools, below: float) -> list[str]:
    names = list(dict.fromkeys(n for n, out in zip(mesh.pieces, gone, strict=True) if out))
    left = f"; left out with it: {', '.join(repr(n) for n in names)}" if names else ""
    return [f"a body, {below:.0f} mm below the eyes: the head is cut from it below the neck{left}"]


def cut(mesh: FitMesh, outside: Floats) -> FitMesh:
    """The part of a mesh where a function ``outside`` (n,) of its vertices is negative, cut along its zeros.

    Faces that are cut become triangles; new vertices, their texture coordinates and displacements lie on the edges.
    """
    value = _settled(mesh, outside)
    sides = np.where(mesh.faces >= 0, value[mesh.faces], np.nan)
    beyond: Bools = np.asarray((sides > 0).any(axis=1))
    whole, crossed = ~beyond, beyond & np.asarray((sides < 0).any(axis=1))
    return _joined(mesh, whole, _clipped(mesh, crossed, value)) if crossed.any() else _subset(mesh, whole)


def _settled(mesh: FitMesh, outside: Floats) -> Floats:
    """``outside``, 0 where the zero lies so near to a vertex on one of its edges that a sliver would be cut."""
    value = outside.copy()
    tri = triangles(mesh.faces)
    a, b = tri.ravel(), tri[:, [1, 2, 0]].ravel()
    crossed = outside[a] * outside[b] < 0
    a, b = a[crossed], b[crossed]
    share = outside[a] / (outside[a] - outside[b])
    value[a[share < SNAP]] = 0.0
    value[b[share > 1.0 - SNAP]] = 0.0
    return value


class _Edges:
    """New rows on edges: each is made once, so that neighbours share it."""

    def __init__(self, start: int) -> None:
        self.start = start
        self.made: dict[tuple[int, int, int], int] = {}
        self.rows: list[tuple[int, int, float]] = []

    def at(self, a: int, b: int, share: float, of: int = -1) -> int:
        """The row at ``share`` of the way from row a to row b; texture coordinates are those ``of`` a new vertex."""
        key = (min(a, b), max(a, b), of)
        if key not in self.made:
            self.made[key] = self.start + len(self.rows)
            self.rows.append((a, b, share))
        return self.made[key]

    def mixed(self, rows: Floats) -> Floats:
        """``rows`` (n, k) with the new ones appended."""
        if not self.rows:
            return rows
        a, b, share = (np.array(x) for x in zip(*self.rows, strict=True))
        return np.concatenate([rows, rows[a] + share[:, None] * (rows[b] - rows[a])])


_Clip = tuple[list[list[int]], list[list[int]], list[int], _Edges, _Edges]


def _clipped(mesh: FitMesh, crossed: Bools, value: Floats) -> _Clip:
    """Triangles of the inner parts of crossed faces: vertices, texture coordinates, objects, and new rows of both."""
    points, textures = _Edges(len(mesh.vertices)), _Edges(len(mesh.uv))
    faces: list[list[int]] = []
    face_uv: list[list[int]] = []
    piece: list[int] = []
    for f in np.flatnonzero(crossed):
        count = 4 if mesh.faces[f, 3] >= 0 else 3
        corner = list(zip(mesh.faces[f, :count].tolist(), mesh.face_uv[f, :count].tolist(), strict=True))
        ring = _ring(corner, value, points, textures)
        for k in range(1, len(ring) - 1):
            tri = (ring[0], ring[k], ring[k + 1])
            faces.append([v for v, _ in tri] + [-1])
            face_uv.append([t for _, t in tri] + [-1])
            piece.append(int(mesh.piece[f]) if len(mesh.piece) else 0)
    return faces, face_uv, piece, points, textures


def _ring(
    corner: list[tuple[int, int]], value: Floats, points: _Edges, textures: _Edges
) -> list[tuple[int, int]]:  # fmt: skip
    """Corners of the inner part of one face (Sutherland and Hodgman, 1974)."""
    ring = []
    for (a, ta), (b, tb) in zip(corner, corner[1:] + corner[:1], strict=True):
        if value[a] <= 0:
            ring.append((a, ta))
        if value[a] * value[b] < 0:
            share = float(value[a] / (value[a] - value[b]))
            new = points.at(a, b, share)
            ring.append((new, textures.at(ta, tb, share, new) if ta >= 0 and tb >= 0 else -1))
    return ring


def _joined(mesh: FitMesh, whole: Bools, clip: _Clip) -> FitMesh:
    faces, face_uv, piece, points, textures = clip
    new, new_uv = (np.array(x, np.int64).reshape(-1, 4) for x in (faces, face_uv))
    n = len(mesh.vertices) + len(points.rows)
    flat = mesh.deltas.transpose(1, 0, 2).reshape(len(mesh.vertices), -1)
    deltas = points.mixed(flat).reshape(n, len(mesh.names), 3).transpose(1, 0, 2)
    return replace(
        mesh, vertices=points.mixed(mesh.vertices), deltas=deltas, uv=textures.mixed(mesh.uv),
        faces=np.concatenate([mesh.faces[whole], new]), face_uv=np.concatenate([mesh.face_uv[whole], new_uv]),
        piece=np.concatenate([mesh.piece[whole], np.array(piece, np.int64)]) if len(mesh.piece) else mesh.piece,
    )  # fmt: skip


def _subset(mesh: FitMesh, kept: Bools) -> FitMesh:
    piece: Ints = mesh.piece[kept] if len(mesh.piece) else mesh.piece
    return replace(mesh, faces=mesh.faces[kept], face_uv=mesh.face_uv[kept], piece=piece)


def _compact(mesh: FitMesh) -> FitMesh:
    """The mesh with only the vertices that its faces use."""
    used, faces = renumbered(mesh.faces)
    return replace(mesh, vertices=mesh.vertices[used], faces=faces, deltas=mesh.deltas[:, used])
