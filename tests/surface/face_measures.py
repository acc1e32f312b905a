"""Measures of a posed head: openings, cuts and crossings, in millimetres."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from surface.base.jit import kernel
from surface.fit.points.eyeball import CORNEA, IRIS
from surface.head import Head
from surface.head.posing.part import border_edges

LEAST_MM = 0.15  # shallower crossings are not looked for
ROUND_MM = 4.0  # radius of lips and lids: two that cross by d do so over sqrt(2 r d) on either side
EDGE = 1e-6  # of a triangle: so near to an edge lies on it
LEAN = 0.5  # of a point's ways out, beside its normal: at a fold one of them may slip through
FAR_MM = 6.0  # beyond that a point behind a sheet belongs to something else


@kernel
def draw_depth(points, triangles, way, u0, v0, step, depth, back):
    """Z-buffer of triangles (t, 3) of points (m, 3): ``depth (h, w)`` keeps the largest z, row 0 is the lowest y, and
    ``back (h, w)`` is True where what is nearest shows its inside. ``way`` is 1 where triangles run counter-clockwise
    seen from outside, -1 where clockwise, 0 where it does not matter."""
    h, w = depth.shape
    for t in range(triangles.shape[0]):
        a, b, c = points[triangles[t, 0]], points[triangles[t, 1]], points[triangles[t, 2]]
        x0, x1 = (min(a[0], b[0], c[0]) - u0) / step, (max(a[0], b[0], c[0]) - u0) / step
        y0, y1 = (min(a[1], b[1], c[1]) - v0) / step, (max(a[1], b[1], c[1]) - v0) / step
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if x1 < 0 or y1 < 0 or x0 > w - 1 or y0 > h - 1 or abs(area) < 1e-12:
            continue
        for j in range(max(0, int(np.ceil(y0))), min(h - 1, int(np.floor(y1))) + 1):
            for i in range(max(0, int(np.ceil(x0))), min(w - 1, int(np.floor(x1))) + 1):
                x, y = u0 + i * step, v0 + j * step
                p = ((b[0] - x) * (c[1] - y) - (b[1] - y) * (c[0] - x)) / area
                q = ((c[0] - x) * (a[1] - y) - (c[1] - y) * (a[0] - x)) / area
                z = p * a[2] + q * b[2] + (1.0 - p - q) * c[2]
                if p >= 0 and q >= 0 and p + q <= 1 and z > depth[j, i]:
                    depth[j, i], back[j, i] = z, area * way < 0


@dataclass(frozen=True)
class Window:
    """A rectangle of the picture plane seen from ``turn (3, 3)``: x and y from, to; step, mm."""

    x: tuple[float, float]
    y: tuple[float, float]
    step: float = 0.25
    turn: np.ndarray = None  # type: ignore[assignment]

    def depth(self, *parts) -> np.ndarray:
        """(h, w) the nearest z of parts, -inf where there is none."""
        shape = tuple(int((b - a) / self.step) + 1 for a, b in (self.y, self.x))
        out, back = np.full(shape, -np.inf), np.zeros(shape, bool)
        for p in parts:
            points = p.vertices.astype(float)
            points = points if self.turn is None else points @ self.turn.T
            draw_depth(points, p.triangles, 0.0, self.x[0], self.y[0], self.step, out, back)
        return out


def rim(part, loop: np.ndarray) -> np.ndarray:
    """Ids of the part's border vertices on a loop in (u, v), in its order."""
    ids = np.unique(border_edges(part.mesh.triangles))
    steps = np.concatenate([loop, loop[:1]])
    fine = np.concatenate([a + np.linspace(0, 1, 16, endpoint=False)[:, None] * (b - a)
                           for a, b in pairwise(steps)])  # fmt: skip
    distance, at = cKDTree(fine).query(part.mesh.uv[ids])
    near = distance < 2e-3
    return ids[near][np.argsort(at[near])]


