"""Anchor mapping: servos that say where they pull, solved so that the skin goes where the picture's skin goes.

The head is asked once how far each shape moves a few hundred points of its skin, at four amounts between 0 and 1, so
that arcs of jaw and lids are kept; after that a face is a sum of these moves. Each servo moves the skin around its
anchor, and that of its neighbours with it. The pulls are the bounded least squares of what is missing along each pull,
at the anchor and at a few points close to it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from controller.base.errors import ConfigError
from controller.base.parameters import Floats, Parameters
from controller.base.solve import BoundedSolver
from controller.robot.settings import AnchorSettings, ChannelSettings, RobotSettings
from surface.head import Head
from surface.head.model.parameters import SHAPES, read_pose
from surface.head.posing.part import HeadPart

_LEVELS = 4
_STRAIGHT_MM = 0.02
_RIDGE = 1e-3
_SEED = 7
_POINTS = 400  # spread over the skin, for saying what a head cannot show
_NEAR = 6  # at most so many around each anchor, for solving
_NEAR_MM = 8.0


@dataclass(frozen=True)
class Skin:
    """Points of one head's skin and how every shape moves them.

    Attributes
    ----------
    part : the part of the head they lie on. uv : (m, 2). rest : (m, 3) mm.
    moves : (m, 3, s, levels) mm that each of ``s`` shapes adds on each quarter of its way from 0 to 1.
    jaw : (m,) how much of the lower jaw's motion each follows, 0..1.
    """

    part: str
    uv: Floats
    rest: Floats
    moves: Floats
    jaw: Floats

    def displacement(self, shapes: Floats) -> Floats:
        """(m, 3) mm for shapes (s,)."""
        moved: Floats = np.einsum("mcsl,sl->mc", self.moves, steps(shapes))
        return moved

    def full(self, shape: int) -> Floats:
        """(m, 3) mm that one shape moves the points by at 1."""
        moved: Floats = self.moves[:, :, shape].sum(axis=2)
        return moved


def first(skin: Skin, count: int) -> Skin:
    """The first ``count`` points."""
    return Skin(skin.part, skin.uv[:count], skin.rest[:count], skin.moves[:count], skin.jaw[:count])


def steps(shapes: Floats) -> Floats:
    """(s, levels) how much of each quarter of its way a shape has gone."""
    return np.clip(_LEVELS * shapes[:, None] - np.arange(_LEVELS), 0.0, 1.0)


def sample_skin(head: Head, part: str, uv: Floats) -> Skin:
    """Ask a head how its shapes move the points ``uv`` : (m, 2) of a part; its vertices stay as they are.

    Raises
    ------
    KeyError : no such part.
    """
    index = head.parts.index(head.part(part))
    basis = head.part(part).surface.basis_matrix(uv)
    rest = basis @ head.place_points(np.zeros(len(head.parameters)))[0][index]
    shapes = SHAPES
    moves = np.zeros((len(uv), 3, len(shapes), _LEVELS))

    def at(values: dict[str, float]) -> Floats:
        return np.asarray(basis @ head.place_points(head.values(values))[0][index] - rest)

    for s, name in enumerate(shapes):
        way = _way(name, at)
        moves[:, :, s] = np.moveaxis(np.diff(way, axis=0, prepend=np.zeros_like(way[:1])), 0, -1)
    jaw = next(p.jaw for p in head.data.parts if p.name == part)
    return Skin(part, uv, rest, moves, np.asarray(basis @ np.asarray(jaw, np.float64)))


def _way(name: str, at: Callable[[dict[str, float]], Floats]) -> Floats:
    """(levels, m, 3) where one shape alone brings the points. mouthClose works on an open jaw only."""
    base = {"mouthClose": "jawOpen"}.get(name)
    if name == "tongueOut":
        return np.zeros((_LEVELS, *at({}).shape))  # it opens the jaw, which counts as jawOpen

    def one(level: float) -> Floats:
        if base is None:
            return at({name: level})
        return at({name: level, base: level}) - at({base: level})

    half, full = one(0.5), one(1.0)
    if np.abs(half - 0.5 * full).max() < _STRAIGHT_MM:
        return np.array([full * (i + 1) / _LEVELS for i in range(_LEVELS)])
    return np.array([one(0.25), half, one(0.75), full])


def shapes_of(values: Floats, order: NDArray[np.intp]) -> Floats:
    """(s,) shapes of a face ``values`` (p,); ``order`` (h,) leads from omote's parameters to the head's."""
    return read_pose(values[order]).shapes


def head_order(head_names: Sequence[str], parameters: Parameters) -> NDArray[np.intp]:
    """(h,) where each of a head's parameters stands among ``parameters``."""
    return np.array([parameters.index(name) for name in head_names], dtype=np.intp)


