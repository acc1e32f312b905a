"""T-splines of any form as islands of one (u, v) plane: exact on regular faces, fitted on those at star points.

Regular faces are joined to charts in which every face still sees the same grips with the same knots as alone: there the
surface is the T-spline, exactly. A face that touches a star point, or a corner of the outline that points inwards,
becomes a patch of its own (:mod:`surface.readers.starpatch`). Charts lie side by side, too far apart to act on each
other; a grip that acts in several has a control point in each. Where they meet in space they have seams.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from surface.base.arrays import Bools, Floats
from surface.dcp import DCPSurface
from surface.mesh.domain import Domain
from surface.spline.matrix import basis_rows

from .common import NamedSurface, Ties
from .starpatch import SPANS, Sampled, fit_patch, limit_samples
from .tlayout import STEP, Complex, Copy, Layout, Rect
from .tsmfile import TsmFile

GAP = 2.0  # between the reaches of two charts, in mean sides of faces: no cell of a mesh shall reach over it


class Boxes:
    """A growing list of rectangles."""

    def __init__(self) -> None:
        self._all, self._used = np.zeros((64, 4)), 0

    def append(self, rect: Rect) -> None:
        """Add one."""
        if self._used == len(self._all):
            self._all = np.concatenate([self._all, np.zeros_like(self._all)])
        self._all[self._used] = rect
        self._used += 1

    @property
    def rows(self) -> Floats:
        """(k, 4) all of them."""
        return self._all[: self._used]


def overlaps(rects: Floats, rect: Floats, near: float) -> Bools:
    """Return which of ``rects (k, 4)`` share more than a border with ``rect (4,)``: as :func:`.tlayout.overlap`."""
    u0, u1, v0, v1 = rects.T
    shared: Bools = (u0 < rect[1] - near) & (rect[0] < u1 - near) & (v0 < rect[3] - near) & (rect[2] < v1 - near)
    return shared


@dataclass
class Chart:
    """Faces in one plane.

    places : by face, where its own corner lies, and by how many quarters it is turned. rects : by face. copies : all of
    its grips by key; keys : of those that each face sees.
    """

    places: dict[int, tuple[float, float, int]] = field(default_factory=dict)
    rects: dict[int, Rect] = field(default_factory=dict)
    copies: dict[tuple[int, ...], Copy] = field(default_factory=dict)
    keys: dict[int, set[tuple[int, ...]]] = field(default_factory=dict)
    _boxes: Boxes = field(default_factory=lambda: Boxes())  # of the faces
    _reached: Boxes = field(default_factory=lambda: Boxes())  # where copies act
    _numbers: dict[tuple[int, ...], int] = field(default_factory=dict)  # of copies in these

    def fits(self, rect: Rect, copies: dict[tuple[int, ...], Copy], near: float) -> bool:
        """Whether a face can join: it lies beside the others, and all still see only their own grips."""
        rects, reached, new = self._boxes.rows, self._reached.rows, [key for key in copies if key not in self.copies]
        if overlaps(rects, np.array(rect), near).any():
            return False
        seen = overlaps(reached, np.array(rect), near)
        seen[[self._numbers[key] for key in copies if key in self._numbers]] = False
        if seen.any():
            return False
        return not any(overlaps(rects, np.array(copies[key].rect), near).any() for key in new)

    def add(self, face: int, place: tuple[float, float, int], rect: Rect, copies: dict[tuple[int, ...], Copy]) -> None:
        """Let a face join."""
        self.places[face], self.rects[face], self.keys[face] = place, rect, set(copies)
        self._boxes.append(rect)
        for key, copy in copies.items():
            if key not in self.copies:
                self._numbers[key] = len(self._numbers)
                self._reached.append(copy.rect)
        self.copies |= copies


def read_complex(file: TsmFile, name: str) -> NamedSurface:
    """Return the surface of a T-mesh of any form; ``SurfaceFileError`` names the line."""
    mean = float(np.mean(list(file.edges.values())))
    if mean < 1.0:  # charts are distinguished by absolute distances; their size has no meaning
        file.edges = {edge: length / mean for edge, length in file.edges.items()}
    mesh = Complex(file)
    layouts = {face: Layout(mesh, face) for face in mesh.loops if not mesh.is_star(face)}
    charts = _charts(mesh, layouts)
    points = {grip: np.array(row[:3]) for grip, (_, row) in file.grips.items()}
    return _assemble(mesh, charts, points, name)


def _charts(mesh: Complex, layouts: dict[int, Layout]) -> list[Chart]:
    """Return regular faces in charts, each as large as it can get from where it begins."""
    seen = {face: layout.copies(face) for face, layout in layouts.items()}
    charts, left = [], set(seen)
    while left:
        chart, first = Chart(), min(left)
        queue = deque([(first, (0.0, 0.0, 0))])
        while queue:
            face, place = queue.popleft()
            if face not in left:
                continue
            copies = [copy.moved(*place) for copy in seen[face]]
            rect = _moved_rect(layouts[face].rects[face], place)
            by_key = {copy.key(mesh.near): copy for copy in copies}
            if not chart.fits(rect, by_key, mesh.near):
                continue
            left.discard(face)
            chart.add(face, place, rect, by_key)
            queue.extend(_neighbours(mesh, layouts, face, place))
        charts.append(chart)
    return charts


def _moved_rect(rect: Rect, place: tuple[float, float, int]) -> Rect:
    """Return a face's rectangle in its chart."""
    corners = np.array([[rect[0], rect[2]], [rect[1], rect[3]]])
    du, dv, quarter = place
    for _ in range(quarter % 4):
        corners = np.column_stack([-corners[:, 1], corners[:, 0]])
    low, high = corners.min(axis=0), corners.max(axis=0)
    return float(low[0] + du), float(high[0] + du), float(low[1] + dv), float(high[1] + dv)