@kernel
def way_out(points, directions, corners, normals, far, out):
    """Where rays first meet triangles ``corners (t, 3, 3)`` within ``far``: ``out`` is the distance if that is from
    behind (outward ``normals (t, 3)`` along the ray), and 0 if from the front or not at all."""
    for k in range(len(points)):
        best, behind = far, False
        p, d = points[k], directions[k]
        for t in range(len(corners)):
            a = corners[t, 0]
            e, f, s = corners[t, 1] - a, corners[t, 2] - a, p - a
            h0, h1, h2 = d[1] * f[2] - d[2] * f[1], d[2] * f[0] - d[0] * f[2], d[0] * f[1] - d[1] * f[0]
            det = e[0] * h0 + e[1] * h1 + e[2] * h2
            if abs(det) < 1e-12:
                continue
            u = (s[0] * h0 + s[1] * h1 + s[2] * h2) / det
            if u < 0.0 or u > 1.0:
                continue
            q0, q1, q2 = s[1] * e[2] - s[2] * e[1], s[2] * e[0] - s[0] * e[2], s[0] * e[1] - s[1] * e[0]
            v = (d[0] * q0 + d[1] * q1 + d[2] * q2) / det
            along = (f[0] * q0 + f[1] * q1 + f[2] * q2) / det
            if v >= 0.0 and u + v <= 1.0 and 1e-3 < along < best:
                best, behind = along, normals[t, 0] * d[0] + normals[t, 1] * d[1] + normals[t, 2] * d[2] > 0.0
        out[k] = best if behind else 0.0


@kernel
def near_triangle(points, corners, normals, cut, lists, first, signed):
    """Distance ``signed (m,)`` of points (m, 3) from the nearest of triangles ``corners (t, 3, 3)``, below 0 behind it.

    Those of ``lists`` from ``first[k]`` to ``first[k + 1]`` are looked at for point k; ``normals (t, 3, 3)`` stand at
    the corners. Beyond an edge where the sheet is cut off, ``cut (t, 3)``, nothing is behind it. The
    nearest place by its region, as in Ericson, Real-Time Collision Detection (2005), 5.1.5.
    """
    for k in range(len(points)):
        best, p = np.inf, points[k]
        for t in lists[first[k] : first[k + 1]]:
            a, b, c = corners[t, 0], corners[t, 1], corners[t, 2]
            ab, ac = b - a, c - a
            d1, d2 = (ab * (p - a)).sum(), (ac * (p - a)).sum()
            d3, d4 = (ab * (p - b)).sum(), (ac * (p - b)).sum()
            d5, d6 = (ab * (p - c)).sum(), (ac * (p - c)).sum()
            va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
            if d1 <= 0 and d2 <= 0:
                v, w = 0.0, 0.0
            elif d3 >= 0 and d4 <= d3:
                v, w = 1.0, 0.0
            elif d6 >= 0 and d5 <= d6:
                v, w = 0.0, 1.0
            elif vc <= 0 and d1 >= 0 and d3 <= 0:
                v, w = d1 / (d1 - d3), 0.0
            elif vb <= 0 and d2 >= 0 and d6 <= 0:
                v, w = 0.0, d2 / (d2 - d6)
            elif va <= 0 and d4 >= d3 and d5 >= d6:
                w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
                v = 1.0 - w
            else:
                v, w = vb / (va + vb + vc), vc / (va + vb + vc)
            away = p - a - v * ab - w * ac
            if (away * away).sum() < best:
                best = (away * away).sum()
                facing = (away * ((1.0 - v - w) * normals[t, 0] + v * normals[t, 1] + w * normals[t, 2])).sum()
                beyond = (cut[t, 0] and w < EDGE) or (cut[t, 1] and v + w > 1 - EDGE) or (cut[t, 2] and v < EDGE)
                signed[k] = np.sqrt(best) if facing >= 0 or beyond else -np.sqrt(best)


def any_pierce(starts: np.ndarray, ends: np.ndarray, corners: np.ndarray) -> bool:
    """Does any edge from ``starts (e, 3)`` to ``ends`` go through any of triangles ``corners (t, 3, 3)``?"""
    way, s = (ends - starts)[:, None], starts[:, None] - corners[None, :, 0]
    e, f = ((corners[:, k] - corners[:, 0])[None] for k in (1, 2))
    h, q = np.cross(way, f), np.cross(s, e)
    det = (e * h).sum(axis=2)
    det[np.abs(det) < 1e-12] = np.inf
    u, v, along = (s * h).sum(axis=2) / det, (way * q).sum(axis=2) / det, (f * q).sum(axis=2) / det
    return bool(((u >= 0) & (v >= 0) & (u + v <= 1) & (along > 0) & (along <= 1)).any())


