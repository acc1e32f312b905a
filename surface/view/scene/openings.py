"""Positions of lids, lips and eyeballs in the current pose, as uniforms for the shaders of eyes and mouth.

The eye's shader darkens the eyeball under the upper lid and draws the wet line on the lower one; the mouth's shader
lights teeth and tongue by the light that enters between the lips. So blinks and gaze are shaded without a shadow map.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from surface.head.model.data import Contact
from surface.head.model.face import face_of
from surface.mesh.mesh import border_edges
from surface.view.scene.folds import Fold, fold_over
from surface.view.scene.parts import ViewPart
from surface.view.scene.wrinkles import Wrinkles

#: Points of one lid that the eye's shader gets.
LID_POINTS = 10
#: How far from the skin's edge a lid's margin may lie, and the width of the column that is searched for it, mm.
_MARGIN_MM = 7.0
_COLUMN_MM = 1.6
_INNER = ("teeth", "tongue", "gums", "mouth")
#: Vertices of an eyeball that its rotation is computed from.
_SAMPLES = 48
#: Attributes that are painted all over an eyeball.
_PAINTED = ("iris", "sclera", "iris_radius", "texture_rectangle")
#: How far, in eyeball radii, a lid loop's mean may lie from the eyeball's centre.
_LID_REACH = 2.0
#: How far, millimetres, the lips' mean may lie from the front of the teeth.
_LIP_REACH = 45.0
#: The skin ends inside the lips; the light enters this far in front of its edge, mm.
_LIP_DEPTH = 14.0
#: Share of the edge's area at rest that is still hidden behind closed lips.
_SHUT = 0.9
#: Half the mouth's width, a little less: how far the opening counts to either side.
_SLIDE = 0.38
_FALLBACK_AREA = (0.0, 0.0, 250.0)
_FALLBACK_MOUTH = {
    "opening_centre": (0.0, -35.0, 110.0), "opening_area": _FALLBACK_AREA, "opening_side": (18.0, 0.0, 0.0),
}  # fmt: skip

Read = Callable[[ViewPart, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Aperture:
    """An opening in a part.

    loop : (k,) vertex ids around the opening, in order, first = corner with the least x.
    upper, lower : (LID_POINTS,) vertex ids along either edge, from the corner with the least x to the other.
    """

    loop: np.ndarray
    upper: np.ndarray
    lower: np.ndarray


@dataclass(frozen=True)
class EyeFrame:
    """Maps vertices of an eyeball to its rotation.

    local : (m, 3) float32 unit directions in the eye's own frame, +z through the pupil.
    ids : (k,) vertices used.
    solve : (4, k) maps their positions to rotation times radius and centre (least squares).
    lids : the skin's opening over it, or None.
    painted : what is painted on the eyeball, (k,) by attribute: "iris" and "sclera", colours, "iris_radius", and
        "texture_rectangle", where in the head's texture it is.
    """

    local: np.ndarray
    ids: np.ndarray
    solve: np.ndarray
    lids: Aperture | None
    painted: Mapping[str, np.ndarray] = field(default_factory=dict)


_LINE_MM = 1.1  # half the width of the line where the lips meet


class Openings:
    """Lids, lips and eyeballs of a head.

    parts : the head's parts, at rest.
    read : gives the positions (k, 3) of vertices (k,) of a part as posed now.
    contacts : of the head, which say which part is the face.

    Attributes
    ----------
    pupil : share by which pupils are now wider than the theme's light makes them.
    wrinkles : of the head, whose floors are darker; set by who draws it, None without any.
    """

    def __init__(
        self, parts: Sequence[ViewPart], read: Read = lambda part, ids: part.vertices[ids],
        contacts: Sequence[Contact] = (),
    ) -> None:  # fmt: skip
        self._read = read
        self.pupil = 0.0
        self.wrinkles: Wrinkles | None = None
        self._skin, loops = _face_with_loops(parts, contacts)
        self._eyes = {p.name: self._eye(p, loops) for p in parts if p.material == "eye"}
        self._lips = self._find_lips(parts, loops)
        self.lip_tint = lip_tint(self._skin)
        self._folds = self._find_folds()
        area = np.array(_FALLBACK_AREA)
        if self._lips is not None and self._skin is not None:
            area = vector_area(self._read(self._skin, self._lips.loop))
        self._shut_area = _SHUT * float(np.linalg.norm(area))
        self.refresh()

    def read_vertices(self) -> dict[str, np.ndarray]:
        """Vertices (k,) whose positions are needed, by part."""
        found = {name: frame.ids for name, frame in self._eyes.items()}
        edges = [edge for edge in (*(frame.lids for frame in self._eyes.values()), self._lips) if edge is not None]
        if self._skin is not None and edges:
            folds = [fold.ids for fold in self._folds if fold is not None]
            of_edges = [i for e in edges for i in (e.loop, e.upper, e.lower)]
            found[self._skin.name] = np.unique(np.concatenate([*of_edges, *folds]))
        return found

    def _find_folds(self) -> tuple[Fold | None, Fold | None]:
        """The folds over the left eye, at x above 0, and the right one; none where the skin is painted without."""
        found: list[Fold | None] = [None, None]
        painted = None if self._skin is None else self._skin.attributes.get("fold")
        if self._skin is None or painted is None or not painted[:, 0].any():
            return None, None
        for lids in (frame.lids for frame in self._eyes.values() if frame.lids is not None):
            vertices = np.asarray(self._skin.vertices, float)
            side = int(vertices[lids.upper, 0].mean() < 0.0)
            found[side] = fold_over(vertices, lids.upper, lids.lower, np.asarray(painted, float))
        return found[0], found[1]

    @property
    def folded(self) -> bool:
        """Whether upper lids have a fold."""
        return any(fold is not None for fold in self._folds)

    def fold_at(self, part: ViewPart) -> np.ndarray:
        """Where a part's vertices are relative to the lids' folds, (m, 2) float32: height over the crease, mm, and how
        deep it is there, below 0 at the right eye."""
        out = np.zeros((len(part.vertices), 2), np.float32)
        if self._skin is None or part.name != self._skin.name:
            return out
        for fold, sign in zip(self._folds, (1.0, -1.0), strict=True):
            if fold is not None:
                own = sign * np.asarray(part.vertices)[:, 0] > 0.0
                out[own] = fold.at[own] * (1.0, sign)
        return out

    def fold_left(self) -> tuple[float, float]:
        """How deep the folds of the left and the right lid are now, of what they are at rest."""
        left = [0.0 if f is None or self._skin is None else f.left(self._read(self._skin, f.ids)) for f in self._folds]
        return left[0], left[1]

    def _eye(self, part: ViewPart, loops: list[np.ndarray]) -> EyeFrame:
        """Frame and lids of one eyeball."""
        vertices = np.asarray(part.vertices, float)
        centre, radius = fit_sphere(vertices)
        local = np.asarray(part.attributes.get("eye_local", (vertices - centre) / radius), np.float32)
        ids = np.unique(np.linspace(0, len(vertices) - 1, min(_SAMPLES, len(vertices))).astype(int))
        solve = np.linalg.pinv(np.column_stack([local[ids], np.ones(len(ids))]))
        lids = None
        if self._skin is not None:
            loop = nearest_loop(loops, self._skin.vertices, centre, _LID_REACH * radius)
            lids = None if loop is None else _lids(loop, np.asarray(self._skin.vertices, float), centre)
        painted = {k: np.asarray(part.attributes[k])[0] for k in _PAINTED if k in part.attributes}
        return EyeFrame(local, ids, solve, lids, painted)

    def _find_lips(self, parts: Sequence[ViewPart], loops: list[np.ndarray]) -> Aperture | None:
        """The skin's opening nearest to the front of the mouth's inner parts."""
        inner = [np.asarray(p.vertices) for material in _INNER for p in parts if p.material == material]
        if not inner or self._skin is None:
            return None
        front = max((vertices[np.argmax(vertices[:, 2])] for vertices in inner), key=lambda point: point[2])
        taken = [eye.lids.loop[0] for eye in self._eyes.values() if eye.lids is not None]
        free = [loop for loop in loops if not np.isin(taken, loop).any()]
        loop = nearest_loop(free, self._skin.vertices, np.array([0.0, *front[1:]]), _LIP_REACH)
        return None if loop is None else aperture(loop, self._skin.vertices)

    def local(self, part: ViewPart) -> np.ndarray:
        """Directions of an eye part's vertices in the eye's own frame, (m, 3) float32."""
        return self._eyes[part.name].local

    def painted(self, part: ViewPart) -> Mapping[str, np.ndarray]:
        """What is painted on an eye part, (k,) by attribute: one value for all of it."""
        return self._eyes[part.name].painted

    def eye(self, part: ViewPart) -> dict[str, object]:
        """Uniforms of an eye now: its rotation and its lid margins."""
        frame = self._eyes[part.name]
        columns = (frame.solve @ self._read(part, frame.ids))[:3].T
        rotation = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-9)
        if frame.lids is None or self._skin is None:
            none = np.zeros((LID_POINTS, 3), np.float32)
            return {"eye_rotation": rotation, "lid_upper": none, "lid_lower": none, "lids": 0.0}
        upper, lower = self._read(self._skin, frame.lids.upper), self._read(self._skin, frame.lids.lower)
        return {"eye_rotation": rotation, "lid_upper": upper, "lid_lower": lower, "lids": 1.0}

    def lip_line(self, part: ViewPart) -> np.ndarray:
        """How near a part's vertices at rest are to the line where the lips meet, (m,): 1 on it, 0 some mm away."""
        vertices = np.asarray(part.vertices, float)
        if self._lips is None or self._skin is None or part.name != self._skin.name:
            return np.zeros(len(vertices))
        edges = [vertices[ids] for ids in (self._lips.upper, self._lips.lower)]
        x = vertices[:, 0]
        middle = np.mean([np.interp(x, edge[:, 0], edge[:, 1]) for edge in edges], axis=0)
        ends = np.clip((edges[0][-1, 0] - np.abs(x)) / _LINE_MM, 0.0, 1.0)
        front = np.clip((vertices[:, 2] - edges[0][:, 2].min()) / _LINE_MM, 0.0, 1.0)
        near: np.ndarray = np.exp2(-(((vertices[:, 1] - middle) / _LINE_MM) ** 2)) * ends * front
        return near

    def mouth(self) -> dict[str, object]:
        """Uniforms of the opening between the lips: centre and vector area, mm and mm^2."""
        return self._mouth

    def refresh(self) -> None:
        """Compute the mouth's uniforms, once after each pose: five materials need them."""
        self._mouth: dict[str, object] = dict(_FALLBACK_MOUTH)
        if self._lips is None or self._skin is None:
            return
        ring = self._read(self._skin, self._lips.loop)
        area = -vector_area(ring)  # the edge of a hole runs clockwise, seen from where its triangles face to
        size = max(math.hypot(*area), 1e-6)
        first, *_, last = self._read(self._skin, self._lips.upper)
        self._mouth = {
            "opening_centre": ring.mean(axis=0) + area * (_LIP_DEPTH / size),
            "opening_area": area * (max(size - self._shut_area, 20.0) / size),
            "opening_side": (last - first) * _SLIDE,
        }


