"""Faces of a T-mesh at star points as patches, fitted to the limit of Catmull and Clark's subdivision (1978).

The .tsm format does not define the surface there. The limit surface of the control mesh is what such a
T-spline with equal knot intervals continues to; where intervals differ, and at the outline, it is moved so that it
meets the exact surface around it (a Coons patch of what is missing along the sides). All is linear in the grips, so
that patches follow them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from surface.base.arrays import Floats
from surface.spline.basis import blending

from .tlayout import Complex, Layout

LEVELS = 3  # of subdivision
COUNT = 2**LEVELS + 1  # samples along a side
SPANS = 4  # of a patch along a side
RINGS = 2  # of faces around one, which its limit depends on

Along = Callable[[int, int], list[dict[int, float]] | None]


@dataclass(frozen=True)
class Sampled:
    """One face: its grips, its sides' lengths, and shares of the grips at a lattice of places.

    grips : (g,) numbers. size : (u, v). limit : (COUNT, COUNT, g) of the subdivision surface. wanted : the same,
    moved to meet the exact surface beside it.
    """

    grips: list[int]
    size: tuple[float, float]
    limit: Floats
    wanted: Floats


@dataclass(frozen=True)
class Patch:
    """shares : (SPANS + 3, SPANS + 3, g) of the grips in each control point of a bicubic patch."""

    shares: Floats

    def deviation(self, sampled: Sampled, points: Floats) -> float:
        """Return the greatest distance of the patch from the limit surface at the samples; grips lie at points (g,
        3).
        """
        basis = _basis(np.linspace(0.0, 1.0, COUNT))
        at = np.einsum("ia,jb,abg->ijg", basis, basis, self.shares) @ points
        return float(np.linalg.norm(at - sampled.limit @ points, axis=-1).max())


def limit_samples(mesh: Complex, face: int, along: Along) -> Sampled:
    """Return samples of one face; ``along`` gives shares at places along a link, where the face that it borders is
    regular."""
    layout = Layout(mesh, face, 0)
    rect = layout.rects[face]
    size = rect[1] - rect[0], rect[3] - rect[2]
    loops, grips = _around(mesh, face)
    corners = {mesh.file.links[n].vertex: np.array(layout.places[n][:2]) / size for n in mesh.loops[face]}
    sides = _sides(mesh, face, along)
    extra = {grip for side in sides if side for row in side for grip in row}
    order = list(dict.fromkeys([*grips.values(), *extra]))
    column = {grip: k for k, grip in enumerate(order)}
    limit = _limit(loops, {v: column[g] for v, g in grips.items()}, corners, len(order))
    return Sampled(order, size, limit, _correct_sides(limit, [_rows(side, column) for side in sides]))


def _rows(side: list[dict[int, float]] | None, column: dict[int, int]) -> Floats | None:
    """Return (COUNT, g): shares along a side."""
    if side is None:
        return None
    out = np.zeros((len(side), len(column)))
    for k, row in enumerate(side):
        for grip, share in row.items():
            out[k, column[grip]] = share
    return out


def _sides(mesh: Complex, face: int, along: Along) -> list[list[dict[int, float]] | None]:
    """Return shares along the four sides, each in the order of the face's links; None beside another star face or
    nothing.

    Sides of several links, at T-junctions, are taken link by link.
    """
    links = mesh.file.links
    ways: list[list[int]] = []
    for number in mesh.loops[face]:
        if links[number].turn == 0:
            ways.append([])
        ways[-1].append(number)
    return [_side(mesh, way, along) for way in ways]


def _side(mesh: Complex, way: list[int], along: Along) -> list[dict[int, float]] | None:
    lengths = [mesh.file.edges[mesh.file.links[n].edge] for n in way]
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    fine = (COUNT - 1) * 16 + 1
    pieces = [along(mesh.file.links[n].opposite, fine) for n in way]
    if any(piece is None for piece in pieces):
        return None
    out = []
    for t in np.linspace(0.0, ends[-1], COUNT):
        k = min(int(np.searchsorted(ends, t, side="right")) - 1, len(way) - 1)
        piece = pieces[k]
        assert piece is not None
        at = round((1.0 - (t - ends[k]) / lengths[k]) * (fine - 1))  # the opposite link runs the other way
        out.append(piece[int(np.clip(at, 0, fine - 1))])
    return out


def _around(mesh: Complex, face: int) -> tuple[list[list[int]], dict[int, int]]:
    """Return vertices around each face near one, that one first; and the own grip of each of these vertices."""
    links = mesh.file.links
    by_vertex: dict[int, set[int]] = {}
    for number, loop in mesh.loops.items():
        for link in loop:
            by_vertex.setdefault(links[link].vertex, set()).add(number)
    near = {face}
    for _ in range(RINGS):
        near |= {other for number in near for link in mesh.loops[number] for other in by_vertex[links[link].vertex]}
    order = [face, *sorted(near - {face})]
    loops = [[links[link].vertex for link in mesh.loops[number]] for number in order]
    return loops, {v: mesh.grips[v][0][0] for loop in loops for v in loop}


def _limit(loops: list[list[int]], grips: dict[int, int], corners: dict[int, Floats], width: int) -> Floats:
    """Return (COUNT, COUNT, width): shares of grips at the first face's lattice, on the limit surface."""
    order = {v: k for k, v in enumerate(dict.fromkeys(v for loop in loops for v in loop))}
    shares, places = np.zeros((len(order), width)), np.full((len(order), 2), np.nan)
    for vertex, k in order.items():
        shares[k, grips[vertex]] = 1.0
        if vertex in corners:
            places[k] = corners[vertex]
    faces = [[order[v] for v in loop] for loop in loops]
    for _ in range(LEVELS):
        faces, shares, places = _subdivide(faces, shares, places)
    shares = _project_to_limit(faces, shares)
    out = np.full((COUNT, COUNT, width), np.nan)
    for k in np.flatnonzero(np.isfinite(places[:, 0])).tolist():
        i, j = np.rint(places[k] * (COUNT - 1)).astype(int)
        if np.abs(places[k] * (COUNT - 1) - (i, j)).max() < 1e-6:
            out[i, j] = shares[k]
    return _fill(out)