@dataclass(frozen=True)
class Sheet:
    """One side of an opening: (part, ids of vertices, rows of triangles, which way they run) for each part it reaches
    over. Normals are those of the triangles: a surface's own turn over in the folds of a pressed lip."""

    pieces: list

    def points(self) -> np.ndarray:
        return np.concatenate([p.vertices[i] for p, i, _, _ in self.pieces]).astype(float)

    def normals(self) -> np.ndarray:
        """(n, 3) outward, at the points."""
        tree = cKDTree(self.corners()[0].reshape(-1, 3))
        return self.corner_normals().reshape(-1, 3)[tree.query(self.points())[1]]

    def corner_normals(self) -> np.ndarray:
        """(t, 3, 3) the sum of what meets at each corner, whichever part it belongs to."""
        at, flat = self.corners()
        _, place = np.unique(np.round(at.reshape(-1, 3), 3), axis=0, return_inverse=True)
        total = np.zeros((place.max() + 1, 3))
        np.add.at(total, place.ravel(), np.repeat(flat, 3, axis=0))
        return total[place.ravel()].reshape(at.shape)

    def cut(self) -> np.ndarray:
        """(t, 3) which edges, from corner k to the next, no other triangle of the sheet has."""
        at, _ = self.corners()
        _, place = np.unique(np.round(at.reshape(-1, 3), 3), axis=0, return_inverse=True)
        ends = place.reshape(-1, 3)
        pairs = np.sort(np.stack([ends, np.roll(ends, -1, axis=1)], axis=2), axis=2).reshape(-1, 2)
        _, edge, count = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
        return (count[edge.ravel()] == 1).reshape(-1, 3)

    def edges(self) -> tuple[np.ndarray, np.ndarray]:
        """(e, 3) where each edge starts and ends."""
        at, _ = self.corners()
        return at.reshape(-1, 3), at[:, [1, 2, 0]].reshape(-1, 3)

    def corners(self) -> tuple[np.ndarray, np.ndarray]:
        """(t, 3, 3) corners of the triangles, (t, 3) outward normals."""
        at = np.concatenate([p.vertices[p.triangles[t]] for p, _, t, _ in self.pieces]).astype(float)
        run = np.concatenate([np.full(len(t), way) for _, _, t, way in self.pieces])
        return at, np.cross(at[:, 1] - at[:, 0], at[:, 2] - at[:, 0]) * run[:, None]


def winding(part) -> float:
    """1 where a part's triangles run counter-clockwise seen from outside, else -1."""
    at = part.vertices[part.triangles].astype(float)
    flat = np.cross(at[:, 1] - at[:, 0], at[:, 2] - at[:, 0])
    return float(np.sign((flat * part.normals[part.triangles].mean(axis=1)).sum()))


def sides(head: Head, loop: np.ndarray, lining: str, reach: float) -> tuple[Sheet, Sheet]:
    """The two lips (or lids) at an opening of the face: what lies within ``reach`` of its rim at rest, mm.

    Corners, where one side goes over into the other, are left out.
    """
    head.pose(head.values({}))
    face, inner = head.part("face"), head.part(lining)
    ids = rim(face, loop)
    middle = 0.5 * (loop[:, 1].min() + loop[:, 1].max())
    u0, u1 = loop[:, 0].min() + 0.04 * np.ptp(loop[:, 0]), loop[:, 0].max() - 0.04 * np.ptp(loop[:, 0])
    above, uv = face.mesh.uv[ids, 1] > middle, face.mesh.uv[ids]
    tree = cKDTree(face.vertices[ids])
    out = []
    for wanted in (True, False):
        pieces = []
        for part in (face, inner):
            distance, at = tree.query(part.vertices)
            own = part.mesh.uv[:, 1] > middle if part is face else above[at[: len(part.mesh.uv)]]
            inside = (uv[at, 0] > u0) & (uv[at, 0] < u1)
            own = np.concatenate([own, np.zeros(len(part.vertices) - len(own), bool)])
            side = own if wanted else ~own & (np.arange(len(own)) < len(part.mesh.uv))
            chosen = (distance < reach) & inside & side
            triangles = np.flatnonzero(chosen[part.triangles].all(axis=1))
            pieces.append((part, np.unique(part.triangles[triangles]), triangles, winding(part)))
        out.append(Sheet(pieces))
    return out[0], out[1]


def crossing(one: Sheet, other: Sheet) -> tuple[float, np.ndarray]:
    """How deep points of either side lie in the flesh of the other, and where the deepest lies (3,).

    A point lies inside if the nearest place of the other side shows it its back, and most of its own ways out, along
    its normal and leaning from it, first meet the other side from behind. That counts only near a place where an
    edge of one side pierces a triangle of the other: at folds, backs are seen without any crossing.
    """
    worst, where = 0.0, np.zeros(3)
    for a, b in ((one, other), (other, one)):
        points, depths = _inside(a, b)
        for k in np.argsort(-depths):
            if depths[k] <= worst:
                break
            reach = float(np.sqrt(2.0 * ROUND_MM * depths[k]))
            if _pierced(one, other, points[k], reach) or _pierced(other, one, points[k], reach):
                worst, where = float(depths[k]), points[k]
    return worst, where


