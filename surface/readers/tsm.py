"""T-splines in Rhino's and Fusion's text format ``.tsm`` (header ``#TS0200``), where one rectangle carries them.

The n-th line of each kind is entity n; a kind alone is a deleted one::

    f  link flag                                     face
    e  link interval                                 edge, knot interval along it
    v  link COMPASS                                  vertex; that link leaves it to that side, in the vertex' own frame
    l  previous next opposite vertex face edge turn  half-edge from vertex; turn at it: 0 left, 1 straight, 2 right
    ec edge 0                                        creased edge
    0m gvp vertex | 0m gv vertex                     what the grips, in order, belong to (gvp: the vertex' own)
    0m cg vertex 4 count count count count grip...   extra grips to north, west, south, east; each side's are
                                                     followed by those between it and the next side
    0g x y z weight                                  grip: control point

Knots of a grip are those that rays from it through the T-mesh meet (Sederberg, Zheng, Bakenov and Nasri 2003,
rule 1). With Bezier end conditions the outline has every knot four times, and its vertices have extra grips one
knot further in. That is a DCP surface exactly. Refused are star points, creases inside, outlines that are no
rectangle, and other end conditions: no local knot vectors in one (u, v) plane describe them, or the format does
not tell which.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from surface.base.arrays import Floats
from surface.dcp import DCPSurface

from .named import NamedSurface, Place, read_text
from .tsmfile import COMPASS, HINT, TsmFile, parse

STEP = ((1, 0), (0, 1), (-1, 0), (0, -1))
SIDES = (1, 2, 3, 0)  # the order of counts in "0m cg"
NEAR = 1e-9  # of the outline's size: knot intervals are sums of decimal numbers


@dataclass(frozen=True)
class Anchor:
    """Where a grip stands: (u, v), and how many knots further in along each direction (-1, 0 or 1)."""

    uv: tuple[float, float]
    inward: tuple[int, int]


def read(path: Path) -> list[NamedSurface]:
    """The surface of a file; ``SurfaceFileError`` names the line."""
    place = Place(path)
    file = parse(place, read_text(path, errors="replace"))  # comments may be in any encoding
    if file.lines.get("degree", (1, ""))[1] != "3":
        line, words = file.lines.get("degree", (1, "missing"))
        raise file.error(line, f'"degree" is {words}; T-splines of degree 3 are read')
    if file.lines.get("force-bezier-end-conditions", (1, ""))[1] != "1":
        line, words = file.lines.get("force-bezier-end-conditions", (1, "missing"))
        why = f'"force-bezier-end-conditions" is {words}: closed forms and other ends are not read, only Bezier ends'
        raise file.error(line, why, HINT)
    if not file.links or not file.grips:
        raise place.error('has no links ("l") or no grips ("0g")')
    mesh = TMesh(file)
    anchors = _anchors(file, mesh)
    rows = np.array([file.grips[number][1] for number in anchors])
    knots = [[mesh.knots(axis, anchor) for anchor in anchors.values()] for axis in range(2)]
    try:
        surface = DCPSurface(rows[:, :3], rows[:, 3], *knots)
    except ValueError as error:
        raise place.error(str(error)) from error
    return [NamedSurface(path.stem, surface)]


def _anchors(file: TsmFile, mesh: TMesh) -> dict[int, Anchor]:
    """By grip number, where each grip stands."""
    out: dict[int, Anchor] = {}
    held = dict.fromkeys(mesh.uv, 0)
    for number, (_, own, vertex) in enumerate(file.owners):
        if own and number in file.grips:
            out[number] = Anchor(mesh.uv[vertex], (0, 0))
            held[vertex] += 1
    for line, vertex, counts, grips in file.extras:
        for (first, second), grip in zip(_slots(counts), grips, strict=True):
            sides = [mesh.side(vertex, side) for side in (first, second) if side is not None]
            u, v = (sum(STEP[side][axis] for side in sides) for axis in range(2))
            anchor = Anchor(mesh.uv[vertex], (u, v))
            if grip in out or not mesh.allows(anchor):
                raise file.error(line, f"grip {grip} stands where Bezier ends have none", HINT)
            out[grip] = anchor
            held[vertex] += 1
    missing = sorted(set(file.grips) - set(out))
    if missing:
        raise file.error(file.grips[missing[0]][0], f"grip {missing[0]} has no place in the mesh", HINT)
    if any(held[vertex] != mesh.grips_at(uv) for vertex, uv in mesh.uv.items()):
        vertex = next(v for v, uv in mesh.uv.items() if held[v] != mesh.grips_at(uv))
        why = f"vertex {vertex} has {held[vertex]} grips, {mesh.grips_at(mesh.uv[vertex])} stand there with Bezier ends"
        raise file.error(file.vertex_lines[vertex], why, HINT)
    return out


def _slots(counts: list[int]) -> list[tuple[int, int | None]]:
    """For every grip of a "0m cg" line the side, or the two sides, it stands at."""
    out: list[tuple[int, int | None]] = []
    for k, side in enumerate(SIDES):
        after = SIDES[(k + 1) % 4]
        out += [(side, None)] * counts[k] + [(side, after)] * (counts[k] * counts[(k + 1) % 4])
    return out


class TMesh:
    """A T-mesh laid out in the plane.

    Attributes
    ----------
    uv : (u, v) by vertex
    """

    def __init__(self, file: TsmFile) -> None:
        self._file = file
        self._direction: dict[int, int] = {}
        self.uv: dict[int, tuple[float, float]] = {}
        self._check_stars()
        self._spread()
        us, vs = (np.array([uv[axis] for uv in self.uv.values()]) for axis in range(2))
        self._rect = us.min(), us.max(), vs.min(), vs.max()
        self._near = NEAR * max(np.ptp(us), np.ptp(vs))
        self._snap()
        self._check_outline()
        self._lines = [self._edges_across(axis) for axis in range(2)]

    def _check_stars(self) -> None:
        """Corners around a vertex of the plane make 360 degrees, that of the outside included."""
        quarters = dict.fromkeys(self._file.vertices, 0)
        for link in self._file.links.values():
            quarters[link.vertex] += 1 + link.turn  # left 90, straight 180, right 270 degrees
        for vertex, count in quarters.items():
            if count != 4:
                why = f"vertex {vertex} is a star point: {90 * count} degrees around it; star points are not read"
                raise self._file.error(self._file.vertex_lines[vertex], why, HINT)
        if all(link.face >= 0 for link in self._file.links.values()):
            line = next(iter(self._file.links.values())).line
            raise self._file.error(line, "no link borders the outside: the form is closed, which is not read", HINT)

    def _spread(self) -> None:
        """Walk from link to link; what comes to another place by another way does not fit the plane."""
        file = self._file
        first = min(file.links)
        start = file.links[first].vertex
        link, word = file.vertices[start]
        self._direction[link], self.uv[start] = COMPASS[word], (0.0, 0.0)
        queue = [link]
        while queue:
            number = queue.pop()
            here = file.links[number]
            way = self._direction[number]
            u, v = self.uv[here.vertex]
            length = file.edges[here.edge]
            end = u + STEP[way][0] * length, v + STEP[way][1] * length
            turned = (way + 1 - file.links[here.next].turn) % 4
            for other, direction in ((here.next, turned), (here.opposite, (way + 2) % 4)):
                if self._settle(other, direction, end):
                    queue.append(other)
        if len(self._direction) != len(file.links):
            apart = min(set(file.links) - set(self._direction))
            why = f"link {apart} belongs to another piece than link {first}; one T-spline a file is read"
            raise file.error(file.links[apart].line, why, HINT)

    def _settle(self, number: int, direction: int, uv: tuple[float, float]) -> bool:
        """Give a link its direction and its vertex a place; False if they had them."""
        link = self._file.links[number]
        there = self.uv.setdefault(link.vertex, uv)
        known = self._direction.get(number)
        size = 1e-9 * sum(self._file.edges.values())
        if (known is not None and known != direction) or max(abs(a - b) for a, b in zip(there, uv, strict=True)) > size:
            why = (
                f"vertex {link.vertex} comes to lie at two places: the form closes on itself, which is not read, or "
                "its knot intervals do not add up"
            )
            raise self._file.error(link.line, why, HINT)
        self._direction[number] = direction
        return known is None

    def _snap(self) -> None:
        """Make knots that are equal but for rounding equal."""
        for axis in range(2):
            values = np.sort([uv[axis] for uv in self.uv.values()])
            firsts = values[np.concatenate([[True], np.diff(values) > self._near])]
            for vertex, uv in self.uv.items():
                new = list(uv)
                new[axis] = float(firsts[np.searchsorted(firsts, uv[axis] + self._near) - 1])
                self.uv[vertex] = new[0], new[1]
        us, vs = zip(*self.uv.values(), strict=True)
        self._rect = min(us), max(us), min(vs), max(vs)

    def _check_outline(self) -> None:
        """The outline must be the rectangle around everything, and creases may be nowhere else."""
        border = {link.edge for link in self._file.links.values() if link.face < 0}
        ends: dict[int, list[tuple[float, float]]] = {}
        for link in self._file.links.values():
            ends.setdefault(link.edge, []).append(self.uv[link.vertex])
            if link.edge in border and not self._on_one_side(ends[link.edge]):
                raise self._file.error(link.line, "the outline is no rectangle", HINT)
        for line, edge in self._file.creases:
            if edge not in border:
                raise self._file.error(line, f"edge {edge} is creased inside the surface", HINT)

    def _on_one_side(self, points: list[tuple[float, float]]) -> bool:
        """Do all lie on one side of the rectangle?"""
        return any(all(uv[side // 2] == self._rect[side] for uv in points) for side in range(4))

    def _edges_across(self, axis: int) -> Floats:
        """(k, 3): place along ``axis``, and where it starts and ends, of every edge across it."""
        rows = []
        for number, link in self._file.links.items():
            if self._direction[number] % 2 != axis and self._direction[number] < 2:
                a, b = self.uv[link.vertex], self.uv[self._file.links[link.opposite].vertex]
                rows.append((a[axis], a[1 - axis], b[1 - axis]))
        return np.array(rows)

    def side(self, vertex: int, side: int) -> int:
        """A side of a vertex' own frame as a direction of the plane."""
        link, word = self._file.vertices[vertex]
        return (side + self._direction[link] - COMPASS[word]) % 4

    def _ends(self, uv: tuple[float, float]) -> tuple[int, int]:
        """Along each direction: 1 at the low end of the rectangle, -1 at the high end, 0 between."""
        r = self._rect
        return tuple(int(uv[k] == r[2 * k]) - int(uv[k] == r[2 * k + 1]) for k in range(2))  # type: ignore[return-value]

    def allows(self, anchor: Anchor) -> bool:
        """Extra grips stand at the outline, and inwards."""
        return all(step in (0, end) for step, end in zip(anchor.inward, self._ends(anchor.uv), strict=True))

    def grips_at(self, uv: tuple[float, float]) -> int:
        """How many grips a vertex there has: 1 inside, 2 on a side, 4 at a corner."""
        return int(2 ** sum(abs(end) for end in self._ends(uv)))

    def knots(self, axis: int, anchor: Anchor) -> list[float]:
        """The five knots of a grip along u (0) or v (1)."""
        x, y = anchor.uv[axis], anchor.uv[1 - axis]
        low, high = self._rect[2 * axis], self._rect[2 * axis + 1]
        lines = self._lines[axis]
        met = np.unique(lines[(lines[:, 1] <= y) & (y <= lines[:, 2]), 0])
        row = [low] * 3 + [float(t) for t in met if low < t < high] + [high] * 3
        centre = row.index(x, 1) + anchor.inward[axis] if x < high else len(row) - 2 + anchor.inward[axis]
        return [low, *row, high][centre - 1 : centre + 4]