def _face_with_loops(
    parts: Sequence[ViewPart], contacts: Sequence[Contact]
) -> tuple[ViewPart | None, list[np.ndarray]]:
    """The skin that is the face, and the loops of its holes. Without contacts it is the one that holds the most lids:
    a head of a surface file may have its eye openings in another part than the one called "face"."""
    loops = {id(p): boundary_loops(p.triangles) for p in parts if p.material == "skin"}
    face = face_of(parts, contacts)
    if face is None:
        return None, []
    if not contacts and len(loops) > 1:
        eyes = [fit_sphere(np.asarray(p.vertices, float)) for p in parts if p.material == "eye"]

        def held(skin: ViewPart) -> int:
            near = (nearest_loop(loops[id(skin)], skin.vertices, at, _LID_REACH * radius) for at, radius in eyes)
            return sum(loop is not None for loop in near)

        face = max((p for p in parts if id(p) in loops), key=lambda p: (held(p), p is face))
    return face, loops[id(face)]


def _lids(loop: np.ndarray, vertices: np.ndarray, centre: np.ndarray) -> Aperture:
    """The margins of both lids over an eyeball."""
    edge = aperture(loop, vertices)
    upper = leading_edge(edge.upper, edge.lower, vertices, centre, 1.0)
    return replace(edge, upper=upper, lower=leading_edge(edge.lower, edge.upper, vertices, centre, -1.0))


