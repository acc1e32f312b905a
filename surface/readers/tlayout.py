"""The T-mesh around one of its faces, unfolded into the plane of that face, and the knots of the grips there.

Nothing is assumed about the whole: the form may close on itself and have star points and holes. A grip's knots are
those that rays from it meet (Sederberg, Zheng, Bakenov and Nasri 2003, rule 1), four times each at the outline (Bezier
ends).
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import deque
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from surface.base.arrays import Floats

from .tsmfile import COMPASS, HINT, TsmFile

STEP = ((1, 0), (0, 1), (-1, 0), (0, -1))
SIDES = (1, 2, 3, 0)  # the order of counts in "0m cg"
RINGS = 5  # faces that far away are laid out: a grip reaches over two knots to either side
NEAR = 1e-9  # of the sum of knot intervals
Rect = tuple[float, float, float, float]
Knots = tuple[float, ...]


@dataclass(frozen=True)
class Copy:
    """A grip as seen from one face: its knots in the face's plane, whose corner is (0, 0)."""

    grip: int
    knots_u: Knots
    knots_v: Knots

    def moved(self, du: float, dv: float, quarter: int) -> Copy:
        """Return the same, turned by quarters of a turn anticlockwise about (0, 0), then moved."""
        u, v = self.knots_u, self.knots_v
        for _ in range(quarter % 4):
            u, v = tuple(-x for x in reversed(v)), u
        return Copy(self.grip, tuple(x + du for x in u), tuple(x + dv for x in v))

    @property
    def rect(self) -> Rect:
        """Where it acts."""
        return self.knots_u[0], self.knots_u[-1], self.knots_v[0], self.knots_v[-1]

    def key(self, near: float) -> tuple[int, ...]:
        """Return a key that is equal for copies that differ by rounding only."""
        return (self.grip, *(round(x / near) for x in (*self.knots_u, *self.knots_v)))


class Complex:
    """A T-mesh of any form. ``SurfaceFileError`` where its faces are no rectangles.

    loops : links around each face, anticlockwise. irregular : vertices without one plane around them: star points, and
        corners of the outline that point inwards.
    """

    def __init__(self, file: TsmFile) -> None:
        self.file = file
        self.near = NEAR * sum(file.edges.values())
        self.previous = {link.next: number for number, link in file.links.items()}
        self.loops = self._loops()
        self.irregular = self._irregular()
        self.grips = self._grips()

    def _loops(self) -> dict[int, list[int]]:
        loops: dict[int, list[int]] = {}
        for number, link in self.file.links.items():
            if link.face >= 0 and link.face not in loops:
                loops[link.face] = self._around(number)
        around = {number for loop in loops.values() for number in loop}
        for number, link in self.file.links.items():
            if link.face >= 0 and number not in around:
                why = f"link {number} does not lie around its face {link.face}"
                raise self.file.error(link.line, why, HINT)
        return loops

    def _around(self, first: int) -> list[int]:
        """Return links of a face from a corner on; ``SurfaceFileError`` where it does not close as a rectangle."""
        links, loop = self.file.links, [first]
        while links[loop[-1]].next != first:
            loop.append(links[loop[-1]].next)
            if len(loop) > len(links):
                break
        corners = [k for k, number in enumerate(loop) if links[number].turn == 0]
        turns = sum(1 - links[number].turn for number in loop)
        if len(corners) != 4 or turns != 4:
            raise self.file.error(links[first].line, f"face {links[first].face} is no rectangle", HINT)
        loop = loop[corners[0] :] + loop[: corners[0]]
        u, v = self._sides(loop)
        if abs(u[0] - u[1]) > self.near or abs(v[0] - v[1]) > self.near:
            why = f"knot intervals on opposite sides of face {links[first].face} do not add up"
            raise self.file.error(links[first].line, why, HINT)
        return loop

    def _sides(self, loop: list[int]) -> tuple[tuple[float, float], tuple[float, float]]:
        lengths, way = [0.0] * 4, -1
        for number in loop:
            way += self.file.links[number].turn == 0
            lengths[way] += self.file.edges[self.file.links[number].edge]
        return (lengths[0], lengths[2]), (lengths[1], lengths[3])

    def _irregular(self) -> set[int]:
        quarters, out = dict.fromkeys(self.file.vertices, 0), set()
        for link in self.file.links.values():
            quarters[link.vertex] += 1 + link.turn
            if link.face < 0 and link.turn == 0:
                out.add(link.vertex)
        out |= {vertex for vertex, count in quarters.items() if count != 4}
        for vertex, line in self.file.missing.items():
            if vertex not in out:
                why = f"vertex {vertex} lacks grips, but is neither a star point nor an inward corner of the outline"
                raise self.file.error(line, why, HINT)
        return out

    def _grips(self) -> dict[int, list[tuple[int, tuple[int, ...]]]]:
        """By vertex: its grips, and to which sides in the vertex' own frame each lies further in."""
        out: dict[int, list[tuple[int, tuple[int, ...]]]] = {vertex: [] for vertex in self.file.vertices}
        for number, (_, own, vertex) in enumerate(self.file.owners):
            if own and number in self.file.grips:
                out[vertex].insert(0, (number, ()))
        for _, vertex, sizes, grips in self.file.extras:
            if vertex not in self.irregular:
                out[vertex] += [(grip, ways) for grip, ways in zip(grips, directions(sizes), strict=True)]
        needed = dict.fromkeys(self.file.vertices, 1)
        needed |= {link.vertex: 2 * link.turn for link in self.file.links.values() if link.face < 0}
        for vertex, (line, *_) in self.file.vertices.items():
            found, most = len(out[vertex]), needed[vertex]
            if found < 1 or (vertex not in self.irregular and found != most):
                why = f"vertex {vertex} has {found} grips, {most} belong there with Bezier ends"
                raise self.file.error(line, why, HINT)
        return out

    def quarter(self, vertex: int, leaving: int, way: int) -> int:
        """Return how far the frame of a regular vertex is turned in a plane where the link ``leaving`` it points
        ``way``."""
        _, link, word = self.file.vertices[vertex]
        for _ in range(5):
            if leaving == link:
                return (way - COMPASS[word]) % 4
            way += 1 + self.file.links[leaving].turn
            leaving = self.file.links[self.previous[leaving]].opposite
        raise self.file.error(self.file.vertices[vertex][0], f"links around vertex {vertex} do not close", HINT)

    def is_star(self, face: int) -> bool:
        """Whether a face touches a vertex that is not regular."""
        return any(self.file.links[number].vertex in self.irregular for number in self.loops[face])