def _fill(lattice: Floats) -> Floats:
    """Return a lattice in which places without samples, as at T-junctions, are interpolated along their row and column;
    where neither has samples on both sides, the nearest sample counts."""
    known = np.isfinite(lattice[..., 0])
    if known.all():
        return lattice
    t = np.arange(COUNT, dtype=float)
    sums, counts = np.zeros_like(lattice), np.zeros(known.shape)
    for axis in range(2):
        for k in range(COUNT):
            rows = (k, slice(None)) if axis == 0 else (slice(None), k)
            at = np.flatnonzero(known[rows])
            if len(at) > 1:
                own, between = lattice[rows][at], slice(at[0], at[-1] + 1)  # beyond the last known place is no guess
                inside = [np.interp(t[between], t[at], own[:, c]) for c in range(own.shape[1])]
                sums[rows][between] += np.stack(inside, axis=1)
                counts[rows][between] += 1
    guess = sums / np.maximum(counts, 1)[..., None]
    if (alone := ~known & (counts == 0)).any():  # at a corner of the lattice
        samples = np.argwhere(known)
        nearest = np.linalg.norm(np.argwhere(alone)[:, None] - samples, axis=2).argmin(axis=1)
        guess[alone] = lattice[tuple(samples[nearest].T)]
    filled: Floats = np.where(known[..., None], lattice, guess)
    return filled


def _neighbours(faces: list[list[int]]) -> dict[tuple[int, int], list[int]]:
    """Return faces by their edges."""
    edges: dict[tuple[int, int], list[int]] = {}
    for k, face in enumerate(faces):
        for a, b in zip(face, face[1:] + face[:1], strict=True):
            edges.setdefault((min(a, b), max(a, b)), []).append(k)
    return edges


def _subdivide(faces: list[list[int]], x: Floats, places: Floats) -> tuple[list[list[int]], Floats, Floats]:
    """Return one step of Catmull and Clark's subdivision on rows (n, w); places are means, which is right on one face
    only."""
    edges, n = _neighbours(faces), len(x)
    centres = np.array([x[face].mean(axis=0) for face in faces])
    number = {edge: n + k for k, edge in enumerate(edges)}
    middles = np.array(
        [0.5 * (x[a] + x[b]) if len(own) == 1 else 0.25 * (x[a] + x[b]) + 0.5 * centres[own].mean(axis=0)
         for (a, b), own in edges.items()]
    )  # fmt: skip
    corners = _smooth(faces, edges, centres, x)
    first = n + len(edges)
    quads = []
    for k, face in enumerate(faces):
        ring = [*face[-1:], *face, *face[:1]]
        for (a, b), (_, c) in pairwise(pairwise(ring)):
            quads.append([b, number[min(b, c), max(b, c)], first + k, number[min(a, b), max(a, b)]])
    between = places[np.array(list(edges))].mean(axis=1)
    inside = np.array([places[face].mean(axis=0) if len(face) == 4 else np.full(2, np.nan) for face in faces])
    return quads, np.concatenate([corners, middles, centres]), np.concatenate([places, between, inside])


