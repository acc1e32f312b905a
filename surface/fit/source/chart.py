"""Make charts: what a part of a mesh gives the surface fit, with every island in its own tile of (u, v).

An island is a connected piece of the mesh's texture coordinates. Samples of a chart are its mesh vertices, face centres
and centres of border edges. Each is a fixed linear combination of mesh vertices, so one sparse product samples the
neutral face or any of its shapes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix, diags, identity, vstack

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.source.bends import slope_trust
from surface.fit.source.islands import Island, boundary_loops
from surface.fit.source.mesh import FitMesh, directed_edges, face_areas, triangles

TILE = 2.0  # distance in u between the tiles of two islands: too far for control points to reach the next tile
FIRST_TILE = 0.5 * (1.0 + TILE)  # the u that the first tile and its control points stay below: tiles are 1 wide
MAX_SLIT_ASPECT = 0.7  # height over width of a hole, below which it is a slit
MIN_SLIT_LENGTH = (
    1e-5  # of a slit in u, in tiles; what is shorter is a point, as corners of a hole that share one (u, v)
)
BORDER_WEIGHT = 8.0  # of samples on a border, where the surface has to meet its neighbour
FOLD_STRETCH = (4.5, 7.0)  # stretch, in medians of it, where a fold of the mesh begins and where it is complete
FOLD_WEIGHT = 0.05  # of samples deep in a fold
INNER_WEIGHTS = np.array([4.0, 1.0, 1.0]) / 6.0  # of a triangle's corners at places inside it where no sample lies
EDGE_WEIGHTS = np.array([0.75, 0.25])  # of the ends of a border edge at such places on the border
PLACE_SPACING = 0.4  # of such places, relative to the spacing of the mesh
SLOPE_WEIGHT = 2.0  # of a face's slope, relative to that of a sample's position


@dataclass(frozen=True)
class Cut:
    """A slit along u at ``v``, from ``start`` to ``end``."""

    v: float
    start: float
    end: float


@dataclass(frozen=True)
class Places:
    """Places between the samples of a chart, where errors are measured.

    uv : (d, 2). mix : (d, n) sparse, each as a combination of the mesh's n vertices. spacing : (d, 2), folded : (d,) as
    in :class:`Chart`.
    """

    uv: Floats
    mix: csr_matrix
    spacing: Floats
    folded: Bools

    def take(self, chosen: Bools) -> Places:
        """Those that a mask (d,) chooses."""
        rows = np.flatnonzero(chosen)
        return Places(self.uv[rows], self.mix[rows], self.spacing[rows], self.folded[rows])


@dataclass(frozen=True)
class Chart:
    """What the surface fit needs to know of one part.

    uv : (m, 2) float64, the samples.
    mix : (m, n) sparse, each sample as a combination of the mesh's n vertices.
    weight : (m,) float64, of each sample in least squares.
    spacing : (m, 2) float64, distance between mesh vertices around each sample, in u and in v.
    folded : (m,) bool, samples inside folds (nostrils, ear canals), where errors do not count.
    loops : closed polylines (k, 2) in (u, v); loop_vertices : the mesh vertex of each of their points.
    cuts : slits of the chart. slopes : derivatives that the surface should have; None: only positions are fitted.
    between : places all over the chart where the surface is compared with the mesh between the samples.
    importance : (m,) factor of each sample's error when control points are added; None: 1 for all.
    inner : (k,) vertices of the mesh that lie inside what a skin was wrapped round, and count as folded.
    """

    uv: Floats
    mix: csr_matrix
    weight: Floats
    spacing: Floats
    folded: Bools
    loops: list[Floats]
    loop_vertices: list[Ints]
    cuts: list[Cut] = field(default_factory=list)
    slopes: Slopes | None = None
    between: Places | None = None
    importance: Floats | None = None
    inner: Ints = field(default_factory=lambda: np.zeros(0, np.int64))

    def hole_near(self, vertices: Floats, eye: Floats) -> int:
        """Number of the loop whose mean, over mesh vertices (n, 3), is nearest to an eyeball's centre (3,)."""
        return int(np.argmin([np.linalg.norm(vertices[ids].mean(axis=0) - eye) for ids in self.loop_vertices]))


