"""Anchors: solve how far each servo pulls at its point of the skin, so that the skin moves as in the picture.

The head is sampled once: by how much each blend shape displaces a few hundred points of its skin, at four amounts from
0 to 1, which keeps the curved paths of jaw and lids. The displacement of a face is then a sum of these samples. A servo
moves the skin around its anchor, also at neighbouring anchors. The pulls are a bounded least-squares fit of the skin's
displacement along each servo's direction, at the anchors and at a few points close to them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from controller.base.config import config_error
from controller.base.parameters import Floats, Parameters
from controller.base.solve import BoundedSolver
from controller.robot.settings import AnchorSettings, ChannelSettings, RobotSettings
from surface.head import Head
from surface.head.model.parameters import SHAPES, read_pose
from surface.head.posing.part import HeadPart
from surface.spline.matrix import basis_rows

_LEVELS = 4
_STRAIGHT_MM = 0.02
_RIDGE = 1e-3
_SEED = 7
_REPORT_POINTS = 400  # number of points all over the skin, to report what a head cannot show
_MAX_NEAR_POINTS = 6  # number of points around each anchor, for solving
_NEAR_MM = 8.0
_MIN_LIKE_MM = 0.5


@dataclass(frozen=True)
class SkinSamples:
    """Points of one head's skin and their displacement by every blend shape.

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
        moved: Floats = np.einsum("mcsl,sl->mc", self.moves, level_fractions(shapes))
        return moved

    def full(self, shape: str) -> Floats:
        """(m, 3) mm that one shape moves the points by at 1."""
        moved: Floats = self.moves[:, :, SHAPES.index(shape)].sum(axis=2)
        return moved

    def subset(self, chosen: slice | NDArray[np.intp]) -> SkinSamples:
        """Return the samples of some of the points."""
        return SkinSamples(self.part, *(each[chosen] for each in (self.uv, self.rest, self.moves, self.jaw)))


def level_fractions(shapes: Floats) -> Floats:
    """(s, levels) fraction, 0..1, of each quarter of its range that a shape has passed, for amounts (s,)."""
    return np.clip(_LEVELS * shapes[:, None] - np.arange(_LEVELS), 0.0, 1.0)


def sample_skin(head: Head, part: str, uv: Floats) -> SkinSamples:
    """Sample how a head's shapes displace the points ``uv`` : (m, 2) of a part; the head's pose does not change.

    Raises KeyError when there is no such part.
    """
    index = head.parts.index(head.part(part))
    basis = basis_rows(head.part(part).surface, uv)
    rest = basis @ head.place_points(np.zeros(len(head.parameters)))[0][index]

    def displacement(values: dict[str, float]) -> Floats:
        return np.asarray(basis @ head.place_points(head.values(values))[0][index] - rest)

    levels = np.array([_displacement_at_levels(name, displacement) for name in SHAPES])
    moves = np.moveaxis(np.diff(levels, axis=1, prepend=0.0), (0, 1), (2, 3))
    jaw = next(p.jaw for p in head.data.parts if p.name == part)
    return SkinSamples(part, uv, rest, np.ascontiguousarray(moves), np.asarray(basis @ np.asarray(jaw, np.float64)))


def _displacement_at_levels(name: str, displacement: Callable[[dict[str, float]], Floats]) -> Floats:
    """(levels, m, 3) mm that one shape alone moves the points by. mouthClose has an effect on an open jaw only."""
    base = {"mouthClose": "jawOpen"}.get(name)
    if name == "tongueOut":
        return np.zeros((_LEVELS, *displacement({}).shape))  # all that it does to the skin is open the jaw, as jawOpen

    def at(level: float) -> Floats:
        if base is None:
            return displacement({name: level})
        return displacement({name: level, base: level}) - displacement({base: level})

    half, full = at(0.5), at(1.0)
    if np.abs(half - 0.5 * full).max() < _STRAIGHT_MM:
        return np.array([full * (i + 1) / _LEVELS for i in range(_LEVELS)])
    return np.array([at(0.25), half, at(0.75), full])