def _neighbours(
    mesh: Complex, layouts: dict[int, Layout], face: int, place: tuple[float, float, int]
) -> list[tuple[int, tuple[float, float, int]]]:
    """Return regular faces beside a face, and where they would lie in its chart."""
    layout, out = layouts[face], []
    for number in mesh.loops[face]:
        opposite = mesh.file.links[number].opposite
        other = mesh.file.links[opposite].face
        if other not in layouts:
            continue
        u, v, way = layout.places[number]
        length = mesh.file.edges[mesh.file.links[number].edge]
        end = np.array([u + STEP[way][0] * length, v + STEP[way][1] * length])
        own_u, own_v, own_way = layouts[other].places[opposite]
        quarter = (way + 2 - own_way) % 4
        shift = end - _turned(np.array([own_u, own_v]), quarter)
        whole = _turned(shift, place[2]) + np.array(place[:2])
        out.append((other, (float(whole[0]), float(whole[1]), (quarter + place[2]) % 4)))
    return out


def _turned(at: Floats, quarter: int) -> Floats:
    for _ in range(quarter % 4):
        at = np.array([-at[1], at[0]])
    return at


def _surface_of(chart: Chart, points: dict[int, Floats], weights: dict[int, float]) -> DCPSurface:
    """Return the chart's control points alone."""
    copies = list(chart.copies.values())
    return DCPSurface(
        [points[c.grip] for c in copies], [weights[c.grip] for c in copies], [c.knots_u for c in copies],
        [c.knots_v for c in copies],
    )  # fmt: skip


class _Exact:
    """Points of regular faces as shares of grips, at places along their links."""

    def __init__(self, mesh: Complex, charts: list[Chart], points: dict[int, Floats]) -> None:
        self._mesh = mesh
        weights = {grip: row[3] for grip, (_, row) in mesh.file.grips.items()}
        self.surfaces = [_surface_of(chart, points, weights) for chart in charts]
        self._charts = charts
        self._of = {face: k for k, chart in enumerate(charts) for face in chart.places}
        self._layouts: dict[int, Layout] = {}

    def along(self, link: int, count: int) -> list[dict[int, float]] | None:
        """Return shares of grips at ``count`` places along a link, from its vertex on, where its face is regular."""
        face = self._mesh.file.links[link].face
        if face not in self._of:
            return None
        chart = self._charts[self._of[face]]
        layout = self._layouts.setdefault(face, Layout(self._mesh, face, 0))
        u, v, way = layout.places[link]
        length = self._mesh.file.edges[self._mesh.file.links[link].edge]
        t = np.linspace(0.0, length, count)
        local = np.column_stack([u + STEP[way][0] * t, v + STEP[way][1] * t])
        place = chart.places[face]
        at = np.array([_turned(row, place[2]) for row in local]) + np.array(place[:2])
        rect = chart.rects[face]
        inset = 1e-12 * (rect[1] - rect[0] + rect[3] - rect[2])  # charts may be covered from this side only
        at = np.clip(at, [rect[0] + inset, rect[2] + inset], [rect[1] - inset, rect[3] - inset])
        rows = basis_rows(self.surfaces[self._of[face]], at)
        grips = [copy.grip for copy in chart.copies.values()]
        out: list[dict[int, float]] = [{} for _ in range(count)]
        for share, column, row in zip(rows.share, rows.column, rows.row, strict=True):
            grip = grips[int(column)]
            out[int(row)][grip] = out[int(row)].get(grip, 0.0) + float(share)
        return out