def make_chart(
    mesh: FitMesh, islands: list[Island], *, normalise: bool = True, downweight_slivers: bool = False
) -> Chart:
    """Lay the islands side by side and sample them.

    normalise : False keeps the mesh's own (u, v), for a single island that is known to fill the unit square.
    downweight_slivers : slopes count less at long thin faces (:func:`face_slopes`), and at faces that are large for the
        curvature of what they show (:func:`surface.fit.source.bends.slope_trust`).
    """
    placed = [in_tile(island, k) if normalise else island for k, island in enumerate(islands)]
    pieces = [_piece(mesh, island, downweight_slivers=downweight_slivers) for island in placed]
    rows: dict[str, Any] = {
        k: np.concatenate([getattr(p, k) for p in pieces]) for k in ("uv", "weight", "spacing", "folded")
    }
    lists: dict[str, Any] = {k: [x for p in pieces for x in getattr(p, k)] for k in ("loops", "loop_vertices", "cuts")}
    slopes = join_slopes([p.slopes for p in pieces if p.slopes is not None])
    between = join_places([p.between for p in pieces if p.between is not None])
    return Chart(mix=vstack([p.mix for p in pieces]).tocsr(), slopes=slopes, between=between, **rows, **lists)


def join_places(parts: list[Places]) -> Places:
    """The places of several islands as one."""
    uv, spacing, folded = (np.concatenate([getattr(p, k) for p in parts]) for k in ("uv", "spacing", "folded"))
    return Places(uv, vstack([p.mix for p in parts]).tocsr(), spacing, folded)


def _piece(mesh: FitMesh, island: Island, *, downweight_slivers: bool) -> Chart:
    """The chart of one island."""
    rows, on_border = _sample_rows(island)
    n = len(mesh.vertices)
    fold = _fold(mesh, island)
    sampled = np.clip(rows @ fold, 0, 1)
    around = [loop for k, loop in enumerate(boundary_loops(island)) if k == 0 or _is_open(island.uv[loop])]
    return Chart(
        rows @ island.uv, rows @ identity(n, format="csr")[island.vertex],
        _fold_weight(sampled) * np.where(on_border, BORDER_WEIGHT, 1.0), rows @ _spacing(island), sampled > 0.5,
        [island.uv[loop] for loop in around], [island.vertex[loop] for loop in around],
        [c for loop in around[1:] if (c := slit_of(island.uv[loop])) is not None],
        _slopes(mesh, island, SLOPE_WEIGHT * _fold_weight(fold), downweight_slivers=downweight_slivers),
        _between(island, n, fold),
    )  # fmt: skip


def _slopes(mesh: FitMesh, island: Island, weight: Floats, *, downweight_slivers: bool) -> Slopes:
    slopes = face_slopes(island, len(mesh.vertices), weight, downweight_slivers=downweight_slivers)
    trust = slope_trust(mesh.vertices[island.vertex], island.faces) if downweight_slivers else 1.0
    return replace(slopes, weight=slopes.weight * trust)


def _is_open(ring: Floats) -> bool:
    """Whether a loop (k, 2) is a hole in (u, v): at least three of its points differ from the one before. Vertices of a
    rim may share their texture coordinates."""
    return int((ring != np.roll(ring, 1, axis=0)).any(axis=1).sum()) >= 3


def _between(island: Island, vertices: int, fold: Floats) -> Places:
    """Places inside every triangle, and along the border a quarter of an edge from either end."""
    tri, loops = triangles(island.faces), boundary_loops(island)
    rim = np.concatenate([np.zeros((0, 2), np.int64), *(np.column_stack([x, np.roll(x, -1)]) for x in loops)])
    inside = [_mix(tri, np.roll(INNER_WEIGHTS, k), len(island.uv)) for k in range(3)]
    along = [_mix(rim, share, len(island.uv)) for share in (EDGE_WEIGHTS, EDGE_WEIGHTS[::-1])]
    rows = vstack([*inside, *along]).tocsr()
    mix = rows @ identity(vertices, format="csr")[island.vertex]
    return Places(rows @ island.uv, mix, PLACE_SPACING * (rows @ _spacing(island)), rows @ fold > 0.5)


def _mix(corner: Ints, share: Floats, points: int) -> csr_matrix:
    """(r, points) sparse rows with the weights ``share (k,)`` at the columns ``corner (r, k)``."""
    rows = np.repeat(np.arange(len(corner)), corner.shape[1])
    return csr_matrix((np.tile(share, len(corner)), (rows, corner.ravel())), shape=(len(corner), points))


def _fold_weight(fold: Floats) -> Floats:
    """Weights of points that lie in a fold by 0 (outside) to 1 (deep in it)."""
    return FOLD_WEIGHT + (1 - FOLD_WEIGHT) * (1 - fold)