def shapes_of(values: Floats, order: NDArray[np.intp]) -> Floats:
    """(s,) amounts of the shapes for parameters ``values`` (p,); ``order`` : (h,) see :func:`head_order`."""
    return read_pose(values[order]).shapes


def head_order(head_names: Sequence[str], parameters: Parameters) -> NDArray[np.intp]:
    """(h,) index of each of a head's parameters among ``parameters``."""
    return np.array([parameters.index(name) for name in head_names], dtype=np.intp)


def skin_points(head: Head, part: str, count: int, seed: int) -> Floats:
    """(count, 2) points (u, v) drawn evenly over the vertices of a part."""
    uv = head.part(part).mesh.uv
    pick = np.random.default_rng(seed).choice(len(uv), size=min(count, len(uv)), replace=False)
    return np.asarray(uv[np.sort(pick)], dtype=np.float64)


def servo_field(anchors: Sequence[AnchorSettings], at: SkinSamples, points: SkinSamples) -> Floats:
    """(3 m, k) mm by which a pull of 1 mm at each of k anchors moves m points of the skin.

    ``at`` : samples of the skin at the anchors. ``points`` : samples at the m points.
    """
    field = np.zeros((len(points.rest), 3, len(anchors)))
    for j, anchor in enumerate(anchors):
        direction = anchor.unit_direction
        if anchor.like is not None:
            field[:, :, j] = points.full(anchor.like) / (at.full(anchor.like)[j] @ direction)
            continue
        for side in (1.0, -1.0) if anchor.both else (1.0,):
            mirror = np.array([side, 1.0, 1.0])
            weight = falloff(points, at.rest[j] * mirror, at.jaw[j], anchor.reach_mm)
            field[:, :, j] += weight[:, None] * direction * mirror
    return field.reshape(-1, len(anchors))


def falloff(points: SkinSamples, centre: Floats, jaw: float, reach_mm: float) -> Floats:
    """(m,) fraction of a pull with which each point moves along, 1 at the anchor; 0 on the other jaw."""
    squared = ((points.rest - centre) ** 2).sum(axis=1) / reach_mm**2
    weight: Floats = np.clip(1.0 - squared, 0.0, None) ** 2 * (1.0 - np.abs(points.jaw - jaw)).clip(0.0, 1.0)
    return weight


@dataclass(frozen=True)
class PullRows:
    """The ``r`` equations to fit, each the displacement of one point of the skin along one anchor's direction.

    point, anchor : (r,) indices of the point and of the anchor. direction : (r, 3) unit direction of that anchor.
    """

    point: NDArray[np.intp]
    anchor: NDArray[np.intp]
    direction: Floats

    @classmethod
    def near(cls, anchors: Sequence[AnchorSettings], at: SkinSamples, points: SkinSamples, reach_mm: float) -> PullRows:
        """Points within ``reach_mm`` of each anchor, on its side of the mouth."""
        near = [falloff(points, at.rest[j], at.jaw[j], reach_mm) > 0.0 for j in range(len(anchors))]
        anchor, point = np.nonzero(near)
        return cls(point, anchor, np.array([each.unit_direction for each in anchors])[anchor])

    def project(self, points: Floats) -> Floats:
        """(r, ...) components along the directions of (m, 3, ...) displacements."""
        components: Floats = np.einsum("rc,rc...->r...", self.direction, points[self.point])
        return components

    @property
    def weights(self) -> Floats:
        """(r,) weights of the equations with which every anchor counts the same."""
        return 1.0 / np.sqrt(np.bincount(self.anchor)[self.anchor])


