"""Light control points: added to a part of a head, they do not change its surface until they are moved.

A light control point has knots of its own and little weight, :data:`WEIGHT`, and lies on the surface S. With W the sum
of all b w and N the numerator of Eq. (1), it turns N / W into (N + b w P) / (W + b w), a change by b w (P - S) / (W + b
w) which is less than WEIGHT times the distance over which b reaches, 0.0002 mm where that is 2 mm. A move of it by D
adds b w D to the numerator and nothing to the denominator, as in Eq. (2): to move the skin by d it is moved by d W / (b
w), far away from the face. In the limit of no weight it is the infinite control point of Piegl, "On the use of infinite
control points in CAGD" (1987), whose displacement is a pure addition to the numerator.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from surface.base.arrays import Array, Floats, Ints
from surface.head.model.data import Group, HeadData, PartData
from surface.head.model.finer_mesh import FinerMesh
from surface.head.model.meshes import make_surface, tessellate, unpack
from surface.mesh.mesh import Mesh
from surface.mesh.splitedges import split_edges

WEIGHT = 1e-4
MAX_EDGE = 0.5  # of triangles that such points influence, in spans of their knots
REACH = 1.7  # distance from a point's middle within which edges are split, in spans
MAX_ROUNDS = 6  # of splitting edges; each halves them
MIN_EDGE_MM = 0.25  # no edge is split that is shorter than twice this
Coarser = Callable[[str, Mesh], Mapping[str, Ints]]
_SAMPLES = np.array([0.0, 0.25, 0.5, 0.75, 1.0])


@dataclass(frozen=True, eq=False)
class LightPoints:
    """Light control points of one part.

    part : its name. knots_u, knots_v : (k, 5) knots of cubic blending functions, ascending.
    """

    part: str
    knots_u: Floats
    knots_v: Floats

    def __len__(self) -> int:
        return len(self.knots_u)

    @property
    def centres(self) -> Floats:
        """(k, 2) u and v of their middles."""
        return np.column_stack([self.knots_u[:, 2], self.knots_v[:, 2]])

    def take(self, which: Ints) -> LightPoints:
        """Return some of them."""
        return LightPoints(self.part, self.knots_u[which], self.knots_v[which])


def join_light(points: Sequence[LightPoints]) -> dict[str, LightPoints]:
    """Return all light points by part, in their order."""
    names = dict.fromkeys(each.part for each in points)
    return {
        name: LightPoints(
            name,
            np.concatenate([each.knots_u for each in points if each.part == name]),
            np.concatenate([each.knots_v for each in points if each.part == name]),
        )
        for name in names
    }


def with_light(
    data: HeadData, points: Sequence[LightPoints], coarser: Coarser = lambda name, mesh: {}
) -> tuple[HeadData, dict[str, Refined]]:  # fmt: skip
    """Return the head with light control points behind those of each part, and the meshes of these parts, made finer
    there.

    coarser : fewer triangles (t, 3) over the mesh of a part, by level; they are made finer, too.

    Raises ValueError: no such part, a rigid or closed one, knots of a wrong shape or that do not rise, or a place where
    the part has no surface.
    """
    refined: dict[str, Refined] = {}
    parts = {part.name: part for part in data.parts}
    for name, own in join_light([each for each in points if len(each)]).items():
        if name not in parts:
            raise ValueError(f"the head has no part {name!r}")
        part = parts[name]
        check_light(part, own)
        surface = make_surface(part)
        mesh = unpack(part.mesh, surface, part.budget, rough=False, flip=part.flip)
        mesh = mesh or tessellate(part, surface, data.seams)
        refined[name] = Refined(mesh, own, part, coarser(name, mesh))
        grown = with_points(part, own)
        parts[name] = replace(grown, mesh=refined[name].pack_finer(grown))
    return replace(data, parts=list(parts.values())), refined


def check_light(part: PartData, own: LightPoints) -> None:
    """Raise ValueError if light points cannot belong to a part."""
    if part.follows != "skin" or part.closed_u is not None or part.closed_v is not None:
        raise ValueError(f"part {part.name!r} takes no control points: it is rigid, or closed")
    for name in ("knots_u", "knots_v"):
        knots = getattr(own, name)
        if knots.ndim != 2 or knots.shape[1] != 5 or not np.isfinite(knots).all():
            raise ValueError(f"{name}: must be rows of 5 finite numbers")
        if not (np.diff(knots, axis=1) > 0.0).all():
            raise ValueError(f"{name}: must rise")
    surface = make_surface(part)
    u0, u1, v0, v1 = surface.rect
    at = own.centres
    inside = (at[:, 0] >= u0) & (at[:, 0] <= u1) & (at[:, 1] >= v0) & (at[:, 1] <= v1)
    if not (inside.all() and surface.covered(at).all()):
        raise ValueError("a control point lies where the part has no surface")


def with_points(part: PartData, own: LightPoints) -> PartData:
    """Return the part with the points behind its own: on the surface, and following every group and the jaw as it
    does.
    """
    surface = make_surface(part)
    share, n, k = surface.basis_matrix(own.centres).tocsr(), surface.n, len(own)
    width = part.knots_u.shape[1]
    return replace(
        part,
        points=np.concatenate([part.points, share @ part.points]),
        weights=np.concatenate([part.weights, np.full(k, WEIGHT)]),
        knots_u=np.concatenate([part.knots_u, _pad(own.knots_u, width)]),
        knots_v=np.concatenate([part.knots_v, _pad(own.knots_v, part.knots_v.shape[1])]),
        degrees=np.concatenate([part.degrees, np.full((k, 2), 3)]),
        groups=[_carry_group(group, share, n) for group in part.groups],
        jaw=np.concatenate([part.jaw, share @ part.jaw]),
        lids=np.concatenate([part.lids, np.zeros(k)]),  # who is far from the face keeps no distance from the eyeball
    )


def _pad(knots: Floats, width: int) -> Floats:
    return np.hstack([knots, np.repeat(knots[:, -1:], width - knots.shape[1], axis=1)])


def _carry_group(group: Group, share: Array, n: int) -> Group:
    """Return a group that moves new points as the surface at their middles."""
    field = np.zeros((n, 3))
    field[group.ids] = group.moves
    extra = share @ field
    moved = np.flatnonzero(np.abs(extra).max(axis=1) > 1e-3)
    if not len(moved):
        return group
    ids, moves = np.concatenate([group.ids, n + moved]), np.concatenate([group.moves, extra[moved]])
    return Group(group.name, ids.astype(np.int32), moves.astype(np.float32))


class Refined(FinerMesh):
    """A part's mesh with shorter edges where light points reach: its vertices keep their numbers, new ones follow.

    mesh : the mesh before. own : the points. part : without them. coarser : fewer triangles over the mesh, by level.

    Attributes
    ----------
    triangles : (t, 3) of the finer mesh. coarser : those by level, as fine where light points reach.
    """

    def __init__(self, mesh: Mesh, own: LightPoints, part: PartData, coarser: Mapping[str, Ints]) -> None:
        super().__init__(mesh, part)
        self._own = own
        self._spans = np.column_stack([np.diff(k, axis=1).mean(axis=1) for k in (own.knots_u, own.knots_v)])
        _, along_u, along_v = self._surface.derivatives(own.centres)
        millimetres = np.column_stack([np.linalg.norm(along_u, axis=1), np.linalg.norm(along_v, axis=1)])
        self._longest = np.maximum(MAX_EDGE * (self._spans * millimetres).min(axis=1), 2 * MIN_EDGE_MM)
        self.triangles = self._refine(np.asarray(mesh.triangles, np.int64))
        inner = {level: (each < self._count).all(axis=1) for level, each in coarser.items()}
        finer = {level: self._refine(np.asarray(each[inner[level]], np.int64)) for level, each in coarser.items()}
        self.coarser = {
            level: np.concatenate([finer[level], self._behind_new(each[~inner[level]])])
            for level, each in coarser.items()
        }

    def _refine(self, triangles: Ints) -> Ints:
        """Return triangles (t', 3) with shorter edges where light points reach, of (t, 3) over the mesh's own vertices.
        Both triangles of an edge that they reach are near; the others, which are most, are not looked at."""
        near = self._near(self._uv[triangles])
        others, triangles = triangles[~near], triangles[near]
        for _ in range(MAX_ROUNDS if len(triangles) else 0):
            before = len(triangles)
            triangles = split_edges(triangles, self._is_long, self._middles)
            self._place()
            if len(triangles) == before:
                break
        return np.concatenate([others, triangles])

    def _near(self, places: Floats) -> np.ndarray:
        """Return (t,): which of polygons (t, k, 2) lie, by their boxes, where all light points together reach."""
        reach, centres = REACH * self._spans, self._own.centres
        low, high = (centres - reach).min(axis=0), (centres + reach).max(axis=0)
        near: np.ndarray = ((places.min(axis=1) < high) & (places.max(axis=1) > low)).all(axis=1)
        return near

    def _is_long(self, edges: Ints) -> np.ndarray:
        """Return (e,): which edges reach a light point and are longer than there is use for."""
        length = np.linalg.norm(self._places[edges[:, 0]] - self._places[edges[:, 1]], axis=1)
        ends = self._uv[edges]
        reach, centres = REACH * self._spans, self._own.centres
        near = np.flatnonzero(self._near(ends) & (length > self._longest.min()))
        out = np.zeros(len(edges), bool)
        for first in range(0, len(near), 4096):
            which = near[first : first + 4096]
            at = ends[which, :1] + _SAMPLES[None, :, None] * (ends[which, 1:] - ends[which, :1])  # (e, 5, 2)
            far = np.abs(at[:, :, None] - centres) / reach  # (e, 5, k, 2)
            inside = far.max(axis=-1).min(axis=1) < 1.0
            out[which] = (inside & (length[which, None] > self._longest)).any(axis=1)
        return out

    def _lists(self, count: int) -> list[Array]:
        """Return, by cell of the mesh, its points and the light points that reach it."""
        boxes, _ = self.mesh.cell_boxes
        first = count - len(self._own)
        u, v = self._own.knots_u, self._own.knots_v
        lists = []
        for c, (u0, u1, v0, v1) in enumerate(boxes.tolist()):
            reached = (u[:, 0] <= u1) & (u[:, -1] >= u0) & (v[:, 0] <= v1) & (v[:, -1] >= v0)
            lists.append(np.concatenate([self.mesh.points_of(c), first + np.flatnonzero(reached)]))
        return lists