def slit_of(loop: Floats) -> Cut | None:
    """The centre line of a low, wide hole; None for a hole of any other form, and for one that is a point in (u, v)."""
    (u0, v0), (u1, v1) = loop.min(axis=0), loop.max(axis=0)
    if v1 - v0 > MAX_SLIT_ASPECT * (u1 - u0) or u1 - u0 < MIN_SLIT_LENGTH:
        return None
    return Cut(0.5 * (v0 + v1), u0, u1)


def in_tile(island: Island, k: int) -> Island:
    """An island in the k-th tile of (u, v), mirrored where its normals would point inwards."""
    a, b, c = (island.uv[island.faces[:, k]] for k in range(3))
    clockwise = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]).sum() < 0
    uv = island.uv * ([-1.0, 1.0] if clockwise else [1.0, 1.0])
    low, high = uv.min(axis=0), uv.max(axis=0)
    uv = (uv - low) / max(float((high - low).max()), 1e-12) + [TILE * k, 0.0]
    return Island(island.vertex, uv, island.faces)


def _sample_rows(island: Island) -> tuple[csr_matrix, Bools]:
    """Rows over the island's points: vertices, face centres, border edge centres; and which lie on a border."""
    m, f = len(island.uv), island.faces
    corners = np.where(f >= 0, f, 0)
    share = (f >= 0) / (f >= 0).sum(axis=1, keepdims=True)
    rows = np.repeat(np.arange(len(f)), 4)
    centres = csr_matrix((share.ravel(), (rows, corners.ravel())), shape=(len(f), m))
    loops, none = boundary_loops(island), np.zeros(0, np.int64)
    a, b = np.concatenate([none, *loops]), np.concatenate([none, *(np.roll(x, -1) for x in loops)])
    at = np.concatenate([np.arange(len(a))] * 2)
    edges = csr_matrix((np.full(2 * len(a), 0.5), (at, np.concatenate([a, b]))), shape=(len(a), m))
    border = np.concatenate([np.isin(np.arange(m), a), np.zeros(len(f), bool), np.ones(len(a), bool)])
    return vstack([identity(m), centres, edges]).tocsr(), border


def _spacing(island: Island) -> Floats:
    """(m, 2): the longest step in u and in v along any edge at each point."""
    a, b = directed_edges(island.faces)
    step = np.abs(island.uv[a] - island.uv[b])
    out = np.zeros_like(island.uv)
    for ends in (a, b):
        np.maximum.at(out, ends, step)
    return out


def _fold(mesh: FitMesh, island: Island) -> Floats:
    """(m,) how deep each point lies in a fold, 0..1: where a small area of (u, v) holds much surface."""
    f = island.faces
    area3 = face_areas(mesh.vertices[island.vertex], f)
    area2 = face_areas(np.pad(island.uv, ((0, 0), (0, 1))), f)
    stretch = np.sqrt(area3 / np.maximum(area2, 1e-12))
    if not stretch.any():
        return np.zeros(len(island.uv))
    low, high = np.array(FOLD_STRETCH) * np.median(stretch[stretch > 0])
    depth = np.clip((stretch - low) / (high - low), 0, 1)
    used = f >= 0
    total = np.bincount(f[used], np.repeat(depth, used.sum(axis=1)), len(island.uv))
    return total / np.maximum(np.bincount(f[used], minlength=len(island.uv)), 1)


@dataclass(frozen=True)
class Slopes:
    """Derivatives that the surface should have at the faces of a chart.

    uv : (f, 2) face centres; span : (f, 2) a face's extent in u and in v.
    mix_u, mix_v : (f, n) sparse; times the mesh's n vertices: what a surface's S_u, S_v times span should be.
    weight : (f,) in least squares. corners : (f, 4, 2) of the faces in (u, v); the centre where there is no fourth.
    turn_u, turn_v : (4 f, n) sparse, a row for each corner: how the slope of a surface that is smooth across the mesh's
        edges turns from the face to there: the mean of the faces around less the face's own; 0 for a fourth of three.
    rim : (4 f,) the mesh's vertex at corners on the border of the chart, -1 at others.
    """

    uv: Floats
    span: Floats
    mix_u: csr_matrix
    mix_v: csr_matrix
    weight: Floats
    corners: Floats = field(default_factory=lambda: np.zeros((0, 4, 2)))
    turn_u: csr_matrix = field(default_factory=lambda: csr_matrix((0, 0)))
    turn_v: csr_matrix = field(default_factory=lambda: csr_matrix((0, 0)))
    rim: Ints = field(default_factory=lambda: np.zeros(0, np.int64))