def _assemble(mesh: Complex, charts: list[Chart], points: dict[int, Floats], name: str) -> NamedSurface:
    """Return all charts and patches in one plane."""
    sheet = _Sheet(mesh)
    exact = _Exact(mesh, charts, points)
    for chart in charts:
        sheet.add_chart(chart, {grip: row[3] for grip, (_, row) in mesh.file.grips.items()})
    deviation = 0.0
    for face in (f for f in mesh.loops if mesh.is_star(f)):
        sampled = limit_samples(mesh, face, exact.along)
        deviation = max(deviation, sheet.add_patch(face, sampled, points))
    return sheet.finish(points, name, deviation)


class _Sheet:
    """Charts side by side."""

    def __init__(self, mesh: Complex) -> None:
        self._mesh = mesh
        self._next, self._gap = 0.0, GAP * float(np.mean(list(mesh.file.edges.values())))
        self._weights: list[float] = []
        self._knots: tuple[list[Floats], list[Floats]] = ([], [])
        self._ties: list[dict[int, float]] = []
        self._loops: list[Floats] = []
        self._sides: dict[int, tuple[int, Floats]] = {}
        self._count = 0

    def _add_sides(self, face: int, place: tuple[float, float, int], shift: Floats) -> None:
        """Note where the links of a face lie, with the number of its chart: (2, 2) start and end each."""
        for number, (u, v, way) in Layout(self._mesh, face, 0).places.items():
            length = self._mesh.file.edges[self._mesh.file.links[number].edge]
            end = np.array([u + STEP[way][0] * length, v + STEP[way][1] * length])
            ends = np.array([_turned(at, place[2]) for at in (np.array([u, v]), end)])
            self._sides[number] = self._count, ends + np.array(place[:2]) + shift

    def _place(self, knots_u: list[Floats], knots_v: list[Floats]) -> Floats:
        """Return (2,): how far control points are moved so that they lie beside all before."""
        low = min(float(k[0]) for k in knots_u)
        shift = np.array([self._next - low, -min(float(k[0]) for k in knots_v)])
        self._next += max(float(k[-1]) for k in knots_u) - low + self._gap
        for axis, rows in enumerate((knots_u, knots_v)):
            self._knots[axis].extend(row + shift[axis] for row in rows)
        return shift

    def add_chart(self, chart: Chart, weights: dict[int, float]) -> None:
        """Regular faces."""
        copies = list(chart.copies.values())
        shift = self._place([np.array(c.knots_u) for c in copies], [np.array(c.knots_v) for c in copies])
        self._weights += [weights[c.grip] for c in copies]
        self._ties += [{c.grip: 1.0} for c in copies]
        self._loops += [loop + shift for loop in outlines(list(chart.rects.values()), self._mesh.near)]
        for face, place in chart.places.items():
            self._add_sides(face, place, shift)
        self._count += 1

    def add_patch(self, face: int, sampled: Sampled, points: dict[int, Floats]) -> float:
        """Add a patch for a face at a star point; return the greatest distance from the samples it was fitted to."""
        patch = fit_patch(sampled)
        width, height = sampled.size
        lines = [np.concatenate([[0.0] * 3, np.linspace(0.0, x, SPANS + 1), [x] * 3]) for x in (width, height)]
        count = SPANS + 3
        knots_u = [lines[0][i : i + 5] for i in range(count) for _ in range(count)]
        knots_v = [lines[1][j : j + 5] for _ in range(count) for j in range(count)]
        shift = self._place(knots_u, knots_v)
        self._weights += [1.0] * count**2
        rows = patch.shares.reshape(count**2, -1)
        self._ties += [{g: float(x) for g, x in zip(sampled.grips, row, strict=True) if abs(x) > 1e-12} for row in rows]
        self._loops.append(np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]]) + shift)
        self._add_sides(face, (0.0, 0.0, 0), shift)
        self._count += 1
        return patch.deviation(sampled, np.array([points[g] for g in sampled.grips]))

    def finish(self, points: dict[int, Floats], name: str, deviation: float) -> NamedSurface:
        """Return the surface."""
        ties = Ties.of(self._ties, points)
        surface = DCPSurface(ties.apply(ties.points), self._weights, *self._knots)
        every = np.concatenate(self._loops)
        low, high = every.min(axis=0), every.max(axis=0)
        rect = float(low[0]), float(high[0]), float(low[1]), float(high[1])
        seams = (*find_seams(self._mesh, self._sides), *find_corners(self._mesh, self._sides))
        return NamedSurface(name, surface, Domain(rect, self._loops), ties, deviation, seams)