class AnchorSolver:
    """Solves the pulls of all anchored channels of a robot for a face; returns the pulls of the channels ``names``.

    names : the channels whose pulls it returns. linear : (k, p) approximate mm per unit of each parameter.
    skin : m points; the first k are the anchors. field : (3 m, k) see :func:`servo_field`.
    """

    def __init__(self, channels: Sequence[ChannelSettings], skin: SkinSamples, order: NDArray[np.intp],
                 parameters: Parameters) -> None:  # fmt: skip
        anchors = [channel.anchor for channel in channels if channel.anchor is not None]
        k = len(anchors)
        at = skin.subset(slice(k))
        self.names = tuple(channel.name for channel in channels)
        self.skin, self.field, self._order = skin, servo_field(anchors, at, skin), order
        rows = PullRows.near(anchors, at, skin, _NEAR_MM)
        self._moves = rows.project(skin.moves).reshape(len(rows.point), -1)
        low, high = np.array([pull_range_mm(channel) for channel in channels]).T
        field = rows.project(self.field.reshape(-1, 3, k))
        self._solver = BoundedSolver(field, low, high, weights=rows.weights, ridge=_RIDGE, tolerance=1e-5)
        self._last, self._returned = np.zeros(k), np.arange(k)
        self.linear = np.zeros((k, len(parameters)))
        for s, name in enumerate(SHAPES):
            self.linear[:, parameters.index(name)] = self._solve(np.eye(len(SHAPES))[s])

    def for_channels(self, names: Sequence[str]) -> AnchorSolver | None:
        """Return a copy with its own last solution, for the pulls of ``names`` only; None if none is anchored."""
        returned = [i for i, name in enumerate(self.names) if name in names]
        if not returned:
            return None
        other = copy(self)
        other.names = tuple(self.names[i] for i in returned)
        other.linear, other._returned = self.linear[returned], np.array(returned)
        return other

    def shape_values(self, values: Floats) -> Floats:
        """(s,) the head's shapes for parameters (p,)."""
        return shapes_of(values, self._order)

    def pulls_mm(self, values: Floats) -> Floats:
        """(k,) mm of pull for parameters (p,); starts from the last solution."""
        self._last = self._solve(self.shape_values(values), self._last)
        return self._last[self._returned]

    def residual(self, shapes: Floats) -> Floats:
        """(m, 3) mm of displacement that the servos cannot make, for a face with shapes (s,)."""
        return self.skin.displacement(shapes) - (self.field @ self._solve(shapes)).reshape(-1, 3)

    def _solve(self, shapes: Floats, start: Floats | None = None) -> Floats:
        """Pulls of all anchors in mm for shapes (s,)."""
        return self._solver.solve(self._moves @ level_fractions(shapes).ravel(), start=start)


def pull_range_mm(channel: ChannelSettings) -> tuple[float, float]:
    """Pull (mm) at the ends of a channel's map, as far as its limits allow."""
    at, deg = np.array(channel.map.at), np.array(channel.map.deg) + channel.trim_deg
    inside = at[(deg >= channel.limit_deg[0]) & (deg <= channel.limit_deg[1])]
    return float(inside.min(initial=at[-1])), float(inside.max(initial=at[0]))


def load_anchors(
    robot: RobotSettings, head: Path | Head, parameters: Parameters, *, where: str = ""
) -> AnchorSolver | None:
    """Match a robot's anchors to a head; None for a robot without anchors.

    ``head`` : its folder, or the head itself, whose pose does not change. ``where`` : the robot's file, for messages.
    Raises ConfigError that lists every anchor that lies on no skin part of the head or does not move with its ``like``,
    SurfaceError when the head cannot be read.
    """
    channels = robot.anchored_channels
    if not channels:
        return None
    if isinstance(head, Path):
        head = Head.load(head)
    anchors = {f"channels[{i}].anchor": c.anchor for i, c in enumerate(robot.channels) if c.anchor is not None}
    source = Path(where or robot.name)
    if faults := list(_part_faults(anchors, head)):
        raise config_error(source, faults)
    part = head.part(next(iter(anchors.values())).part)
    vertices = part.surface.evaluate(part.mesh.uv)  # at rest, more exact than the mesh's positions
    anchor_uv = np.array([_uv_of(anchor, robot.landmarks, part, vertices) for anchor in anchors.values()])
    spread = skin_points(head, part.name, _REPORT_POINTS, _SEED)
    skin = sample_skin(head, part.name, np.concatenate([anchor_uv, _vertices_near(anchor_uv, part, vertices), spread]))
    if faults := list(_motion_faults(anchors, skin)):
        raise config_error(source, faults)
    return AnchorSolver(channels, skin, head_order(head.parameters, parameters), parameters)


