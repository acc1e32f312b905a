"""Find holes in a head's skin, and seams between parts that open in a pose.

Border edges that run along another border count as sewn to it. The other border edges form loops. The longest loop of
a sheet of skin is its outer border. Those of the eyes and the mouth may be open, since eyeballs and lips fill them.
Every other loop is a hole. A seam opens where borders that are sewn at rest come apart in a pose.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Bools, Floats, Floats32, Ints
from surface.check.cells import joined_nearer
from surface.check.components import joined
from surface.check.findings import AGAIN, Finding
from surface.check.mouth import Mouth
from surface.check.network import Network
from surface.check.places import Places
from surface.check.raster import View, view_rotation
from surface.check.subject import Subject, pose_of
from surface.head.posing.part import HeadPart
from surface.mesh.mesh import border_edges

SEWN_MM = 0.4  # distance within which two borders are sewn
RIM_MM = 3.0  # between loose ends that are one: a seam ends up to a triangle before the rim that it divides
ALONG_MM = 1.2  # edges with less border than this between them are neighbours, which are never sewn to each other
MIN_WIDTH_MM = 1.2  # least width of a hole: the diameter of a round one, twice the height of a slit
APART_MM = 1.0  # distance between borders sewn at rest from which a seam is open
SHEETS = ("skin", "mouth", "tongue")  # materials of the sheets that have to be closed
MESH_END_MM = 40.0  # wider openings are where the mesh ends, as on a head without scalp under its hair
MIN_VISIBLE = 0.1  # fraction of a hole's area that must be visible from outside: roots of ears are hidden
MIN_FACING_COS = 0.3  # between a hole's outward normal and the direction to a viewer behind the head
CAP_STEPS = 60  # pixels over the cap of a hole
VIEWS = ((0, 0), (60, 0), (-60, 0), (120, 0), (-120, 0), (180, 0), (0, -60), (0, 60))  # yaw and pitch, degrees
MOUTH_RADIUS = 0.75  # of the area that belongs to the mouth, around its middle, in widths of the mouth
EYE_RADIUS = 1.7  # of the area that belongs to an eye, around its centre, in radii of the eyeball


@dataclass(frozen=True)
class Borders:
    """Border edges of all sheets.

    part : (e,) number of the part. ends : (e, 2) vertices of it, where vertices in one place are one. ids : (e, 2) the
        same vertices, numbered over all parts.
    sewn : (e,) whether it is sewn to another edge. mate : (e,) number of that edge, -1 for none.
    network : ways along the edges at rest.
    """

    part: Ints
    ends: Ints
    ids: Ints
    sewn: Bools
    mate: Ints
    network: Network

    def at(self, vertices: list[Floats32]) -> Floats:
        """Return (e, 2, 3): ends of the edges, mm, for the posed vertices (v, 3) of every part."""
        return _edge_ends(self.part, self.ends, vertices)


def _edge_ends(part: Ints, ends: Ints, vertices: list[Floats32]) -> Floats:
    """Return the ends (e, 2, 3) of edges as :meth:`Borders.at` does."""
    out = np.empty((len(part), 2, 3))
    for k in np.unique(part):
        out[part == k] = vertices[k][ends[part == k]]
    return out


def find_borders(subject: Subject) -> Borders:
    """Return all border edges, and which of them are sewn at rest."""
    numbers = [k for k, p in enumerate(subject.parts) if p.material in SHEETS and p.follows == "skin"]
    starts = np.cumsum([0, *(len(v) for v in subject.rest)])
    pairs = [(k, border_edges(_weld(subject, k).astype(np.int32))) for k in numbers]
    part = np.concatenate([np.full(len(e), k) for k, e in pairs] or [np.zeros(0, int)]).astype(np.int64)
    ends = np.concatenate([e for _, e in pairs] or [np.zeros((0, 2), int)]).astype(np.int64)
    ids = ends + starts[part][:, None]
    none = Borders(
        part, ends, ids, np.zeros(len(part), bool), np.full(len(part), -1), Network(ids, np.zeros(len(part)))
    )
    at = none.at(subject.rest)
    network = Network(ids, np.linalg.norm(at[:, 1] - at[:, 0], axis=1))
    reach, along = SEWN_MM * subject.scale, ALONG_MM * subject.scale
    _, mate = network.nearest(at, np.arange(len(part)), reach, along)
    return Borders(part, ends, ids, mate >= 0, mate, network)


def _weld(subject: Subject, number: int) -> Ints:
    """Return (t, 3): triangles of a part, where vertices in one place are one; triangles without area are dropped."""
    at, triangles = subject.rest[number], subject.parts[number].triangles
    _, first, same = np.unique(np.round(at / (1e-3 * subject.scale)), axis=0, return_index=True, return_inverse=True)
    corner = first[same.ravel()][triangles]
    whole = (corner != np.roll(corner, 1, axis=1)).all(axis=1)
    kept: Ints = corner[whole]
    return kept


def holes(subject: Subject, mouth: Mouth | None, places: Places, borders: Borders) -> Iterator[Finding]:
    """Find holes at rest, and seams that open in a pose.

    A very wide hole is where the skin of a mesh ends, as under hair. It is a warning, and so are the holes in smaller
    parts of such a head, such as the roots of its ears.
    """
    at = borders.at(subject.rest)
    found = []
    for loop in _find_loops(subject, borders):
        (middle, width), part = _measure_loop(at[loop]), subject.parts[borders.part[loop[0]]]
        wide = width >= MIN_WIDTH_MM * subject.scale and not _in_openings(subject, mouth, middle[None])[0]
        if wide and is_seen(subject, part, at[loop]):
            length = float(np.linalg.norm(at[loop, 1] - at[loop, 0], axis=1).sum())
            text = f"a hole in part {part.name!r}, {length:.0f} mm around: {places.name(middle)}"
            found.append((text, width > MESH_END_MM * subject.scale, part is subject.parts[subject.skin[0]]))
    ends = any(large for _, large, _ in found)
    for text, large, main in found:
        yield Finding("hole", text, f"close it in the mesh, then {AGAIN}", warning=large or (ends and not main))
    yield from _opening_seams(subject, mouth, borders, places)


def _opening_seams(subject: Subject, mouth: Mouth | None, borders: Borders, places: Places) -> Iterator[Finding]:
    """Find the seam that opens furthest, with the pose in which it does."""
    worst, where, pose = 0.0, np.zeros(3), ""
    reach, along = 4.0 * APART_MM * subject.scale, ALONG_MM * subject.scale
    rest = borders.at(subject.rest).mean(axis=1)
    sewn = np.flatnonzero(borders.sewn & ~_in_openings(subject, mouth, rest))
    for name in subject.claimed:
        at = borders.at(subject.posed(pose_of(name)))
        middle = at.mean(axis=1)
        way = middle - rest  # an edge that moves as the edge does that it is sewn to stays sewn
        loose = np.linalg.norm(way - way[borders.mate], axis=1)[sewn] > 0.3 * APART_MM * subject.scale
        asked = sewn[loose]
        distance, _ = borders.network.nearest(at, asked, reach, along)
        apart = np.minimum(distance, reach)
        if len(apart) and apart.max() > worst:
            worst, where, pose = float(apart.max()), rest[asked[apart.argmax()]], name
    if worst > APART_MM * subject.scale:
        wide = f"{worst:.1f} mm" + (" or more" if worst >= reach else "")
        text = f"with {pose} = 1 a seam opens by {wide}: {places.name(where)}"
        yield Finding("hole", text, AGAIN)


def _find_loops(subject: Subject, borders: Borders) -> Iterator[Ints]:
    """Return edges of every chain that is sewn to nothing, without the outer border of each sheet."""
    free, at = np.flatnonzero(~borders.sewn), borders.at(subject.rest)
    ends = _join_ends(borders, at, free, SEWN_MM * subject.scale)
    chains = _find_chains(_join_loose(ends, at[free].reshape(-1, 3), RIM_MM * subject.scale))
    sheet = _find_sheets(subject, borders)
    lengths = np.linalg.norm(at[:, 1] - at[:, 0], axis=1)
    rows = [free[c] for c in chains]
    outer: dict[int, tuple[float, int]] = {}
    for k, row in enumerate(rows):
        key = int(sheet[borders.ids[row[0], 0]])
        outer[key] = max(outer.get(key, (0.0, -1)), (float(lengths[row].sum()), k))
    longest = {k for _, k in outer.values()}
    yield from (row for k, row in enumerate(rows) if k not in longest)


def _join_ends(borders: Borders, at: Floats, rows: Ints, reach: float) -> Ints:
    """Return (k, 2): ends of the edges ``rows (k,)``; ends nearer than ``reach`` mm to each other, as at a seam, are
    one."""
    ends, points = borders.ids[rows], at[rows].reshape(-1, 3)
    known = np.unique(ends, return_inverse=True)[1].reshape(-1)
    return joined_nearer(points, known, reach).reshape(-1, 2)


def _join_loose(ends: Ints, points: Floats, reach: float) -> Ints:
    """Return ``ends (k, 2)`` of edges at ``points (2 k, 3)``, where those that no other edge goes on from are one if
    they are nearer than ``reach`` mm to each other."""
    flat = ends.ravel()
    loose = np.flatnonzero(np.bincount(flat)[flat] % 2 == 1)
    near = joined_nearer(points[loose], np.unique(flat[loose], return_inverse=True)[1].reshape(-1), reach)
    same = np.arange(flat.max(initial=-1) + 1)
    same[flat[loose]] = flat[loose][near]
    return same[ends]


def _find_chains(ids: Ints) -> list[Ints]:
    """Return rows of edges (e, 2) of each connected component."""
    label = joined(int(ids.max(initial=-1)) + 1, *np.ascontiguousarray(ids.T))
    own = label[ids[:, 0]] if len(ids) else np.zeros(0, np.int64)
    return [np.flatnonzero(own == k) for k in np.unique(own)]


def _find_sheets(subject: Subject, borders: Borders) -> Ints:
    """Return (v,): number of the sheet that each vertex belongs to; triangles and seams connect the vertices of a
    sheet."""
    starts = np.cumsum([0, *(len(v) for v in subject.rest)])
    links = [_weld(subject, k)[:, [0, 1, 1, 2]].reshape(-1, 2) + starts[k] for k in np.unique(borders.part)]
    sewn = np.flatnonzero(borders.sewn)
    links.append(np.column_stack([borders.ids[sewn, 0], borders.ids[borders.mate[sewn], 0]]))
    label: Ints = joined(int(starts[-1]), *np.ascontiguousarray(np.concatenate(links).T))
    return label


def _measure_loop(ends: Floats) -> tuple[Floats, float]:
    """Return the middle (3,) and width of a loop, mm. The width is four times the area divided by the length: the
    diameter of a circle, and twice the height of a slit."""
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
        turn = view_rotation(yaw, pitch)
        faces = float(turn[2] @ out.sum(axis=0)) > MIN_FACING_COS * 2.0 * area
        if abs(yaw) > 90 and not (faces and part.material == "skin"):
            continue
        (x0, y0, _), (x1, y1, _) = (f(cap @ turn.T, axis=0).tolist() for f in (np.min, np.max))
        step = max(x1 - x0, y1 - y0, 1e-3) / CAP_STEPS
        picture = View((x0, x1), (y0, y1), step, turn).draw(shapes)
        if (picture.parts == len(shapes) - 1).sum() * step**2 > MIN_VISIBLE * area:
            return True
    return False


def _in_openings(subject: Subject, mouth: Mouth | None, at: Floats) -> Bools:
    """Return (m,): which of the places (m, 3) belong to the rim of the mouth, or of an eye that has an eyeball."""
    out = np.zeros(len(at), bool)
    if subject.eyes is not None:
        for side in (n for n in (0, 1) if subject.eye(n) is not None):
            out |= np.linalg.norm(at - subject.eyes[side], axis=1) < EYE_RADIUS * subject.head.data.eye_radius
    if mouth is not None:
        out |= np.linalg.norm(at - mouth.middle, axis=1) < MOUTH_RADIUS * mouth.width
    return out