def find_seams(mesh: Complex, sides: Mapping[int, tuple[int, Floats]]) -> list[tuple[Floats, Floats]]:
    """Return where borders of charts are one line in space, see :class:`.common.NamedSurface`; the first chart comes
    first.

    sides : by link, the number of its chart and its start and end (2, 2) there.
    """
    steps: dict[tuple[float, ...], tuple[Floats, Floats]] = {}
    for link, (chart, line) in sides.items():
        opposite = mesh.file.links[link].opposite
        if opposite not in sides or (sides[opposite][0], opposite) < (chart, link):
            continue
        other, back = sides[opposite][0], sides[opposite][1][::-1]
        if chart != other or np.abs(line - back).max() > 10.0 * mesh.near:
            steps[float(chart), float(other), *_key(mesh, line[0], back[0])] = line, back
    followers = {(*key[:2], *_key(mesh, line[1], back[1])) for key, (line, back) in steps.items()}
    out = []
    while steps:
        key = next((k for k in steps if k not in followers), next(iter(steps)))
        rows = [(steps[key][0][0], steps[key][1][0])]
        while key in steps:
            line, back = steps.pop(key)
            rows.append((line[1], back[1]))
            key = *key[:2], *_key(mesh, line[1], back[1])
        out.append((np.array([a for a, _ in rows]), np.array([b for _, b in rows])))
    return out


def _key(mesh: Complex, *places: Floats) -> tuple[float, ...]:
    """Return a key that is equal for places (2,) that differ by rounding only."""
    return tuple(round(x / (10.0 * mesh.near)) for place in places for x in place.tolist())


def find_corners(mesh: Complex, sides: Mapping[int, tuple[int, Floats]]) -> list[tuple[Floats, Floats]]:
    """Return the places where three borders of charts or more are one point in space, as seams of no length: all follow
    the first chart's, whatever seams along their sides have made of them before."""
    around: dict[int, dict[tuple[float, ...], tuple[int, Floats]]] = {}
    for link, (chart, line) in sides.items():
        here = around.setdefault(mesh.file.links[link].vertex, {})
        here[_key(mesh, line[0])] = chart, line[0]
    out = []
    for places in around.values():
        first, *others = sorted(places.values(), key=lambda row: (row[0], *row[1]))
        out += [(np.array([first[1]] * 2), np.array([at] * 2)) for _, at in others if len(others) > 1]
    return out


def outlines(rects: list[Rect], near: float) -> list[Floats]:
    """Return closed polylines (k, 2) around a union of rectangles that do not overlap, by walking along its border."""
    values = [_distinct([r[k] for r in rects for k in pair], near) for pair in ((0, 1), (2, 3))]
    sides: set[tuple[tuple[int, int], tuple[int, int]]] = set()
    for rect in rects:
        u0, u1, v0, v1 = (int(np.argmin(np.abs(values[k // 2] - x))) for k, x in enumerate(rect))
        ring = [(i, v0) for i in range(u0, u1)] + [(u1, j) for j in range(v0, v1)]
        ring += [(i, v1) for i in range(u1, u0, -1)] + [(u0, j) for j in range(v1, v0, -1)]
        for a, b in zip(ring, ring[1:] + ring[:1], strict=True):
            if (b, a) in sides:
                sides.discard((b, a))
            else:
                sides.add((a, b))
    return [_corners(np.array([(values[0][i], values[1][j]) for i, j in ring])) for ring in _rings(sides)]


def _distinct(values: list[float], near: float) -> Floats:
    row = np.sort(np.array(values))
    kept: Floats = row[np.concatenate([[True], np.diff(row) > near])]
    return kept


def _rings(sides: set[tuple[tuple[int, int], tuple[int, int]]]) -> list[list[tuple[int, int]]]:
    """Return closed walks along directed sides; where two meet in a corner, the one that turns left most is taken."""
    out = []
    while sides:
        a, b = min(sides)
        ring = [a]
        sides.discard((a, b))
        while b != ring[0]:
            way = np.array(b) - np.array(ring[-1])
            ring.append(b)
            options = [s for s in sides if s[0] == b]
            following = max(options, key=lambda s: _left(way, np.array(s[1]) - np.array(b)))
            sides.discard(following)
            b = following[1]
        out.append(ring)
    return out


def _left(a: Floats, b: Floats) -> float:
    """Return how far a step b turns left after a step a: -pi to pi."""
    return float(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b))


def _corners(ring: Floats) -> Floats:
    """Return a ring without points on straight lines."""
    before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    bends: Floats = ring[np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]) > 0]
    return bends
