"""Trimming: cut a conforming triangulation of (u, v) along trim loops, without slivers.

As in isosurface stuffing (Labelle and Shewchuk 2007), in two dimensions: vertices that lie close to a loop are moved
onto it, then the remaining crossed edges are cut, each once for both its triangles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surface.base import keys
from surface.base.arrays import Floats, Ints

from . import flips, loops
from .barycentric import fill_barycentric
from .domain import Domain, Slit

MAX_SPLIT_ROUNDS = 4  # at a sharp corner or a mark
EDGE_SAMPLES = 0.5, 0.25, 0.75, 0.1, 0.9  # fractions of an edge at which it is tested for being inside
SNAP_FRACTION = 0.28  # of the shortest edge at a vertex: a crossing nearer than this moves the vertex onto the loop
LOCKED = -2  # in place of the number of a line: the vertex must not move
MAX_FLAT_AREA = 1e-9  # triangles of less than this count as flat; in squared lengths of two sides


@dataclass
class Flat:
    """A triangulation of (u, v): vertices (m, 2), and counter-clockwise triangles (t, 3)."""

    uv: Floats
    triangles: Ints
    owner: Ints  # (t,) the leaf cell of every triangle


def trim(flat: Flat, domain: Domain, scale: tuple[float, float]) -> Flat:
    """Return the part of a conforming triangulation of the rectangle that is inside the domain's loops.

    ``scale`` are lengths per unit of u and of v, so that "near" means near on the surface.
    """
    flat = _drop_outside(flat, domain)
    if not len(flat.triangles):
        return flat
    lines = _sliding_lines(flat.uv, domain)
    fixed = np.zeros(len(flat.uv), dtype=bool)
    flat, lines, fixed = _place_corners(flat, domain, scale, lines, fixed)
    sign = np.where(domain.inside(flat.uv), 1, -1)
    sign[fixed] = 0
    _snap(flat, domain, scale, lines, sign)
    flat, sign = _split_crossing_edges(flat, domain, sign)
    flat = _drop_flat_border(_merge_coincident(_cut(_split_at_marks(flat, domain), domain, scale, sign)))
    flips.improve(flat.uv * np.asarray(scale), flat.triangles, slit_masks(flat.uv, domain))
    return compact(flat)


def _merge_coincident(flat: Flat) -> Flat:
    """Merge the ends of edges without length, which arise where two vertices were moved to one point of a loop."""
    edges = _edges(flat.triangles)
    edges = edges[(flat.uv[edges[:, 0]] == flat.uv[edges[:, 1]]).all(axis=1)]
    target = np.arange(len(flat.uv))
    while (target[edges[:, 0]] != target[edges[:, 1]]).any():
        least = np.minimum(target[edges[:, 0]], target[edges[:, 1]])
        np.minimum.at(target, edges.ravel(), np.repeat(least, 2))
    return replace_vertices(flat, target)


def replace_vertices(flat: Flat, target: Ints) -> Flat:
    """Use vertex ``target[i]`` instead of vertex i; triangles that lose a corner are dropped."""
    triangles = target[flat.triangles]
    whole = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    return Flat(flat.uv, triangles[whole], flat.owner[whole])


def _split_at_marks(flat: Flat, domain: Domain) -> Flat:
    """Flip edges that run through a mark without having it as an end.

    A vertex was moved there, so a triangle without area has the mark on its longest edge. It and the triangle across
    that edge, if there is one, become two triangles with the mark as a corner.
    """
    for mark in np.asarray(domain.marks):
        for vertex in np.flatnonzero((flat.uv == mark).all(axis=1)).tolist():
            for _ in range(MAX_SPLIT_ROUNDS):
                if (row := _find_flat(flat, vertex)) is not None:
                    flat = _flip_edge(flat, vertex, row)
    return flat


def _find_flat(flat: Flat, vertex: int) -> int | None:
    """Return a triangle without area that has ``vertex`` on its longest edge, or None."""
    rows = np.flatnonzero((flat.triangles == vertex).any(axis=1))
    others = flat.triangles[rows][flat.triangles[rows] != vertex].reshape(-1, 2)
    a, b = (flat.uv[others[:, k]] - flat.uv[vertex] for k in range(2))
    along = (a * b).sum(axis=1)
    found = rows[(np.abs(_cross(a, b)) <= MAX_FLAT_AREA * (a**2 + b**2).sum(axis=1)) & (along < 0)]
    return int(found[0]) if len(found) else None


def _flip_edge(flat: Flat, vertex: int, row: int) -> Flat:
    """Flip the edge of triangle ``row`` opposite to ``vertex``; without a triangle across that edge, drop ``row``."""
    triangle = flat.triangles[row]
    p, q = np.roll(triangle, -int(np.argmax(triangle == vertex)))[1:].tolist()
    beyond = _find_across(flat.triangles, p, q)
    hit, added = [row], np.zeros((0, 3), np.int64)
    if beyond is not None:
        corner = int(flat.triangles[beyond].sum() - p - q)
        hit, added = [row, beyond], np.array([(vertex, p, corner), (vertex, corner, q)])
    owner = np.append(np.delete(flat.owner, hit), flat.owner[hit[1:]].repeat(2))
    return Flat(flat.uv, np.concatenate([np.delete(flat.triangles, hit, axis=0), added]), owner)


def _drop_flat_border(flat: Flat) -> Flat:
    """Drop triangles without area, or turned over, that have two edges on the border; the domain stays the same."""
    while True:
        a, b, c = (flat.uv[flat.triangles[:, k]] for k in range(3))
        _, _, back = keys.unique(flips.edge_keys(flat.triangles)[0])
        border = (np.bincount(back)[back].reshape(-1, 3) == 1).sum(axis=1)
        drop = (_cross(b - a, c - a) <= 0) & (border >= 2)
        if not drop.any():
            return flat
        flat = Flat(flat.uv, flat.triangles[~drop], flat.owner[~drop])


def compact(flat: Flat) -> Flat:
    """Drop vertices that no triangle uses."""
    used = np.zeros(len(flat.uv), dtype=bool)
    used[flat.triangles] = True
    return Flat(flat.uv[used], (np.cumsum(used) - 1)[flat.triangles], flat.owner)


def slit_masks(uv: Floats, domain: Domain) -> Ints:
    """Return a bit mask (m,) of the slits that each vertex is on; an edge lies on a slit if its ends share a bit."""
    mask = np.zeros(len(uv), dtype=np.int64)
    for bit, slit in enumerate(domain.slits):
        mask[slit.holds(uv) | _are_ends(slit, uv)] |= 1 << bit
    return mask


def _drop_outside(flat: Flat, domain: Domain) -> Flat:
    """Drop triangles of which nothing is inside."""
    sign = np.where(domain.inside(flat.uv), 1, -1)
    keep = np.any(sign[flat.triangles] > 0, axis=1)
    for a, b in _find_crossing_edges(flat, domain, sign)[0]:
        keep[_find_beside(flat.triangles, a, b)] = True
    # A corner of a loop may lie in a triangle whose own corners are all outside.
    low, high = flat.uv[flat.triangles].min(axis=1), flat.uv[flat.triangles].max(axis=1)
    for tip in _all_corners(domain, (1.0, 1.0)):
        around = np.flatnonzero(((low <= tip) & (tip <= high)).all(axis=1))
        own = Flat(flat.uv, flat.triangles[around], flat.owner[around])
        keep[around] |= _barycentric(own, tip).min(axis=1, initial=np.inf) >= 0
    return compact(Flat(flat.uv, flat.triangles[keep], flat.owner[keep]))


def _all_corners(domain: Domain, scale: tuple[float, float]) -> Floats:
    rings = [np.asarray(loop) for loop in domain.loops]
    return np.concatenate([*(ring[loops.corners(ring, scale)] for ring in rings), np.asarray(domain.marks)])


def _sliding_lines(uv: Floats, domain: Domain) -> Ints:
    """Return the line (m,), a slit or border, that each vertex may slide along.

    -1 for free vertices, :data:`LOCKED` where two lines meet or at an end.
    """
    line = np.full(len(uv), -1, dtype=np.int64)
    u0, u1, v0, v1 = domain.rect
    groups = [uv[:, 0] == u0, uv[:, 0] == u1, uv[:, 1] == v0, uv[:, 1] == v1]
    groups += [(slit_masks(uv, domain) >> bit & 1).astype(bool) for bit in range(len(domain.slits))]
    for index, on in enumerate(groups):
        line[on] = np.where(line[on] == -1, index, LOCKED)
    for slit in domain.slits:
        line[_are_ends(slit, uv)] = LOCKED
    return line


def _are_ends(slit: Slit, uv: Floats) -> np.ndarray:
    """Return which of ``uv (m, 2)`` are end points of a slit, (m,) bool."""
    across, along = (uv[:, 1], uv[:, 0]) if slit.axis == "u" else (uv[:, 0], uv[:, 1])
    return np.asarray((across == slit.at) & ((along == slit.start) | (along == slit.end)))


def _barycentric(flat: Flat, point: Floats) -> Floats:
    """Return barycentric coordinates (t, 3) of a point in every triangle; -inf in triangles without area."""
    shares = np.empty((len(flat.triangles), 3))
    fill_barycentric(flat.uv, flat.triangles, point, shares)
    return shares


def _cross(a: Floats, b: Floats) -> Floats:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _place_corners(
    flat: Flat, domain: Domain, scale: tuple[float, float], line: Ints, fixed: np.ndarray
) -> tuple[Flat, Ints, np.ndarray]:
    """Put a vertex at every sharp corner and mark of a loop, and where the loop leaves the triangles around a corner.

    Thus the sides at a corner are edges of the mesh, and a wedge narrower than a triangle is not lost.
    """
    for mark in np.asarray(domain.marks):
        flat, line, fixed = _place_vertex(flat, mark, line, fixed, slides=True)
    tips = _all_corners(domain, scale)
    for tip in tips:
        flat, line, fixed = _place_vertex(flat, tip, line, fixed)
    for tip in tips:
        at = np.flatnonzero((flat.uv == tip).all(axis=1) & fixed)
        for point in _fan_crossings(flat, domain, int(at[0])) if len(at) else ():
            flat, line, fixed = _place_vertex(flat, point, line, fixed)
    return flat, line, fixed


def _place_vertex(
    flat: Flat, point: Floats, line: Ints, fixed: np.ndarray, *, slides: bool = False
) -> tuple[Flat, Ints, np.ndarray]:
    """Move a close free vertex to ``point``, or split a triangle there.

    ``slides`` : vertices on the rectangle's border may move, too: along the border, or if they are very close.
    """
    inside = np.empty((len(flat.triangles), 3))
    triangle = int(fill_barycentric(flat.uv, flat.triangles, point, inside))
    share = inside[triangle]
    if share.min() < -1e-9:
        return flat, line, fixed
    nearest = flat.triangles[triangle, int(np.argmax(share))]
    axis = line[nearest] // 2  # borders 0 and 1 fix u, 2 and 3 fix v
    border = slides and 0 <= axis < 2 and (flat.uv[nearest, axis] == point[axis] or share.max() >= 0.9)
    if share.max() > 0.7 and (border or line[nearest] == -1) and not fixed[nearest]:
        flat.uv[nearest] = point
        fixed[nearest] = True
    elif share.max() < 0.9:
        flat = _insert(flat, point, triangle, share)
        line, fixed = np.append(line, -1), np.append(fixed, True)
    return flat, line, fixed


def _fan_crossings(flat: Flat, domain: Domain, vertex: int) -> Floats:
    """Return the points (k, 2) where loops cross edges opposite to a vertex in the triangles around it."""
    around = flat.triangles[(flat.triangles == vertex).any(axis=1)]
    opposite = around[around != vertex].reshape(-1, 2)
    a, b = flat.uv[opposite[:, 0]][:, None], flat.uv[opposite[:, 1]][:, None]
    start, along = domain.segments[None, :, :2], domain.segments[None, :, 2:] - domain.segments[None, :, :2]
    det = _cross(b - a, along)
    safe = np.where(det == 0, 1.0, det)
    t, s = _cross(start - a, along) / safe, _cross(start - a, b - a) / safe
    hit = (det != 0) & (t >= 0) & (t <= 1) & (s >= 0) & (s < 1)
    edge, segment = np.nonzero(hit)
    points: Floats = a[edge, 0] + t[edge, segment][:, None] * (b - a)[edge, 0]
    return points


def _insert(flat: Flat, point: Floats, triangle: int, share: Floats) -> Flat:
    """Split a triangle in three at ``point``, or, if that is close to an edge, the two beside the edge in four."""
    new, hit = len(flat.uv), [triangle]
    a, b, c = np.roll(flat.triangles[triangle], -int(np.argmin(share)))  # b-c is the nearest edge
    added = [(a, b, new), (a, new, c)]
    beside = _find_across(flat.triangles, b, c) if share.min() < 0.15 else None
    if beside is None:
        added.append((b, c, new))
    else:
        d = int(flat.triangles[beside].sum() - b - c)
        hit.append(beside)
        added += [(d, c, new), (d, new, b)]
    owner = np.repeat(flat.owner[hit], len(added) // len(hit))
    return _replace_triangles(flat, point, np.array(hit), np.array(added), owner)


def _replace_triangles(flat: Flat, point: Floats, hit: Ints, added: Ints, owner: Ints) -> Flat:
    """Add a vertex, and replace the triangles ``hit`` by those ``added``, of leaf cells ``owner``."""
    triangles = np.concatenate([np.delete(flat.triangles, hit, axis=0), added])
    return Flat(np.vstack([flat.uv, point]), triangles, np.append(np.delete(flat.owner, hit), owner))


def _find_across(triangles: Ints, b: int, c: int) -> int | None:
    """Return the triangle that has the directed edge from c to b, or None."""
    corners = np.ascontiguousarray(triangles).reshape(-1)
    at = np.flatnonzero(corners == c)
    found = at[corners[at - at % 3 + (at + 1) % 3] == b] // 3
    return int(found[0]) if len(found) else None


def _edges(triangles: Ints) -> Ints:
    """Return the undirected edges (e, 2), each once, smaller index first."""
    key, width = flips.edge_keys(triangles)
    return np.stack(np.divmod(np.unique(key), width), axis=1)


def _snap(flat: Flat, domain: Domain, scale: tuple[float, float], line: Ints, sign: Ints) -> None:
    """Move vertices close to a loop onto it, in place, and set their sign to 0."""
    edges = _edges(flat.triangles)
    length = np.linalg.norm((flat.uv[edges[:, 1]] - flat.uv[edges[:, 0]]) * np.asarray(scale), axis=1)
    shortest = np.full(len(flat.uv), np.inf)
    np.minimum.at(shortest, edges.ravel(), np.repeat(length, 2))
    crossed = sign[edges[:, 0]] * sign[edges[:, 1]] < 0
    edges, length = edges[crossed], length[crossed]
    t = loops.crossings(domain.segments, flat.uv[edges[:, 0]], flat.uv[edges[:, 1]])
    crossing = flat.uv[edges[:, 0]] + t[:, None] * (flat.uv[edges[:, 1]] - flat.uv[edges[:, 0]])
    distance = np.concatenate([t, 1 - t]) * np.concatenate([length, length])
    vertex, other = np.concatenate([edges[:, 0], edges[:, 1]]), np.concatenate([edges[:, 1], edges[:, 0]])
    may_move = (line[vertex] == -1) | ((line[vertex] >= 0) & (line[vertex] == line[other]))
    chosen = np.flatnonzero(may_move & (distance < SNAP_FRACTION * shortest[vertex]))
    chosen = chosen[np.argsort(-distance[chosen], kind="stable")]  # the nearest crossing is written last
    flat.uv[vertex[chosen]] = np.concatenate([crossing, crossing])[chosen]
    sign[vertex[chosen]] = 0


def _split_crossing_edges(flat: Flat, domain: Domain, sign: Ints) -> tuple[Flat, Ints]:
    """Split edges that run through the inside although no end is inside, where they cross a loop.

    They arise at sharp corners when vertices are moved onto a loop. Unsplit, they would be dropped with what is inside.
    """
    for _ in range(MAX_SPLIT_ROUNDS):
        edges, within = _find_crossing_edges(flat, domain, sign)
        if not len(edges):
            break
        outer = np.where(sign[edges[:, 0]] < 0, edges[:, 0], edges[:, 1])
        t = loops.crossings(domain.segments, within, flat.uv[outer])
        points = within + t[:, None] * (flat.uv[outer] - within)
        for (a, b), point in zip(edges, points, strict=True):
            flat = _split_edge(flat, int(a), int(b), point)
        sign = np.append(sign, np.zeros(len(edges), sign.dtype))
    return flat, sign


def _find_crossing_edges(flat: Flat, domain: Domain, sign: Ints) -> tuple[Ints, Floats]:
    """Return edges (e, 2) that run through the inside, with no end inside and one outside, and an inner point of each.

    Edges of triangles that moved vertices turned over are left out: halves of those would be kept upside down.
    """
    a, b, c = (flat.uv[flat.triangles[:, k]] for k in range(3))
    turned = _edges(flat.triangles[_cross(b - a, c - a) <= 0])
    edges = _edges(flat.triangles)
    edges = edges[~np.isin(edges @ [len(flat.uv), 1], turned @ [len(flat.uv), 1])]
    edges = edges[(sign[edges].max(axis=1) <= 0) & (sign[edges].min(axis=1) < 0)]
    a, b = flat.uv[edges[:, 0]], flat.uv[edges[:, 1]]
    tried = np.stack([a + t * (b - a) for t in EDGE_SAMPLES])
    inside = domain.inside(tried.reshape(-1, 2)).reshape(len(EDGE_SAMPLES), -1)
    hit = np.flatnonzero(inside.any(axis=0))
    return edges[hit], tried[inside[:, hit].argmax(axis=0), hit]


def _split_edge(flat: Flat, a: int, b: int, point: Floats) -> Flat:
    """Put a vertex on the edge a-b, and split the triangles beside it."""
    beside = _find_beside(flat.triangles, a, b)
    halves = [np.where(flat.triangles[beside] == end, len(flat.uv), flat.triangles[beside]) for end in (a, b)]
    return _replace_triangles(flat, point, beside, np.concatenate(halves), np.tile(flat.owner[beside], 2))


def _find_beside(triangles: Ints, a: int, b: int) -> Ints:
    """Return the triangles that have an edge, in either direction."""
    return np.flatnonzero(((triangles == a) | (triangles == b)).sum(axis=1) == 2)


def _cut(flat: Flat, domain: Domain, scale: tuple[float, float], sign: Ints) -> Flat:
    """Keep triangles inside, drop those outside, and clip those that a loop crosses."""
    signs = sign[flat.triangles]
    low, high = signs.min(axis=1), signs.max(axis=1)
    keep = (low >= 0) & (high > 0)
    on = (low == 0) & (high == 0)
    keep[on] = domain.inside(flat.uv[flat.triangles[on]].mean(axis=1))
    crossed = np.flatnonzero((low < 0) & (high > 0))
    uv, new, owner = _clip(flat, domain, scale, sign, crossed)
    return Flat(
        uv, np.concatenate([flat.triangles[keep], new]), flat.owner[np.concatenate([np.flatnonzero(keep), owner])]
    )


def _clip(
    flat: Flat, domain: Domain, scale: tuple[float, float], sign: Ints, crossed: Ints
) -> tuple[Floats, Ints, Ints]:
    """Return the vertices and those on cut edges, the triangles of clipped cells, and the triangle each came from."""
    triangles = flat.triangles[crossed]
    width = len(flat.uv)
    pairs = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 3, 2), axis=2)
    is_cut = sign[pairs[:, :, 0]] * sign[pairs[:, :, 1]] < 0
    key = pairs[:, :, 0] * width + pairs[:, :, 1]
    cut_keys = np.unique(key[is_cut])
    a, b = flat.uv[cut_keys // width], flat.uv[cut_keys % width]
    t = loops.crossings(domain.segments, a, b)[:, None]
    uv = np.concatenate([flat.uv, a + t * (b - a)])
    node = np.where(is_cut, width + np.searchsorted(cut_keys, key), -1)  # (n, 3) cut vertex on edges 01, 12, 20
    # Turn every triangle so that its odd one out (the only negative, else the only positive) comes first.
    signs = sign[triangles]
    first = np.where((signs < 0).sum(axis=1) == 1, np.argmin(signs, axis=1), np.argmax(signs, axis=1))
    turn = (first[:, None] + np.arange(3)) % 3
    tri, edge, s = (np.take_along_axis(array, turn, axis=1) for array in (triangles, node, signs))
    return uv, *_assemble(tri, edge, s, uv * np.asarray(scale), crossed)


def _assemble(tri: Ints, edge: Ints, s: Ints, xy: Floats, crossed: Ints) -> tuple[Ints, Ints]:
    """Return the triangles of the inner parts by the signs of the corners; see :func:`_clip`."""
    tip = s[:, 0] > 0  # one positive, two negative
    left = (s[:, 0] < 0) & (s[:, 1] > 0) & (s[:, 2] == 0)
    right = (s[:, 0] < 0) & (s[:, 1] == 0) & (s[:, 2] > 0)
    quad = (s[:, 0] < 0) & (s[:, 1] > 0) & (s[:, 2] > 0)
    p, q, c, d = edge[:, 0], tri[:, 1], tri[:, 2], edge[:, 2]
    short = np.linalg.norm(xy[p] - xy[c], axis=1) < np.linalg.norm(xy[q] - xy[d], axis=1)
    parts = [
        (tip, tri[:, 0], p, d),
        (left, p, q, c),
        (right, q, c, d),
        (quad & short, p, q, c),
        (quad & short, p, c, d),
        (quad & ~short, p, q, d),
        (quad & ~short, q, c, d),
    ]
    new = np.concatenate([np.stack([i[m], j[m], k[m]], axis=1) for m, i, j, k in parts])
    return new, np.concatenate([crossed[m] for m, *_ in parts])