def fit_sphere(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Least-squares sphere of `points` (m, 3): centre (3,) and radius, mm."""
    system = np.column_stack([2.0 * points, np.ones(len(points))])
    solution = np.linalg.lstsq(system, (points**2).sum(axis=1), rcond=None)[0]
    centre = solution[:3]
    return centre, float(np.sqrt(max(solution[3] + centre @ centre, 1e-9)))


def boundary_loops(triangles: np.ndarray) -> list[np.ndarray]:
    """Closed loops (k,) of vertex ids along the edges that only one of `triangles` (t, 3) has.

    Loops that meet themselves are not found.
    """
    following = dict(border_edges(np.asarray(triangles)).tolist())
    loops = []
    while following:
        start, current = following.popitem()
        loop = [start]
        while current != start and current in following:
            loop.append(current)
            current = following.pop(current)
        if current == start and len(loop) >= 6:
            loops.append(np.array(loop, np.int64))
    return loops


def aperture(loop: np.ndarray, vertices: np.ndarray) -> Aperture:
    """Split a boundary loop (k,) at its corners (least and greatest x) into upper and lower edge.

    `vertices` (m, 3) are positions at rest, head not turned.
    """
    loop = np.roll(loop, -int(np.argmin(vertices[loop, 0])))
    corner = int(np.argmax(vertices[loop, 0]))
    first, second = loop[: corner + 1], np.append(loop[corner:], loop[0])[::-1]
    if vertices[first, 1].mean() < vertices[second, 1].mean():
        first, second = second, first
    return Aperture(loop, _evenly_spaced(first, vertices), _evenly_spaced(second, vertices))


def _evenly_spaced(path: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """LID_POINTS ids of `path` (k,), evenly spaced by length."""
    steps = np.linalg.norm(np.diff(vertices[path], axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    at = np.searchsorted(along, np.linspace(0.0, along[-1], LID_POINTS))
    return path[np.clip(at, 0, len(path) - 1)]


def leading_edge(
    path: np.ndarray, other: np.ndarray, vertices: np.ndarray, centre: np.ndarray, side: float
) -> np.ndarray:
    """The vertices (k,) of a lid that reach furthest over the eyeball, next to the skin's own edge.

    The skin ends behind the lid's margin, out of sight; the margin is lowest (upper lid) or highest (lower lid) seen
    from the eyeball's centre.

    path, other : (k,) vertex ids along the skin's edge, on this lid and on the other one.
    vertices : (m, 3) positions at rest.
    centre : (3,) of the eyeball.
    side : +1 for an upper, -1 for a lower lid.
    """
    offset = vertices - centre
    slope = side * offset[:, 1] / np.maximum(offset[:, 2], 1e-6)
    heights = [np.interp(vertices[:, 0], vertices[edge, 0], vertices[edge, 1]) for edge in (path, other)]
    middle = 0.5 * (heights[0] + heights[1])
    chosen = path.copy()
    for index, vertex in enumerate(path):
        near = np.linalg.norm(vertices - vertices[vertex], axis=1) < _MARGIN_MM
        near &= np.abs(vertices[:, 0] - vertices[vertex, 0]) < _COLUMN_MM
        near &= (offset[:, 2] > 0.0) & (side * (vertices[:, 1] - middle) > 0.0)
        ids = np.flatnonzero(near)
        if len(ids):
            chosen[index] = ids[np.argmin(slope[ids])]
    return chosen


def nearest_loop(loops: list[np.ndarray], vertices: np.ndarray, point: np.ndarray, reach: float) -> np.ndarray | None:
    """The loop whose mean is nearest to `point` (3,), or None if none is within `reach` mm."""
    if not loops:
        return None
    means = np.array([vertices[loop].mean(axis=0) for loop in loops])
    distance = np.linalg.norm(means - point, axis=1)
    best = int(np.argmin(distance))
    return loops[best] if distance[best] <= reach else None


def vector_area(ring: np.ndarray) -> np.ndarray:
    """Vector area (3,) of a closed polygon (k, 3): half the sum of p_i x p_{i+1}, in mm^2."""
    points = np.asarray(ring - ring[0], np.float64)
    # The sum of p x q is the antisymmetric part of the sum of p q^T.
    both = points[:-1].T @ points[1:]
    return 0.5 * np.array([both[1, 2] - both[2, 1], both[2, 0] - both[0, 2], both[0, 1] - both[1, 0]])


def lip_tint(skin: ViewPart | None) -> tuple[float, ...] | None:
    """(3,) how many times the albedo of the skin around them lips have, by channel; None where no lips are painted."""
    lips = None if skin is None else skin.attributes.get("lips")
    if skin is None or lips is None or "albedo" not in skin.attributes:
        return None
    albedo = np.asarray(skin.attributes["albedo"], float)
    on, beside = (albedo[chosen[:, 0]] for chosen in (lips > 0.95, (lips > 0.0) & (lips < 0.1)))
    if not len(on) or not len(beside):
        return None
    return tuple((on.mean(axis=0) / np.maximum(beside.mean(axis=0), 1e-3)).tolist())