def face_slopes(island: Island, vertices: int, weight: Floats, *, downweight_slivers: bool = False) -> Slopes:
    """Slopes of an island of a mesh with ``vertices`` vertices; ``weight (m,)`` of its points.

    With ``downweight_slivers`` a face counts as far as its form determines its slope. Corners that lie nearly on one
    line in (u, v) hardly determine the slope across it: the variance is larger by the variance inflation factor
    1 / (1 - r^2), with r the correlation of u and v over the corners, so the weight is multiplied by 1 - r^2.
    """
    used = island.faces >= 0
    corner = np.where(used, island.faces, 0)
    uv = island.uv[corner] * used[..., None]
    centre = uv.sum(axis=1) / used.sum(axis=1)[:, None]
    offset = (island.uv[corner] - centre[:, None]) * used[..., None]
    moments = np.einsum("fki,fkj->fij", offset, offset)
    moments += 1e-9 * np.trace(moments, axis1=1, axis2=2)[:, None, None] * np.eye(2) + 1e-18 * np.eye(2)
    gradient = np.einsum("fij,fkj->fki", np.linalg.inv(moments), offset)
    span = np.sqrt(np.einsum("fki,fki->fi", offset, offset))
    place, shape = (np.repeat(np.arange(len(corner)), 4), island.vertex[corner].ravel()), (len(corner), vertices)
    mix_u, mix_v = (csr_matrix(((gradient[..., i] * span[:, i, None]).ravel(), place), shape=shape) for i in (0, 1))
    decided = np.linalg.det(moments)  # above 0 also without extent in u or v, where full weight does no harm
    trust = decided / np.maximum((span**2).prod(axis=1), decided) if downweight_slivers else np.ones(len(corner))
    weight = trust * np.where(used, weight[corner], np.inf).min(axis=1)
    area = face_areas(np.pad(island.uv, ((0, 0), (0, 1))), island.faces)
    turn = _to_corners(island.faces, np.maximum(weight * area, 1e-9 * float((weight * area).max(initial=1e-9))))
    slope = (csr_matrix((gradient[..., i].ravel(), place), shape=shape) for i in (0, 1))
    turn_u, turn_v = ((diags(np.repeat(span[:, i], 4)) @ turn @ s).tocsr() for i, s in enumerate(slope))
    return Slopes(centre, span, mix_u, mix_v, weight, centre[:, None] + offset, turn_u, turn_v, _rim(island))


def _rim(island: Island) -> Ints:
    """(4 f,) the mesh's vertex at corners of faces on a border of the island, -1 at others."""
    border = np.zeros(len(island.uv) + 1, bool)
    border[np.concatenate([np.zeros(0, np.int64), *boundary_loops(island)])] = True
    return np.where(border[island.faces], island.vertex[island.faces], -1).ravel()


def _to_corners(faces: Ints, share: Floats) -> csr_matrix:
    """(4 f, f): from what faces (f, 4) have to what is at their corners, the mean of the faces around weighted by
    ``share (f,)``, less what the face has itself."""
    used, face = (faces >= 0).ravel(), np.repeat(np.arange(len(faces)), 4)
    point, row = faces.ravel()[used], np.flatnonzero(used)
    around = csr_matrix((share[face[used]], (point, face[used])), shape=(int(faces.max(initial=-1)) + 1, len(faces)))
    mean = diags(1.0 / np.maximum(np.asarray(around.sum(axis=1)).ravel(), 1e-300)) @ around
    corner, own = (
        csr_matrix((np.ones(len(row)), (row, of)), shape=(len(used), most))
        for of, most in ((point, mean.shape[0]), (face[used], len(faces)))
    )
    return (corner @ mean - own).tocsr()


def join_slopes(parts: list[Slopes]) -> Slopes:
    """The slopes of several islands as one."""
    sparse = ("mix_u", "mix_v", "turn_u", "turn_v")
    mix_u, mix_v, turn_u, turn_v = (vstack([getattr(p, k) for p in parts]).tocsr() for k in sparse)
    keys = ("uv", "span", "weight", "corners", "rim")
    uv, span, weight, corner, rim = (np.concatenate([getattr(p, k) for p in parts]) for k in keys)
    return Slopes(uv, span, mix_u, mix_v, weight, corner, turn_u, turn_v, rim)