def directions(counts: list[int]) -> list[tuple[int, ...]]:
    """For every grip of a "0m cg" line the side, or the two sides, that it lies at."""
    out: list[tuple[int, ...]] = []
    for k, side in enumerate(SIDES):
        after = (k + 1) % 4
        out += [(side,)] * counts[k] + [(side, SIDES[after])] * (counts[k] * counts[after])
    return out


class Layout:
    """Faces around ``face`` in its plane, each where a shortest way leads to it; none lies on another.

    rects : by face. places : (u, v) of links' vertices, and the way each link points, by link.
    """

    def __init__(self, mesh: Complex, face: int, rings: int = RINGS) -> None:
        self.mesh = mesh
        self.places: dict[int, tuple[float, float, int]] = {}
        self._rays: dict[tuple[int, float], Ray] = {}  # by axis, and by the coordinate that they have in common
        self.rects: dict[int, Rect] = {}
        queue = deque([(face, mesh.loops[face][0], (0.0, 0.0), 0, 0)])
        while queue:
            number, link, at, way, ring = queue.popleft()
            if number in self.rects or not self._put(number, link, at, way) or ring >= rings:
                continue
            for own in mesh.loops[number]:
                opposite = mesh.file.links[mesh.file.links[own].opposite]
                if opposite.face >= 0 and opposite.face not in self.rects:
                    u, v, out = self.places[own]
                    length = mesh.file.edges[opposite.edge]
                    end = u + STEP[out][0] * length, v + STEP[out][1] * length
                    queue.append((opposite.face, mesh.file.links[own].opposite, end, (out + 2) % 4, ring + 1))

    def _put(self, face: int, first: int, at: tuple[float, float], way: int) -> bool:
        """Lay a face out from one of its links; False where it would lie on others."""
        links, (u, v), found = self.mesh.file.links, at, {}
        loop = self.mesh.loops[face]
        start = loop.index(first)
        for number in loop[start:] + loop[:start]:
            if number != first:
                way = (way + 1 - links[number].turn) % 4
            found[number] = (u, v, way)
            length = self.mesh.file.edges[links[number].edge]
            u, v = u + STEP[way][0] * length, v + STEP[way][1] * length
        us, vs, _ = zip(*found.values(), strict=True)
        rect, near = (min(us), max(us), min(vs), max(vs)), self.mesh.near
        if any(overlap(rect, other, near) for other in self.rects.values()):
            return False
        self.rects[face] = rect
        self.places.update(found)
        return True

    @cached_property
    def _lines(self) -> tuple[Floats, Floats]:
        """Of edges across u, and across v: coordinate, start, end, and 1 where the outside is before it, 2 after."""
        rows: tuple[list[tuple[float, ...]], list[tuple[float, ...]]] = ([], [])
        for number, (u, v, way) in self.places.items():
            link = self.mesh.file.links[number]
            length = self.mesh.file.edges[link.edge]
            along, across = (u, v) if way % 2 == 0 else (v, u)
            low, high = (along, along + length) if way in (0, 1) else (along - length, along)
            free = self.mesh.file.links[link.opposite].face < 0
            outside = 0 if not free else (1 if way in (0, 3) else 2)  # a face lies to the left of its links
            rows[1 - way % 2].append((across, low, high, outside))
        return tuple(np.array(r).reshape(-1, 4) for r in rows)  # type: ignore[return-value]

    def _knots(self, axis: int, at: tuple[float, float], inward: int) -> Knots | None:
        """Return the five knots of a grip along u (0) or v (1); None where it would lie outside."""
        near, x, y = self.mesh.near, at[axis], at[1 - axis]
        if (axis, y) not in self._rays:
            lines = self._lines[axis]
            self._rays[axis, y] = Ray(lines[(lines[:, 1] <= y + near) & (lines[:, 2] >= y - near)], near)
        row, low, high = self._rays[axis, y].row(x)
        if abs(x - low) <= near:
            centre = 2 + inward
        elif abs(x - high) <= near:
            centre = len(row) - 3 + inward
        else:
            centre = nearest(row, x)
        if not 2 <= centre <= len(row) - 3:
            return None
        return tuple(row[centre - 2 : centre + 3])

    def _reaching(self, axis: int, at: tuple[float, float], inward: int, rect: Rect) -> Knots | None:
        """Do the same as :meth:`_knots`; None also where the grip would not act inside a rectangle."""
        low, high = rect[2 * axis : 2 * axis + 2]
        knots = self._knots(axis, at, inward)
        acts = knots is not None and knots[0] < high - self.mesh.near and knots[-1] > low + self.mesh.near
        return knots if acts else None

    def copies(self, face: int) -> list[Copy]:
        """Return the grips that act in a face that is laid out, with their knots."""
        near, rect, out = self.mesh.near, self.rects[face], {}
        done = set()
        for number, (u, v, way) in self.places.items():
            vertex = self.mesh.file.links[number].vertex
            key = (vertex, round(u / near), round(v / near))
            if key in done:
                continue
            done.add(key)
            for grip, sides in self.mesh.grips[vertex]:
                ways: list[tuple[int, int]] = []
                if sides:
                    quarter = self.mesh.quarter(vertex, number, way)
                    ways = [STEP[(side + quarter) % 4] for side in sides]
                inward = sum(w[0] for w in ways), sum(w[1] for w in ways)
                knots_u = self._reaching(0, (u, v), inward[0], rect)
                knots_v = None if knots_u is None else self._reaching(1, (u, v), inward[1], rect)
                if knots_u is not None and knots_v is not None:
                    copy = Copy(grip, knots_u, knots_v)
                    out[copy.key(near)] = copy
        return list(out.values())


