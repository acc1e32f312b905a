"""Find holes in a head's skin, and seams between parts that open in a pose.

Border edges that run along another border count as sewn to it. The other border edges form loops. The longest loop of
a sheet of skin is its outer border. Those of the eyes and the mouth may be open, since eyeballs and lips fill them.
Every other loop is a hole. A seam opens where borders that are sewn at rest come apart in a pose.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from surface.base.arrays import Bools, Floats, Floats32, Ints
from surface.base.jit import kernel
from surface.check.findings import AGAIN, Finding
from surface.check.mouth import Mouth
from surface.check.places import Places
from surface.check.raster import View, turned
from surface.check.subject import Subject, pose_of
from surface.head.posing.part import HeadPart
from surface.mesh.mesh import border_edges

SEWN_MM = 0.4  # distance within which two borders are sewn
ALONG_MM = 1.2  # edges with less border than this between them are neighbours, and not sewn to each other
WIDE_MM = 1.2  # least width of a hole: the diameter of a round one, twice the height of a slit
APART_MM = 1.0  # distance between borders sewn at rest from which a seam is open
SHEETS = ("skin", "mouth", "tongue")  # materials of the sheets that have to be closed
END_MM = 40.0  # wider openings are where the mesh ends, as on a head without scalp under its hair
SEEN = 0.1  # least share of a hole's area that is visible from outside: the root of an ear lies under other skin
FACING = 0.3  # least cosine between a hole's outward normal and a viewer behind the head for it to face that viewer
_ROWS = 512  # rows of the matrix of distances that are computed at once
CAP_STEPS = 60  # pixels over the cap of a hole
VIEWS = ((0, 0), (60, 0), (-60, 0), (120, 0), (-120, 0), (180, 0), (0, -60), (0, 60))  # yaw and pitch, degrees
MOUTH_REACH = 0.75  # in widths of the mouth, from its middle
EYE_REACH = 1.7  # in radii: a loop whose middle is so near to an eye's centre is its opening


@kernel
def _nearest(
    middles: Any, own: Any, ends: Any, ids: Any, first: Any, beside: Any, reach: float, distance: Any, other: Any
) -> None:
    """Find the nearest edge for the middle of each of q edges.

    middles, own : (q, 3) middles of the q edges, and (q, 2) their vertices.
    ends, ids : (e, 2, 3) ends of the edges that are searched, and (e, 2) their vertices. Those that share a vertex with
        edge i are left out, and so are those of ``beside`` from ``first[i]`` to ``first[i + 1]``.
    distance, other : (q,) filled with distance and number of the nearest edge; infinite and -1 beyond ``reach``.
    """
    for i in range(len(middles)):
        best, found = reach * reach, -1
        p0, p1, p2 = middles[i, 0], middles[i, 1], middles[i, 2]
        for j in range(len(ends)):
            a, b = ends[j, 0], ends[j, 1]
            if min(a[0], b[0]) - p0 > reach or p0 - max(a[0], b[0]) > reach:
                continue
            if min(a[1], b[1]) - p1 > reach or p1 - max(a[1], b[1]) > reach:
                continue
            if ids[j, 0] == own[i, 0] or ids[j, 0] == own[i, 1] or ids[j, 1] == own[i, 0] or ids[j, 1] == own[i, 1]:
                continue
            near = False
            for k in range(first[i], first[i + 1]):
                near |= beside[k] == j
            if near:
                continue
            d0, d1, d2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
            length = d0 * d0 + d1 * d1 + d2 * d2
            t = 0.0
            if length > 0.0:
                t = ((p0 - a[0]) * d0 + (p1 - a[1]) * d1 + (p2 - a[2]) * d2) / length
                t = min(1.0, max(0.0, t))
            w0, w1, w2 = a[0] + t * d0 - p0, a[1] + t * d1 - p1, a[2] + t * d2 - p2
            square = w0 * w0 + w1 * w1 + w2 * w2
            if square < best:
                best, found = square, j
        distance[i], other[i] = np.sqrt(best) if found >= 0 else np.inf, found


@dataclass(frozen=True)
class Borders:
    """Border edges of all sheets.

    part : (e,) number of the part. ends : (e, 2) vertices of it, where vertices in one place are one. ids : (e, 2) the
        same vertices, numbered over all parts.
    sewn : (e,) whether it is sewn to another edge. mate : (e,) number of that edge, -1 for none.
    first, beside : (e + 1,) and (k,); the neighbours of edge i along its border are ``beside`` from ``first[i]`` to
        ``first[i + 1]``.
    """

    part: Ints
    ends: Ints
    ids: Ints
    sewn: Bools
    mate: Ints
    first: Ints
    beside: Ints

    def neighbours(self, rows: Ints) -> tuple[Ints, Ints]:
        """``first (k + 1,)`` and ``beside`` of only the edges ``rows (k,)``."""
        count = np.diff(self.first)[rows]
        first = np.append(0, np.cumsum(count))
        return first, self.beside[np.repeat(self.first[rows] - first[:-1], count) + np.arange(first[-1])]

    def at(self, vertices: list[Floats32]) -> Floats:
        """(e, 2, 3) ends of the edges, mm, for the posed vertices (v, 3) of every part."""
        out = np.empty((len(self.part), 2, 3))
        for k in np.unique(self.part):
            out[self.part == k] = vertices[k][self.ends[self.part == k]]
        return out


def find_borders(subject: Subject) -> Borders:
    """All border edges, and which of them are sewn at rest."""
    numbers = [k for k, p in enumerate(subject.parts) if p.material in SHEETS and p.follows == "skin"]
    starts = np.cumsum([0, *(len(v) for v in subject.rest)])
    pairs = [(k, border_edges(_welded(subject, k).astype(np.int32))) for k in numbers]
    part = np.concatenate([np.full(len(e), k) for k, e in pairs] or [np.zeros(0, int)]).astype(np.int64)
    ends = np.concatenate([e for _, e in pairs] or [np.zeros((0, 2), int)]).astype(np.int64)
    ids = ends + starts[part][:, None]
    found = Borders(part, ends, ids, np.zeros(len(part), bool), np.full(len(part), -1), *_none(len(part)))
    at = found.at(subject.rest)
    first, beside = _beside(ids, np.linalg.norm(at[:, 1] - at[:, 0], axis=1), ALONG_MM * subject.scale)
    distance, mate = np.full(len(part), np.inf), np.full(len(part), -1, np.int64)
    _nearest(at.mean(axis=1), ids, at, ids, first, beside, SEWN_MM * subject.scale, distance, mate)
    return Borders(part, ends, ids, mate >= 0, mate, first, beside)


def _none(edges: int) -> tuple[Ints, Ints]:
    """``first`` and ``beside`` of edges without neighbours."""
    return np.zeros(edges + 1, np.int64), np.zeros(0, np.int64)


def _beside(ids: Ints, length: Floats, reach: float) -> tuple[Ints, Ints]:
    """``first (e + 1,)`` and ``beside (k,)`` of edges between vertices ``ids (e, 2)``, of ``length (e,)`` mm.

    Neighbours are edges with less than ``reach`` mm of border between them. Without them a border of very short edges
    would be sewn to itself, since it is near itself everywhere.
    """
    names, ends = np.unique(ids, return_inverse=True)
    ends = np.ascontiguousarray(ends.reshape(-1, 2), np.int64)
    order = np.argsort(ends.ravel(), kind="stable")
    start = np.searchsorted(ends.ravel()[order], np.arange(len(names) + 1)).astype(np.int64)
    edge, far = order // 2, ends[:, ::-1].ravel()[order]
    first, long = np.zeros(len(ends) + 1, np.int64), np.asarray(length, np.float64)
    count = _near_along(start, edge, far, ends, long, reach, first, np.zeros(0, np.int64))
    beside = np.zeros(count, np.int64)
    _near_along(start, edge, far, ends, long, reach, first, beside)
    return first, beside


@kernel
def _ways(
    ends: Any, start: Any, edge: Any, far: Any, length: Any, reach: float,
    way: Any, waits: Any, queue: Any, reached: Any,
) -> int:  # fmt: skip
    """Write to ``way (v,)``, infinite before, the lengths of the shortest ways below ``reach`` from two vertices
    ``ends (2,)``, and to ``reached`` the vertices that have one; returns how many. Others as in :func:`_near_along`.

    Ways are corrected from a queue until nothing changes (Moore's algorithm).
    """
    head, size, found = 0, 2, 2
    for side in range(2):
        way[ends[side]], waits[ends[side]], queue[side], reached[side] = 0.0, True, ends[side], ends[side]
    while size > 0:
        v = queue[head]
        head, size, waits[v] = (head + 1) % len(queue), size - 1, False
        for k in range(start[v], start[v + 1]):
            w, along = far[k], way[v] + length[edge[k]]
            if along < reach and along < way[w]:
                if way[w] == np.inf:
                    reached[found], found = w, found + 1
                way[w] = along
                if not waits[w]:
                    queue[(head + size) % len(queue)], waits[w], size = w, True, size + 1
    return found


@kernel
def _near_along(
    start: Any, edge: Any, far: Any, ends: Any, length: Any, reach: float, first: Any, beside: Any
) -> int:  # fmt: skip
    """Write to ``beside``, as far as there is room, for each edge between vertices ``ends (e, 2)`` those to which a way
    along edges of ``length (e,)`` is shorter than ``reach``, without those that share a vertex with it; of edge i they
    begin at ``first[i]``. Vertex v has the edges ``edge[start[v]]`` to ``edge[start[v + 1]]``, which end at ``far``.
    Returns how many there are."""
    count, total = len(start) - 1, 0
    way, waits = np.full(count, np.inf), np.zeros(count, np.bool_)
    queue, reached, noted = np.zeros(count, np.int64), np.zeros(count, np.int64), np.full(len(ends), -1)
    for i in range(len(ends)):
        first[i] = total
        a, b = ends[i]
        for v in reached[: _ways(ends[i], start, edge, far, length, reach, way, waits, queue, reached)]:
            way[v] = np.inf
            for j in edge[start[v] : start[v + 1]]:
                joined = ends[j, 0] == a or ends[j, 0] == b or ends[j, 1] == a or ends[j, 1] == b
                if noted[j] != i and not joined:
                    noted[j] = i
                    if total < len(beside):
                        beside[total] = j
                    total += 1
        if total <= len(beside):
            beside[first[i] : total].sort()
    first[len(ends)] = total
    return total


def _welded(subject: Subject, number: int) -> Ints:
    """(t, 3) triangles of a part, where vertices in one place are one; triangles without area are dropped."""
    at, triangles = subject.rest[number], subject.parts[number].triangles
    _, first, same = np.unique(np.round(at / (1e-3 * subject.scale)), axis=0, return_index=True, return_inverse=True)
    corner = first[same.ravel()][triangles]
    whole = (corner != np.roll(corner, 1, axis=1)).all(axis=1)
    kept: Ints = corner[whole]
    return kept


def holes(subject: Subject, mouth: Mouth | None, places: Places, borders: Borders) -> Iterator[Finding]:
    """Holes at rest, and seams that open in a pose.

    A very wide hole is where the skin of a mesh ends, as under hair. It is a warning, and so are the holes in smaller
    parts of such a head, such as the roots of its ears.
    """
    at = borders.at(subject.rest)
    found = []
    for loop in _loops(subject, borders):
        (middle, width), part = _form(at[loop]), subject.parts[borders.part[loop[0]]]
        wide = width >= WIDE_MM * subject.scale and not _in_openings(subject, mouth, middle[None])[0]
        if wide and is_seen(subject, part, at[loop]):
            length = float(np.linalg.norm(at[loop, 1] - at[loop, 0], axis=1).sum())
            text = f"a hole in part {part.name!r}, {length:.0f} mm around: {places.name(middle)}"
            found.append((text, width > END_MM * subject.scale, part is subject.parts[subject.skin[0]]))
    ends = any(large for _, large, _ in found)
    for text, large, main in found:
        yield Finding("hole", text, f"close it in the mesh, then {AGAIN}", warning=large or (ends and not main))
    yield from _opening_seams(subject, mouth, borders, places)


def _opening_seams(subject: Subject, mouth: Mouth | None, borders: Borders, places: Places) -> Iterator[Finding]:
    """The seam that opens furthest, with the pose in which it does."""
    worst, where, pose = 0.0, np.zeros(3), ""
    reach = 4.0 * APART_MM * subject.scale
    rest = borders.at(subject.rest).mean(axis=1)
    sewn = np.flatnonzero(borders.sewn & ~_in_openings(subject, mouth, rest))
    for name in subject.claimed:
        at = borders.at(subject.posed(pose_of(name)))
        middle = at.mean(axis=1)
        way = middle - rest  # an edge that moves as the edge does that it is sewn to stays sewn
        loose = np.linalg.norm(way - way[borders.mate], axis=1)[sewn] > 0.3 * APART_MM * subject.scale
        asked = sewn[loose]
        distance, mate = np.full(len(asked), np.inf), np.full(len(asked), -1, np.int64)
        _nearest(middle[asked], borders.ids[asked], at, borders.ids, *borders.neighbours(asked), reach, distance, mate)
        apart = np.minimum(distance, reach)
        if len(apart) and apart.max() > worst:
            worst, where, pose = float(apart.max()), rest[asked[apart.argmax()]], name
    if worst > APART_MM * subject.scale:
        wide = f"{worst:.1f} mm" + (" or more" if worst >= reach else "")
        text = f"with {pose} = 1 a seam opens by {wide}: {places.name(where)}"
        yield Finding("hole", text, AGAIN)


def _loops(subject: Subject, borders: Borders) -> Iterator[Ints]:
    """Edges of every chain that is sewn to nothing, without the outer border of each sheet."""
    free, at = np.flatnonzero(~borders.sewn), borders.at(subject.rest)
    chains = _chains(_joined(borders, at, free, SEWN_MM * subject.scale))
    sheet = _sheets(subject, borders)
    lengths = np.linalg.norm(at[:, 1] - at[:, 0], axis=1)
    rows = [free[c] for c in chains]
    outer: dict[int, tuple[float, int]] = {}
    for k, row in enumerate(rows):
        key = int(sheet[borders.ids[row[0], 0]])
        outer[key] = max(outer.get(key, (0.0, -1)), (float(lengths[row].sum()), k))
    longest = {k for _, k in outer.values()}
    yield from (row for k, row in enumerate(rows) if k not in longest)


def _joined(borders: Borders, at: Floats, rows: Ints, reach: float) -> Ints:
    """(k, 2) ends of the edges ``rows (k,)``; ends nearer than ``reach`` mm to each other, as at a seam, are one."""
    ends, points = borders.ids[rows], at[rows].reshape(-1, 3)
    known = np.unique(ends, return_inverse=True)[1].reshape(-1)
    square = (points**2).sum(axis=1)
    pairs = [np.zeros((0, 2), np.int64)]
    for first in range(0, len(points), _ROWS):
        own = slice(first, first + _ROWS)
        near = square[own, None] + square - 2.0 * points[own] @ points.T < reach**2
        pairs.append(np.argwhere(near) + np.array([first, 0]))
    links = known[np.concatenate(pairs)]
    return _components(links, int(known.max(initial=-1)) + 1)[known].reshape(-1, 2)


def _chains(ids: Ints) -> list[Ints]:
    """Rows of edges (e, 2) of each connected component."""
    label = _components(ids, int(ids.max(initial=-1)) + 1)
    own = label[ids[:, 0]] if len(ids) else np.zeros(0, np.int64)
    return [np.flatnonzero(own == k) for k in np.unique(own)]


def _sheets(subject: Subject, borders: Borders) -> Ints:
    """(v,) number of the sheet that each vertex belongs to; triangles and seams connect the vertices of a sheet."""
    starts = np.cumsum([0, *(len(v) for v in subject.rest)])
    links = [_welded(subject, k)[:, [0, 1, 1, 2]].reshape(-1, 2) + starts[k] for k in np.unique(borders.part)]
    sewn = np.flatnonzero(borders.sewn)
    links.append(np.column_stack([borders.ids[sewn, 0], borders.ids[borders.mate[sewn], 0]]))
    return _components(np.concatenate(links), int(starts[-1]))


def _components(links: Ints, count: int) -> Ints:
    """(count,) for each node the least number in its connected component; ``links (k, 2)`` connect nodes."""
    label = np.arange(count)
    while len(links):
        least = np.minimum(label[links[:, 0]], label[links[:, 1]])
        fresh = label.copy()
        for end in (0, 1):
            np.minimum.at(fresh, links[:, end], least)
            np.minimum.at(fresh, label[links[:, end]], least)
        fresh = fresh[fresh]
        if np.array_equal(fresh, label):
            break
        label = fresh
    return label


def _form(ends: Floats) -> tuple[Floats, float]:
    """Middle (3,) and width of a loop, mm. The width is four times the area divided by the length: the diameter of a
    circle, and twice the height of a slit."""
    middle = ends.reshape(-1, 3).mean(axis=0)
    area = 0.5 * np.linalg.norm(np.cross(ends[:, 0] - middle, ends[:, 1] - middle).sum(axis=0))
    return middle, float(4.0 * area / max(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum(), 1e-9))


def is_seen(subject: Subject, part: HeadPart, ends: Floats) -> bool:
    """Whether a cap over a loop of a part's border, edges (e, 2, 3), is visible from outside.

    Seen from behind, only holes in skin that face the viewer count, because heads without a scalp and masks show the
    inside of all their parts there.
    """
    middle = ends.reshape(-1, 3).mean(axis=0)
    cap = np.concatenate([ends.reshape(-1, 3), middle[None]]).astype(np.float32)
    rows = np.arange(len(ends), dtype=np.int32)
    triangles = np.column_stack([2 * rows, 2 * rows + 1, np.full_like(rows, 2 * len(ends))])
    shapes = [*subject.shapes(subject.rest), (cap, triangles)]
    out = -np.cross(ends[:, 0] - middle, ends[:, 1] - middle)  # triangles have a hole on their right
    area = 0.5 * float(np.linalg.norm(out, axis=1).sum())
    for yaw, pitch in VIEWS:
        turn = turned(yaw, pitch)
        faces = float(turn[2] @ out.sum(axis=0)) > FACING * 2.0 * area
        if abs(yaw) > 90 and not (faces and part.material == "skin"):
            continue
        (x0, y0, _), (x1, y1, _) = (f(cap @ turn.T, axis=0).tolist() for f in (np.min, np.max))
        step = max(x1 - x0, y1 - y0, 1e-3) / CAP_STEPS
        picture = View((x0, x1), (y0, y1), step, turn).draw(shapes)
        if (picture.parts == len(shapes) - 1).sum() * step**2 > SEEN * area:
            return True
    return False


def _in_openings(subject: Subject, mouth: Mouth | None, at: Floats) -> Bools:
    """(m,) which of the places (m, 3) belong to the rim of the mouth, or of an eye that has an eyeball."""
    out = np.zeros(len(at), bool)
    if subject.eyes is not None:
        for side in (n for n in (0, 1) if subject.eye(n) is not None):
            out |= np.linalg.norm(at - subject.eyes[side], axis=1) < EYE_REACH * subject.head.data.eye_radius
    if mouth is not None:
        out |= np.linalg.norm(at - mouth.middle, axis=1) < MOUTH_REACH * mouth.width
    return out