def skin_points(head: Head, part: str, count: int, seed: int) -> Floats:
    """(count, 2) points (u, v) drawn evenly over the vertices of a part."""
    uv = head.part(part).mesh.uv
    pick = np.random.default_rng(seed).choice(len(uv), size=min(count, len(uv)), replace=False)
    return np.asarray(uv[np.sort(pick)], dtype=np.float64)


def servo_field(anchors: Sequence[AnchorSettings], at: Skin, points: Skin) -> Floats:
    """(3 m, k): how a millimetre of pull at each anchor moves points of the skin.

    Parameters
    ----------
    anchors : k of them. at : their own points. points : m points.
    """
    field = np.zeros((len(points.rest), 3, len(anchors)))
    for j, anchor in enumerate(anchors):
        way = np.array(anchor.direction) / np.linalg.norm(anchor.direction)
        if anchor.like is not None:
            shape = SHAPES.index(anchor.like)
            field[:, :, j] = points.full(shape) / (at.full(shape)[j] @ way)
            continue
        for side in (1.0, -1.0) if anchor.both else (1.0,):
            mirror = np.array([side, 1.0, 1.0])
            share = _spread(points, at.rest[j] * mirror, at.jaw[j], anchor.reach_mm)
            field[:, :, j] += share[:, None] * way * mirror
    return field.reshape(-1, len(anchors))


def _spread(points: Skin, centre: Floats, jaw: float, reach_mm: float) -> Floats:
    """(m,) share of a pull, 1 at the anchor; skin on the other jaw does not come along."""
    squared = ((points.rest - centre) ** 2).sum(axis=1) / reach_mm**2
    share: Floats = np.clip(1.0 - squared, 0.0, None) ** 2 * (1.0 - np.abs(points.jaw - jaw)).clip(0.0, 1.0)
    return share


@dataclass(frozen=True)
class Rows:
    """What is matched: the displacement of some points of the skin along some pulls, ``r`` of them.

    Attributes
    ----------
    point : (r,) which point. pull : (r,) along which anchor's direction. way : (r, 3) that direction.
    """

    point: NDArray[np.intp]
    pull: NDArray[np.intp]
    way: Floats

    @classmethod
    def around(cls, anchors: Sequence[AnchorSettings], own: Skin, points: Skin, reach_mm: float) -> Rows:
        """Points within ``reach_mm`` of each anchor, on its side of the mouth."""
        found = [
            (i, j)
            for j in range(len(anchors))
            for i in np.flatnonzero(_spread(points, own.rest[j], own.jaw[j], reach_mm) > 0.0)
        ]
        point, pull = np.array(found, dtype=np.intp).reshape(-1, 2).T
        ways = np.array([anchor.direction for anchor in anchors])
        return cls(point, pull, (ways / np.linalg.norm(ways, axis=1, keepdims=True))[pull])

    def along(self, points: Floats) -> Floats:
        """(r, ...) components along the pulls of (m, 3, ...) displacements."""
        components: Floats = np.einsum("rc,rc...->r...", self.way, points[self.point])
        return components

    @property
    def share(self) -> Floats:
        """(r,) weights that let every anchor count the same."""
        return 1.0 / np.sqrt(np.bincount(self.pull)[self.pull])