class Ray:
    """A straight line through a layout: the edges that it crosses, in order.

    met : (k, 4) rows of :attr:`Layout._lines`.
    """

    def __init__(self, met: Floats, near: float) -> None:
        self._near = near
        self._all, self._ends, self._starts = (
            np.sort(met[of, 0]).tolist() for of in (slice(None), met[:, 3] == 2, met[:, 3] == 1)
        )
        self._rows: dict[tuple[float, float], list[float]] = {}

    def row(self, x: float) -> tuple[list[float], float, float]:
        """Return knots between the two places of the outline about x, with four at each, and these places; infinity
        where the layout ends without one."""
        k = bisect_right(self._starts, x + self._near)
        low = self._starts[k - 1] if k else -np.inf
        k = bisect_left(self._ends, x - self._near)
        high = self._ends[k] if k < len(self._ends) else np.inf
        if (low, high) not in self._rows:
            first, last = bisect_right(self._all, low + self._near), bisect_left(self._all, high - self._near)
            inner = _merge_values(self._all[first:last], self._near)
            row = _extend(inner, x, low, high)
            found = [low] * 4 * bool(np.isfinite(low)) + row + [high] * 4 * bool(np.isfinite(high))
            if not inner:
                return found, low, high  # these depend on x
            self._rows[low, high] = found
        return self._rows[low, high], low, high


def nearest(row: list[float], x: float) -> int:
    """Place of the number in a sorted row that is nearest to x, the first of several."""
    k = bisect_left(row, x)
    if k == len(row) or (k > 0 and x - row[k - 1] <= row[k] - x):
        return bisect_left(row, row[k - 1])
    return k


def overlap(a: Rect, b: Rect, near: float) -> bool:
    """Whether two rectangles share more than a border."""
    return a[0] < b[1] - near and b[0] < a[1] - near and a[2] < b[3] - near and b[2] < a[3] - near


def _merge_values(row: list[float], near: float) -> list[float]:
    """Return distinct values of a sorted row."""
    return row[:1] + [b for a, b in pairwise(row) if b - a > near]


def _extend(inner: list[float], x: float, low: float, high: float) -> list[float]:
    """Return knots with three more where the layout ends without an outline: equal intervals beyond what is known."""
    if np.isfinite(low) and np.isfinite(high):
        return inner
    row = inner or [x]
    ends = [e for e in (low, high) if np.isfinite(e)]
    steps = np.diff(np.unique([*row, *ends]))
    first, last = (float(steps[0]), float(steps[-1])) if len(steps) else (1.0, 1.0)
    before = [] if np.isfinite(low) else [row[0] - k * first for k in (3, 2, 1)]
    after = [] if np.isfinite(high) else [row[-1] + k * last for k in (1, 2, 3)]
    return before + inner + after if inner else before + after
