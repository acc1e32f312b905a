"""Reader of T-splines in Rhino's and Fusion's text format ``.tsm`` (header ``#TS0200``).

The n-th line of each kind describes entity n; a line with nothing but its kind stands for a deleted entity::

    f  link flag                                     face
    e  link interval                                 edge, knot interval along it
    v  link COMPASS                                  vertex; in its own frame the link leaves it in this direction
    l  previous next opposite vertex face edge turn  half-edge from vertex; turn at it: 0 left, 1 straight, 2 right
    ec edge 0                                        creased edge
    0m gvp vertex | 0m gv vertex                     what the grips, in order, belong to (gvp: the vertex' own)
    0m cg vertex 4 count count count count grip...   extra grips to north, west, south, east; each side's are
                                                     followed by those between it and the next side
    0g x y z weight                                  grip: control point

Knots of a grip are those that rays from it through the T-mesh meet (Sederberg, Zheng, Bakenov and Nasri 2003,
rule 1). With Bezier end conditions the outline has every knot four times, and its vertices have extra grips one
knot further in. Where the outline is one rectangle that is a DCP surface exactly. Other forms, closed ones, those with
star points or with outlines that have corners inwards, become islands of one plane (:mod:`surface.readers.tcharts`),
exact but near star points. Creases inside and other end conditions are refused.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from surface.base.arrays import Floats
from surface.dcp import DCPSurface

from .common import Location, NamedSurface, read_text
from .tcharts import read_complex
from .tlayout import STEP, directions
from .tsmfile import COMPASS, HINT, Link, TsmFile, parse

NEAR = 1e-9  # of the outline's size, within which knots are equal: they are sums of rounded decimal numbers


@dataclass(frozen=True)
class Anchor:
    """Position of a grip: (u, v) of its vertex, and by how many knots it lies further in along u and v (-1, 0 or 1)."""

    uv: tuple[float, float]
    inward: tuple[int, int]


def read(path: Path) -> list[NamedSurface]:
    """Return the surface of a file; ``SurfaceFileError`` names the line."""
    location = Location(path)
    file = parse(location, read_text(path, errors="replace"))  # comments may be in any encoding
    _require(file, "degree", "3", "T-splines of degree 3 are read")
    if not file.links or not file.grips:
        raise location.error('has no links ("l") or no grips ("0g")')
    outline = [link for link in file.links.values() if link.face < 0]
    if outline:
        _require(file, "force-bezier-end-conditions", "1", "an outline with other ends is not read, only Bezier ends")
    if _is_complex(file, outline):
        _check_creases(file)
        return [read_complex(file, path.stem)]
    mesh = TMesh(file)
    anchors = _anchors(file, mesh)
    rows = np.array([file.grips[number][1] for number in anchors])
    knots = [[mesh.knots(axis, anchor) for anchor in anchors.values()] for axis in range(2)]
    try:
        surface = DCPSurface(rows[:, :3], rows[:, 3], *knots)
    except ValueError as error:
        raise location.error(str(error)) from error
    return [NamedSurface(path.stem, surface)]


def _is_complex(file: TsmFile, outline: list[Link]) -> bool:
    """Whether a form is more than one rectangle: closed, with star points, or with corners that point inwards."""
    quarters = dict.fromkeys(file.vertices, 0)
    for link in file.links.values():
        quarters[link.vertex] += 1 + link.turn  # left 90, straight 180, right 270 degrees
    stars = any(count != 4 for count in quarters.values())
    return stars or bool(file.missing) or not outline or any(link.turn == 0 for link in outline)


def _check_creases(file: TsmFile) -> None:
    """``SurfaceFileError`` for a crease inside."""
    border = {link.edge for link in file.links.values() if link.face < 0}
    for line, edge in file.creases:
        if edge not in border:
            raise file.error(line, f"edge {edge} is creased inside the surface", HINT)


def _require(file: TsmFile, key: str, value: str, why: str) -> None:
    """``SurfaceFileError`` unless the header line ``key`` has that value."""
    line, found = file.header.get(key, (1, "missing"))
    if found != value:
        raise file.error(line, f'"{key}" is {found}; {why}', HINT)


def _anchors(file: TsmFile, mesh: TMesh) -> dict[int, Anchor]:
    """Return anchors by grip number."""
    out: dict[int, Anchor] = {}
    counts = dict.fromkeys(mesh.uv, 0)
    for number, (_, own, vertex) in enumerate(file.owners):
        if own and number in file.grips:
            out[number] = Anchor(mesh.uv[vertex], (0, 0))
            counts[vertex] += 1
    for line, vertex, sizes, grips in file.extras:
        for sides, grip in zip(directions(sizes), grips, strict=True):
            steps = [STEP[mesh.direction(vertex, side)] for side in sides]
            anchor = Anchor(mesh.uv[vertex], (sum(u for u, _ in steps), sum(v for _, v in steps)))
            if grip in out or not mesh.allows(anchor):
                raise file.error(line, f"grip {grip} lies where Bezier ends have none", HINT)
            out[grip] = anchor
            counts[vertex] += 1
    missing = sorted(set(file.grips) - set(out))
    if missing:
        raise file.error(file.grips[missing[0]][0], f"grip {missing[0]} has no place in the mesh", HINT)
    for vertex, uv in mesh.uv.items():
        needed = mesh.grips_at(uv)
        if counts[vertex] != needed:
            why = f"vertex {vertex} has {counts[vertex]} grips, {needed} belong there with Bezier ends"
            raise file.error(file.vertices[vertex][0], why, HINT)
    return out


class TMesh:
    """A T-mesh laid out in the plane; ``SurfaceFileError`` where it is no rectangle with regular vertices.

    uv : (u, v) by vertex
    """

    def __init__(self, file: TsmFile) -> None:
        self._file = file
        self._direction: dict[int, int] = {}
        self.uv: dict[int, tuple[float, float]] = {}
        self._lay_out()
        self._merge_equal_knots()
        us, vs = zip(*self.uv.values(), strict=True)
        self._rect = min(us), max(us), min(vs), max(vs)
        self._check_outline()
        self._lines = [self._edges_across(axis) for axis in range(2)]

    def _lay_out(self) -> None:
        """Give every vertex a position and every link a direction, walking from link to link."""
        file = self._file
        first = min(file.links)
        start = file.links[first].vertex
        _, link, word = file.vertices[start]
        self._direction[link], self.uv[start] = COMPASS[word], (0.0, 0.0)
        queue = [link]
        while queue:
            number = queue.pop()
            here = file.links[number]
            way = self._direction[number]
            u, v = self.uv[here.vertex]
            length = file.edges[here.edge]
            end = u + STEP[way][0] * length, v + STEP[way][1] * length
            following = (way + 1 - file.links[here.next].turn) % 4
            for other, direction in ((here.next, following), (here.opposite, (way + 2) % 4)):
                if self._place(other, direction, end):
                    queue.append(other)
        if len(self._direction) != len(file.links):
            apart = min(set(file.links) - set(self._direction))
            why = f"link {apart} belongs to another piece than link {first}; one T-spline a file is read"
            raise file.error(file.links[apart].line, why, HINT)

    def _place(self, number: int, direction: int, uv: tuple[float, float]) -> bool:
        """Give a link its direction and its vertex a position; False if the link had a direction already."""
        link = self._file.links[number]
        known, size = self._direction.get(number), NEAR * sum(self._file.edges.values())
        distance = max(abs(a - b) for a, b in zip(self.uv.setdefault(link.vertex, uv), uv, strict=True))
        if known not in (None, direction) or distance > size:
            why = (
                f"vertex {link.vertex} comes to lie at two places: the form closes on itself, which is not read, or "
                "its knot intervals do not add up"
            )
            raise self._file.error(link.line, why, HINT)
        self._direction[number] = direction
        return known is None

    def _merge_equal_knots(self) -> None:
        """Make knots equal that differ only by rounding."""
        table = np.array(list(self.uv.values()))
        near = NEAR * np.ptp(table, axis=0).max()
        for axis in range(2):
            values = np.sort(table[:, axis])
            firsts = values[np.concatenate([[True], np.diff(values) > near])]
            table[:, axis] = firsts[np.searchsorted(firsts, table[:, axis] + near) - 1]
        self.uv = {vertex: (u, v) for vertex, (u, v) in zip(self.uv, table.tolist(), strict=True)}

    def _check_outline(self) -> None:
        """The outline must be the rectangle around everything, and creases may be nowhere else."""
        border = {link.edge for link in self._file.links.values() if link.face < 0}
        ends: dict[int, list[tuple[float, float]]] = {}
        for link in self._file.links.values():
            ends.setdefault(link.edge, []).append(self.uv[link.vertex])
            on_a_side = any(all(uv[k // 2] == self._rect[k] for uv in ends[link.edge]) for k in range(4))
            if link.edge in border and not on_a_side:
                raise self._file.error(link.line, "the outline is no rectangle", HINT)
        for line, edge in self._file.creases:
            if edge not in border:
                raise self._file.error(line, f"edge {edge} is creased inside the surface", HINT)

    def _edges_across(self, axis: int) -> Floats:
        """Return (k, 3): coordinate along ``axis`` of every edge across it, and where the edge starts and ends."""
        rows = []
        for number, link in self._file.links.items():
            if self._direction[number] == 1 - axis:
                a, b = self.uv[link.vertex], self.uv[self._file.links[link.opposite].vertex]
                rows.append((a[axis], a[1 - axis], b[1 - axis]))
        return np.array(rows)

    def direction(self, vertex: int, side: int) -> int:
        """Return the direction in the plane of a side of a vertex' own frame."""
        _, link, word = self._file.vertices[vertex]
        return (side + self._direction[link] - COMPASS[word]) % 4

    def _ends(self, uv: tuple[float, float]) -> tuple[int, int]:
        """Return along each direction: 1 at the low end of the rectangle, -1 at the high end, 0 between."""
        u0, u1, v0, v1 = self._rect
        return int(uv[0] == u0) - int(uv[0] == u1), int(uv[1] == v0) - int(uv[1] == v1)

    def allows(self, anchor: Anchor) -> bool:
        """Whether an extra grip lies at the outline, and inwards."""
        return all(step in (0, end) for step, end in zip(anchor.inward, self._ends(anchor.uv), strict=True))

    def grips_at(self, uv: tuple[float, float]) -> int:
        """Return how many grips a vertex there has: 1 inside, 2 on a side, 4 at a corner."""
        return int(2 ** sum(abs(end) for end in self._ends(uv)))

    def knots(self, axis: int, anchor: Anchor) -> list[float]:
        """Return the five knots of a grip along u (0) or v (1)."""
        x, y = anchor.uv[axis], anchor.uv[1 - axis]
        low, high = self._rect[2 * axis], self._rect[2 * axis + 1]
        lines = self._lines[axis]
        crossed = np.unique(lines[(lines[:, 1] <= y) & (y <= lines[:, 2]), 0])
        row = [low] * 3 + [float(t) for t in crossed if low < t < high] + [high] * 3
        centre = row.index(x, 1) + anchor.inward[axis] if x < high else len(row) - 2 + anchor.inward[axis]
        return [low, *row, high][centre - 1 : centre + 4]