class AnchorMap:
    """Pulls of all anchored channels of a robot for a face; gives those of ``names`` (see ``Anchors`` in channels).

    Attributes
    ----------
    names : the channels whose pulls it gives. linear : (k, p) mm per unit of each parameter, roughly.
    skin : m points; the first k are the anchors. field : (3 m, k) see :func:`servo_field`.
    """

    def __init__(self, channels: Sequence[ChannelSettings], skin: Skin, order: NDArray[np.intp],
                 parameters: Parameters) -> None:  # fmt: skip
        anchors = [channel.anchor for channel in channels if channel.anchor is not None]
        k = len(anchors)
        own = first(skin, k)
        self.names = tuple(channel.name for channel in channels)
        self.skin, self.field, self._order = skin, servo_field(anchors, own, skin), order
        rows = Rows.around(anchors, own, skin, _NEAR_MM)
        self._moves = rows.along(skin.moves).reshape(len(rows.point), -1)
        low, high = np.array([travel(channel) for channel in channels]).T
        field = rows.along(self.field.reshape(-1, 3, k))
        self._solver = BoundedSolver(field, low, high, weights=rows.share, ridge=_RIDGE, tolerance=1e-5)
        self._last, self._give = np.zeros(k), np.arange(k)
        self._linear = self._all_linear(parameters)
        self.linear = self._linear

    def on(self, names: Sequence[str]) -> AnchorMap | None:
        """The same map, with a memory of its own, giving only the pulls of ``names``; None where it has none."""
        give = [i for i, name in enumerate(self.names) if name in names]
        if not give:
            return None
        other = object.__new__(AnchorMap)
        other.__dict__.update(self.__dict__, names=tuple(self.names[i] for i in give))
        other._give, other._last = np.array(give), self._last.copy()
        other.linear = self._linear[give]
        return other

    def shapes(self, values: Floats) -> Floats:
        """(s,) the head's shapes for parameters (p,)."""
        return shapes_of(values, self._order)

    def pulls(self, values: Floats) -> Floats:
        """(k,) mm of pull for parameters (p,)."""
        self._last = self._solver.solve(self._moves @ steps(self.shapes(values)).ravel(), start=self._last)
        return self._last[self._give]

    def residual(self, values: Floats) -> tuple[Floats, Floats]:
        """(m,) mm each: how far the face ``values`` (p,) moves the points, and how far the servos stay behind it."""
        shapes = self.shapes(values)
        pulls = self._solver.solve(self._moves @ steps(shapes).ravel())
        wanted = self.skin.displacement(shapes)
        left = wanted - (self.field @ pulls).reshape(-1, 3)
        return np.linalg.norm(wanted, axis=1), np.linalg.norm(left, axis=1)

    def _all_linear(self, parameters: Parameters) -> Floats:
        rows = np.zeros((len(self.names), len(parameters)))
        for s, name in enumerate(SHAPES):
            one = np.zeros((len(SHAPES), _LEVELS))
            one[s] = 1.0
            rows[:, parameters.index(name)] = self._solver.solve(self._moves @ one.ravel())
        return rows


def travel(channel: ChannelSettings) -> tuple[float, float]:
    """Pull (mm) at the ends of a channel's map, as far as its limits let it go."""
    at, deg = np.array(channel.map.at), np.array(channel.map.deg) + channel.trim_deg
    inside = at[(deg >= channel.limit_deg[0]) & (deg <= channel.limit_deg[1])]
    return float(inside.min(initial=at[-1])), float(inside.max(initial=at[0]))


def anchored(robot: RobotSettings) -> list[ChannelSettings]:
    """The channels of a robot that say where they pull."""
    return [channel for channel in robot.channels if channel.anchor is not None]


def load_anchors(
    robot: RobotSettings, head: Path | Head, parameters: Parameters, *, where: str = ""
) -> AnchorMap | None:
    """Match a robot's anchors to a head; None for a robot without any.

    Parameters
    ----------
    head : folder of the head, or the head itself, which is left at rest. where : the robot's file, for messages.

    Raises
    ------
    ConfigError : an anchor lies on no part of the head, or does not move with what it is ``like``; names the key.
    SurfaceError : the head cannot be read.
    """
    channels = anchored(robot)
    if not channels:
        return None
    if isinstance(head, Path):
        head = Head.load(head)
    anchors = [channel.anchor for channel in channels if channel.anchor is not None]
    keys = [f"channels[{i}].anchor" for i, channel in enumerate(robot.channels) if channel.anchor is not None]
    _check(keys, anchors, head, where or robot.name)
    part = head.part(anchors[0].part)
    vertices = part.surface.evaluate(part.mesh.uv)  # the mesh's own positions are rough, the part's may be posed
    own = np.array([_place(anchor, robot.landmarks, part, vertices) for anchor in anchors])
    spread = skin_points(head, part.name, _POINTS, _SEED)
    skin = sample_skin(head, part.name, np.concatenate([own, _close_to(own, part, vertices), spread]))
    _check_like(keys, anchors, first(skin, len(own)), where or robot.name)
    return AnchorMap(channels, skin, head_order(head.parameters, parameters), parameters)