def _inside(a: Sheet, b: Sheet) -> tuple[np.ndarray, np.ndarray]:
    """Points (k, 3) of a sheet that seem to lie in another's flesh, and how deep (k,)."""
    points, others, (at, flat) = a.points(), b.points(), b.corners()
    distance, near = cKDTree(others).query(points, distance_upper_bound=FAR_MM)
    found = np.flatnonzero(np.isfinite(distance))
    found = found[((points[found] - others[near[found]]) * b.normals()[near[found]]).sum(axis=1) < 0]
    middle = at.mean(axis=1)
    radius = float(np.linalg.norm(at - middle[:, None], axis=2).max())
    lists = cKDTree(middle).query_ball_point(points[found], distance[found] + radius)
    first = np.cumsum([0, *map(len, lists)])
    signed, near_ones = np.zeros(len(found)), np.array([t for row in lists for t in row], np.int64)
    near_triangle(points[found], at, b.corner_normals(), b.cut(), near_ones, first, signed)
    found, signed = found[signed < -LEAST_MM], signed[signed < -LEAST_MM]
    ways = np.zeros((5, len(found)))
    for way, out in zip(_fan(a.normals()[found]), ways, strict=True):
        way_out(points[found], np.ascontiguousarray(way), at, flat, FAR_MM, out)
    return points[found], np.minimum(-signed, np.median(ways, axis=0))