def _smooth(
    faces: list[list[int]], edges: dict[tuple[int, int], list[int]], centres: Floats, x: Floats
) -> Floats:  # fmt: skip
    """Return new places of the old vertices."""
    valence, free = np.zeros(len(x)), np.zeros(len(x))
    around, middle, border = np.zeros_like(x), np.zeros_like(x), np.zeros_like(x)
    for (a, b), own in edges.items():
        for v, other in ((a, b), (b, a)):
            valence[v] += 1
            middle[v] += 0.5 * (x[v] + x[other])
            if len(own) == 1:
                free[v] += 1
                border[v] += x[other]
    count = np.zeros(len(x))
    for k, face in enumerate(faces):
        around[face] += centres[k]
        count[face] += 1
    n = np.maximum(valence, 1)[:, None]
    inner = (around / np.maximum(count, 1)[:, None] + 2.0 * middle / n + (n - 3.0) * x) / n
    outer = np.where((count == 1)[:, None], x, 0.75 * x + border / 8.0)
    smoothed: Floats = np.where((free > 0)[:, None], outer, inner)
    return smoothed


def _project_to_limit(faces: list[list[int]], x: Floats) -> Floats:
    """Return vertices of quads moved to the limit surface (Halstead, Kass and DeRose 1993)."""
    edges = _neighbours(faces)
    valence, free = np.zeros(len(x)), np.zeros(len(x))
    beside, across, border = np.zeros_like(x), np.zeros_like(x), np.zeros_like(x)
    count = np.zeros(len(x))
    for (a, b), own in edges.items():
        for v, other in ((a, b), (b, a)):
            valence[v] += 1
            beside[v] += x[other]
            if len(own) == 1:
                free[v] += 1
                border[v] += x[other]
    for face in faces:
        for k, v in enumerate(face):
            across[v] += x[face[(k + 2) % 4]]
            count[v] += 1
    n = valence[:, None]
    inner = (n**2 * x + 4.0 * beside + across) / np.maximum(n * (n + 5.0), 1)
    outer = np.where((count == 1)[:, None], x, (4.0 * x + border) / 6.0)
    moved: Floats = np.where((free > 0)[:, None], outer, inner)
    return moved


def _correct_sides(limit: Floats, sides: list[Floats | None]) -> Floats:
    """Return the lattice moved by a Coons patch so that its sides are the exact ones where these are known.

    sides : (COUNT, g) from (0, 0) on: v = 0 along u, u = 1 along v, v = 1 back along u, u = 0 back along v.
    """
    own = [limit[:, 0], limit[-1], limit[::-1, -1], limit[0, ::-1]]
    off = [None if side is None else side - mine for side, mine in zip(sides, own, strict=True)]
    corner = [_corner(off[k], off[k - 1]) for k in range(4)]
    t = np.linspace(0.0, 1.0, COUNT)[:, None]
    straight = [(1.0 - t) * corner[k] + t * corner[(k + 1) % 4] for k in range(4)]
    whole = [line if o is None else o for line, o in zip(straight, off, strict=True)]
    low_v, high_u, high_v, low_u = whole[0], whole[1], whole[2][::-1], whole[3][::-1]
    u, v = t[:, None], t[None]
    along_u = (1.0 - v) * low_v[:, None] + v * high_v[:, None]
    along_v = (1.0 - u) * low_u[None] + u * high_u[None]
    bilinear = (1.0 - u) * (1.0 - v) * corner[0] + u * (1.0 - v) * corner[1]
    bilinear = bilinear + u * v * corner[2] + (1.0 - u) * v * corner[3]
    moved: Floats = limit + along_u + along_v - bilinear
    return moved


def _corner(after: Floats | None, before: Floats | None) -> Floats:
    """Return what is missing at a corner between two sides; nothing where neither is known."""
    known = [row for row in (None if after is None else after[0], None if before is None else before[-1])
             if row is not None]  # fmt: skip
    return np.mean(known, axis=0) if known else np.zeros(1)


def _basis(t: Floats) -> Floats:
    """Return (m, SPANS + 3): cubic B-splines over 0 to 1 with clamped ends."""
    knots = np.concatenate([[0.0] * 3, np.linspace(0.0, 1.0, SPANS + 1), [1.0] * 3])
    inside = np.minimum(t, 1.0 - 1e-15)
    return np.stack([blending(knots[i : i + 5], inside) for i in range(SPANS + 3)], axis=1)


def fit_patch(sampled: Sampled) -> Patch:
    """Return the bicubic patch nearest to the samples whose corners and sides depend on those of the samples only."""
    fit = _fitting_matrix()
    shares: Floats = np.einsum("ai,bj,ijg->abg", fit, fit, sampled.wanted)
    return Patch(shares)


def _fitting_matrix() -> Floats:
    """Return (SPANS + 3, COUNT): control points of the cubic spline nearest to samples, through the first and last."""
    basis = _basis(np.linspace(0.0, 1.0, COUNT))
    inner = np.linalg.pinv(basis[1:-1, 1:-1])
    ends = np.zeros((2, COUNT))
    ends[0, 0] = ends[1, -1] = 1.0
    rest = np.eye(COUNT)[1:-1] - basis[1:-1, :1] * ends[:1] - basis[1:-1, -1:] * ends[1:]
    return np.concatenate([ends[:1], inner @ rest, ends[1:]])