def anchor_places(robot: RobotSettings, head: Head, part: str) -> list[tuple[Floats, str]]:
    """(2,) point (u, v) and name of every servo of a robot that has an anchor on a part of the head."""
    surface = head.part(part)
    vertices = surface.surface.evaluate(surface.mesh.uv)
    return [
        (_uv_of(channel.anchor, robot.landmarks, surface, vertices), channel.name)
        for channel in robot.anchored_channels
        if channel.anchor is not None and channel.anchor.part == part
    ]


def _vertices_near(uv: Floats, part: HeadPart, vertices: Floats) -> Floats:
    """(j, 2) points (u, v) of the few vertices closest to each of the points ``uv`` : (k, 2)."""
    distances = [np.linalg.norm(vertices - at, axis=1) for at in part.surface.evaluate(uv)]
    n = _MAX_NEAR_POINTS
    chosen = np.unique(np.concatenate([np.argsort(d)[:n][np.sort(d)[:n] < _NEAR_MM] for d in distances]))
    return np.asarray(part.mesh.uv[chosen], dtype=np.float64)


def _uv_of(anchor: AnchorSettings, landmarks: Mapping[str, list[float]], part: HeadPart, vertices: Floats) -> Floats:
    """(2,) point (u, v) of an anchor."""
    point = landmarks[anchor.point] if isinstance(anchor.point, str) else anchor.point
    if len(point) == 2:
        return np.array(point)
    nearest = int(np.argmin(np.linalg.norm(vertices - np.array(point), axis=1)))
    return np.asarray(part.mesh.uv[nearest], dtype=np.float64)


def _part_faults(anchors: Mapping[str, AnchorSettings], head: Head) -> Iterator[str]:
    """Yield faults: anchors that name a part or a shape that the head does not have, or different parts."""
    parts = [part.name for part in head.parts if part.follows == "skin"]
    first = next(iter(anchors.values())).part
    for key, anchor in anchors.items():
        if anchor.part not in parts:
            yield f"{key}.part: {anchor.part!r} is not a skin part of head {head.name} ({', '.join(parts)})"
        elif anchor.part != first:
            yield f"{key}.part: all anchors of a robot lie on one part"
        if anchor.like is not None and anchor.like not in SHAPES:
            yield f"{key}.like: the head has no shape of that name"


def _motion_faults(anchors: Mapping[str, AnchorSettings], skin: SkinSamples) -> Iterator[str]:
    """Yield faults: anchors that the parameter in ``like`` hardly moves along their direction."""
    for j, (key, anchor) in enumerate(anchors.items()):
        if anchor.like is not None:
            moved = float(skin.full(anchor.like)[j] @ anchor.unit_direction)
            if moved < _MIN_LIKE_MM:
                yield f"{key}.like: {anchor.like} moves the point by {moved:.1f} mm along direction"


def residual_rows(
    solver: AnchorSolver, faces: Mapping[str, Floats], parameters: Parameters
) -> Iterator[tuple[str, float, float]]:
    """Yield for each region of the face how much the robot cannot show: name, rms mm wanted, rms mm not reached.

    faces : parameters (p,) of each face by name.
    """
    most = np.linalg.norm(solver.skin.moves.sum(axis=3), axis=1).argmax(axis=1)  # the shape that moves a point most
    regions = np.array([parameters.regions[parameters.index(SHAPES[s])] for s in most])
    shapes = [solver.shape_values(face) for face in faces.values()]
    moves = np.array([(solver.skin.displacement(each), solver.residual(each)) for each in shapes])  # (f, 2, m, 3)
    for region in sorted(set(regions)):
        wanted, missing = np.sqrt((moves[:, :, regions == region] ** 2).sum(axis=3).mean(axis=(0, 2)))
        yield region, float(wanted), float(missing)