def _close_to(own: Floats, part: HeadPart, vertices: Floats) -> Floats:
    """(j, 2) the vertices closest to each of the points ``own`` : (k, 2)."""
    away = [np.linalg.norm(vertices - at, axis=1) for at in part.surface.evaluate(own)]
    chosen = np.unique(np.concatenate([np.argsort(a)[:_NEAR][np.sort(a)[:_NEAR] < _NEAR_MM] for a in away]))
    return np.asarray(part.mesh.uv[chosen], dtype=np.float64)


def _place(anchor: AnchorSettings, landmarks: Mapping[str, list[float]], part: HeadPart, vertices: Floats) -> Floats:
    """(2,) point (u, v) of an anchor."""
    point = landmarks[anchor.point] if isinstance(anchor.point, str) else anchor.point
    if len(point) == 2:
        return np.array(point)
    nearest = int(np.argmin(np.linalg.norm(vertices - np.array(point), axis=1)))
    return np.asarray(part.mesh.uv[nearest], dtype=np.float64)


def _check(keys: Sequence[str], anchors: Sequence[AnchorSettings], head: Head, where: str) -> None:
    parts = [part.name for part in head.parts if part.follows == "skin"]
    faults = [f"{key}.part: {a.part!r} is not a skin part of head {head.name} ({', '.join(parts)})"
              for key, a in zip(keys, anchors, strict=True) if a.part not in parts]  # fmt: skip
    faults += [f"{key}.part: all anchors of a robot lie on one part" for key, a in zip(keys, anchors, strict=True)
               if a.part != anchors[0].part and a.part in parts]  # fmt: skip
    faults += [f"{key}.like: the head has no shape of that name" for key, a in zip(keys, anchors, strict=True)
               if a.like is not None and a.like not in SHAPES]  # fmt: skip
    _raise(faults, where)


def _check_like(keys: Sequence[str], anchors: Sequence[AnchorSettings], at: Skin, where: str) -> None:
    faults = []
    for j, (key, anchor) in enumerate(zip(keys, anchors, strict=True)):
        if anchor.like is not None:
            way = np.array(anchor.direction) / np.linalg.norm(anchor.direction)
            moved = float(at.full(SHAPES.index(anchor.like))[j] @ way)
            if moved < 0.5:
                faults.append(f"{key}.like: {anchor.like} moves the point by {moved:.1f} mm along direction")
    _raise(faults, where)


def _raise(faults: list[str], where: str) -> None:
    if faults:
        raise ConfigError(f"{where}: " + "; ".join(faults), hint=f"mend the file, then: omote check {where}")


def residual_rows(
    found: AnchorMap, faces: Mapping[str, Floats], parameters: Parameters
) -> Iterator[tuple[str, float, float]]:  # fmt: skip
    """What a robot cannot show: region, rms mm wanted, rms mm left over, over some faces (p,)."""
    regions = point_regions(found.skin, parameters)
    both = np.array([found.residual(face) for face in faces.values()])
    for region in sorted(set(regions)):
        wanted, left = np.sqrt((both[:, :, regions == region] ** 2).mean(axis=(0, 2)))
        yield region, float(wanted), float(left)


def point_regions(skin: Skin, parameters: Parameters) -> NDArray[np.str_]:
    """(m,) region of the parameter that moves each point most."""
    most = np.linalg.norm(skin.moves.sum(axis=3), axis=1).argmax(axis=1)
    names = SHAPES
    return np.array([parameters.regions[parameters.index(names[s])] for s in most])