def _fan(normals: np.ndarray) -> np.ndarray:
    """(5, m, 3) unit vectors: normals, and four that decimated away from each."""
    n = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    side = np.cross(n, np.where(np.abs(n[:, :1]) < 0.7, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-12)
    leaning = [n + LEAN * d for d in (side, -side, np.cross(n, side), -np.cross(n, side))]
    return np.stack([n, *leaning]) / np.sqrt([[[1.0]], *[[[1.0 + LEAN**2]]] * 4])


def _pierced(one: Sheet, other: Sheet, place: np.ndarray, reach: float) -> bool:
    """Does an edge of one sheet within ``reach`` mm of a place (3,) go through a triangle of the other?"""
    start, end = one.edges()
    near = np.linalg.norm(0.5 * (start + end) - place, axis=1) < reach
    at, _ = other.corners()
    close = np.linalg.norm(at.mean(axis=1) - place, axis=1) < reach + 2.0
    return any_pierce(start[near], end[near], at[close])


def eye_height(directions: np.ndarray, gaze: np.ndarray) -> np.ndarray:
    """(m,) distance of an eyeball's surface from its centre in unit directions (m, 3), in radii."""
    axis_z = np.sqrt(1 - IRIS**2) - np.sqrt(CORNEA**2 - IRIS**2)  # the cornea's centre
    along = directions @ gaze
    root = CORNEA**2 - axis_z**2 * (1 - along**2)
    return np.maximum(1.0, np.where(root > 0, axis_z * along + np.sqrt(np.maximum(root, 0)), 0.0))


def above_eye(head: Head, side: int, points: np.ndarray) -> np.ndarray:
    """Height (m,) of points (m, 3) above an eyeball that looks where the pose says, cornea included; the head must not
    be turned."""
    eye, radius = head.data.eyes[side], head.data.eye_radius
    ball = head.part(("eye_left", "eye_right")[side])
    pole = ball.vertices[np.argmin(ball.mesh.uv[:, 1])] - eye
    local = points.astype(float) - eye
    distance = np.linalg.norm(local, axis=1)
    return distance - radius * eye_height(local / distance[:, None], pole / np.linalg.norm(pole))


def eye_cut(head: Head, side: int, *parts: str) -> float:
    """How deep a lid reaches into an eyeball, in front of its middle."""
    eye, radius = head.data.eyes[side], head.data.eye_radius
    worst = 0.0
    for name in parts:
        points = head.part(name).vertices
        local = points - eye
        near = (np.linalg.norm(local, axis=1) < 1.3 * radius) & (local[:, 2] > 0)
        worst = max(worst, float(-above_eye(head, side, points[near]).min(initial=0.0)))
    return worst


def eye_opening(head: Head, side: int, step: float = 0.1) -> tuple[float, float, float]:
    """Largest height of the visible eyeball in the middle half of the lids, seen from the front; y of its upper and
    lower end in the middle column, from the eyeball's centre."""
    x, y, _ = head.data.eyes[side]
    window = Window((x - 6.0, x + 6.0), (y - 14.0, y + 14.0), step)
    skin = window.depth(head.part("face"), head.part("sockets"))
    seen = window.depth(head.part(("eye_left", "eye_right")[side])) > skin
    rows = np.flatnonzero(seen[:, seen.shape[1] // 2])
    ends = (rows.max() * step - 14.0, rows.min() * step - 14.0) if len(rows) else (0.0, 0.0)
    return float(seen.sum(axis=0).max() * step), *ends


def eye_seen(head: Head, side: int, pitch: float, step: float = 0.1) -> float:
    """mm^2 of an eyeball that are seen from ``pitch`` rad above (below 0: from below)."""
    turn = np.array([[1, 0, 0], [0, np.cos(pitch), -np.sin(pitch)], [0, np.sin(pitch), np.cos(pitch)]])
    x, y, _ = turn @ head.data.eyes[side]
    window = Window((x - 16.0, x + 16.0), (y - 15.0, y + 15.0), step, turn)
    skin = window.depth(head.part("face"), head.part("sockets"))
    return float((window.depth(head.part(("eye_left", "eye_right")[side])) > skin).sum() * step**2)


def lips_gap(head: Head, step: float = 0.1) -> float:
    """Largest height, in the middle half of the mouth, where one looks between the lips, seen from the front."""
    window = Window((-14.0, 14.0), (-75.0, -10.0), step)
    skin = window.depth(head.part("face"))
    back = window.depth(*(head.part(n) for n in ("cavity", "teeth_upper", "teeth_lower", "tongue")))
    return float((back > skin).sum(axis=0).max() * step)


def seams_gape(head: Head) -> float:
    """How far the borders of two parts that are one line lie apart at most."""
    widest = 0.0
    for z in head.stitches:
        if z.first is not z.second:
            a, b = z.first.vertices, z.second.vertices
            edge = a[z.low] + z.share[:, None] * (a[z.high] - a[z.low])
            widest = max(widest, float(np.abs(b[z.ids] - edge).max(initial=0.0)))
    return widest


def inside(points: np.ndarray, ring: np.ndarray) -> np.ndarray:
    """(m,) which points (m, 2) lie in a closed polygon (k, 2), by the even-odd rule."""
    odd = np.zeros(len(points), bool)
    for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        crosses = (a[1] > points[:, 1]) != (b[1] > points[:, 1])
        height = b[1] - a[1] if b[1] != a[1] else 1e-18
        odd ^= crosses & (points[:, 0] < a[0] + (points[:, 1] - a[1]) / height * (b[0] - a[0]))
    return odd


def poke(head: Head, ring: np.ndarray, window: Window, *names: str) -> float:
    """How far parts stand out of the face, seen from the front, outside the opening with the rim ``ring`` (ids)."""
    face = head.part("face")
    skin, own = window.depth(face), window.depth(*(head.part(n) for n in names))
    out = np.argwhere(np.isfinite(skin) & np.isfinite(own) & (own > skin + LEAST_MM))
    if not len(out):
        return 0.0
    at = out[:, ::-1] * window.step + [window.x[0], window.y[0]]
    beside = ~inside(at, face.vertices[ring, :2].astype(float))
    rows = out[beside]
    return float((own[rows[:, 0], rows[:, 1]] - skin[rows[:, 0], rows[:, 1]]).max(initial=0.0))


def seen_through(head: Head, window: Window) -> tuple[float, float]:
    """mm^2 of a picture in which one looks right through the head, and in which one sees the back of what lies inside
    it, as the linings of mouth and eyes, through a gap between parts."""
    shape = tuple(int((b - a) / window.step) + 1 for a, b in (window.y, window.x))
    depth, back = np.full(shape, -np.inf), np.zeros(shape, bool)
    for part in head.parts:
        if part.material not in ("brow", "lash"):
            points = part.vertices.astype(float)
            points = points if window.turn is None else points @ window.turn.T
            way = 0.0 if part.name == "face" else winding(part)  # skin may fold over itself
            draw_depth(points, part.triangles, way, window.x[0], window.y[0], window.step, depth, back)
    there = np.isfinite(depth)
    enclosed = ~there
    for axis in (0, 1):
        for way in (slice(None), slice(None, None, -1)):
            ordered = there[way] if axis == 0 else there[:, way]
            before = np.maximum.accumulate(ordered, axis=axis)
            enclosed &= before[way] if axis == 0 else before[:, way]
    return float(enclosed.sum() * window.step**2), float(back.sum() * window.step**2)
