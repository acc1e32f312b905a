"""The lines of a ``.tsm`` file as records that only refer to what exists."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

import numpy as np

from surface.base.errors import SurfaceFileError

from .named import Place

HEADER = "#TS0200"
HINT = "convert it to NURBS in the program that made it, and export .3dm"
COMPASS = {"EAST": 0, "NORTH": 1, "WEST": 2, "SOUTH": 3}
FIELDS = {"f": 2, "e": 2, "v": 2, "l": 7, "0g": 4}


@dataclass(frozen=True)
class Link:
    """A half-edge: it leaves ``vertex`` along ``edge``; ``turn`` there is 0 left, 1 straight, 2 right."""

    line: int
    next: int
    opposite: int
    vertex: int
    face: int
    edge: int
    turn: int


@dataclass
class TsmFile:
    """Records by kind; the n-th line of a kind is number n, deleted ones are left out.

    Attributes
    ----------
    lines : word of the header to its line and the rest of it
    links, edges, vertices : by number: link, knot interval, (link, compass word)
    vertex_lines : by number the line of a vertex
    creases : edge numbers with their lines
    grips : (line, [x, y, z, weight]) by number
    owners : (line, is it the vertex' own?, vertex) of every grip in order, deleted ones too
    extras : (line, vertex, four counts, grips)
    """

    place: Place
    lines: dict[str, tuple[int, str]] = field(default_factory=dict)
    links: dict[int, Link] = field(default_factory=dict)
    edges: dict[int, float] = field(default_factory=dict)
    vertices: dict[int, tuple[int, str]] = field(default_factory=dict)
    vertex_lines: dict[int, int] = field(default_factory=dict)
    creases: list[tuple[int, int]] = field(default_factory=list)
    grips: dict[int, tuple[int, list[float]]] = field(default_factory=dict)
    owners: list[tuple[int, bool, int]] = field(default_factory=list)
    extras: list[tuple[int, int, list[int], list[int]]] = field(default_factory=list)

    def error(self, line: int, why: str, hint: str = "") -> SurfaceFileError:
        """The error for a line."""
        return self.place.at(f"line {line}").error(why, hint=hint)


def parse(place: Place, text: str) -> TsmFile:
    """The records of a file; ``SurfaceFileError`` names the line."""
    out = TsmFile(place)
    lines = text.splitlines()
    if not lines or lines[0].split()[:1] != [HEADER]:
        raise place.at("line 1").error(f"is no T-spline file: it must begin with {HEADER}")
    count = dict.fromkeys(FIELDS, 0)
    for number, line in enumerate(lines[1:], 2):
        words = line.split("#")[0].split()
        if not words:
            continue
        kind, rest = words[0], words[1:]
        if kind in FIELDS:
            _entity(out, number, kind, count[kind], rest)
            count[kind] += 1
        else:
            _other(out, number, kind, rest)
    _check(out, count["0g"])
    return out


def _entity(out: TsmFile, line: int, kind: str, number: int, rest: list[str]) -> None:
    """One line of a numbered kind."""
    if not rest:
        return  # deleted
    if len(rest) != FIELDS[kind]:
        raise out.error(line, f'"{kind}" needs {FIELDS[kind]} values, has {len(rest)}')
    if kind == "l":
        values = _integers(out, line, rest)
        out.links[number] = Link(line, *values[1:])
    elif kind == "e":
        out.edges[number] = _floats(out, line, rest)[1]
        if out.edges[number] <= 0:
            raise out.error(line, f"the knot interval must be positive, not {rest[1]}")
    elif kind == "v":
        if rest[1] not in COMPASS:
            raise out.error(line, f"{rest[1]!r} is no compass point ({', '.join(COMPASS)})")
        out.vertices[number] = _integers(out, line, rest[:1])[0], rest[1]
        out.vertex_lines[number] = line
    elif kind == "0g":
        out.grips[number] = line, _floats(out, line, rest)
        if out.grips[number][1][3] <= 0:
            raise out.error(line, f"the weight must be positive, not {rest[3]}")


def _other(out: TsmFile, line: int, kind: str, rest: list[str]) -> None:
    """Creases, grip maps and the header; what omote does not need goes by."""
    if kind == "ec":
        out.creases.append((line, _integers(out, line, rest[:1] or ["nothing"])[0]))
    elif kind == "0m" and rest[:1] in (["gv"], ["gvp"]):
        out.owners.append((line, rest[0] == "gvp", _integers(out, line, rest[1:2] or ["nothing"])[0]))
    elif kind == "0m" and rest[:1] == ["cg"]:
        values = _integers(out, line, rest[1:])
        if len(values) < 2 or values[1] != 4:
            raise out.error(line, "a vertex with extra grips must have 4 sides; star points are not read", HINT)
        counts, grips = values[2:6], values[6:]
        if (
            len(counts) != 4
            or min(counts) < 0
            or len(grips) != sum(a + a * b for a, b in zip(counts, counts[1:] + counts[:1], strict=True))
        ):
            raise out.error(line, f"lists {len(grips)} grips, which does not fit its counts {counts}")
        out.extras.append((line, values[0], counts, grips))
    else:
        out.lines.setdefault(kind, (line, " ".join(rest)))


def _check(out: TsmFile, grips: int) -> None:
    """Everything that is referred to must be there."""
    there: dict[str, Collection[int]] = {"l": out.links, "v": out.vertices, "e": out.edges}
    for link in out.links.values():
        if link.turn not in (0, 1, 2):
            raise out.error(link.line, f"turn must be 0, 1 or 2, not {link.turn}")
        ends = (("l", link.next), ("l", link.opposite), ("v", link.vertex), ("e", link.edge))
        for kind, number in ends:
            if number not in there[kind]:
                raise out.error(link.line, f'refers to "{kind}" {number}, which the file does not have')
    for vertex, (leaving, _) in out.vertices.items():
        if leaving not in out.links or out.links[leaving].vertex != vertex:
            raise out.error(out.vertex_lines[vertex], f'"v" {vertex} names link {leaving}, which does not leave it')
    _check_owners(out)
    if len(out.owners) != grips:
        raise out.place.error(f'has {grips} grips ("0g") and {len(out.owners)} owners ("0m gv", "0m gvp")')


def _check_owners(out: TsmFile) -> None:
    none: list[int] = []
    wanted = [(line, vertex, none) for line, own, vertex in out.owners if own or vertex >= 0]
    wanted += [(line, vertex, grips) for line, vertex, _, grips in out.extras]
    for line, vertex, grips in wanted:
        if vertex not in out.vertices:
            raise out.error(line, f'refers to "v" {vertex}, which the file does not have')
        if -1 in grips:
            raise out.error(line, "leaves grips out (-1), as at star points and holes; these are not read", HINT)
        if any(grip not in out.grips for grip in grips):
            raise out.error(line, f'refers to a "0g" that the file does not have: {grips}')


def _integers(out: TsmFile, line: int, words: Sequence[str]) -> list[int]:
    try:
        return [int(word) for word in words]
    except ValueError as error:
        raise out.error(line, f"needs whole numbers, not {' '.join(words)[:60]!r}") from error


def _floats(out: TsmFile, line: int, words: Sequence[str]) -> list[float]:
    try:
        values = [float(word) for word in words]
    except ValueError as error:
        raise out.error(line, f"needs numbers ({error})") from error
    if not np.isfinite(values).all():
        raise out.error(line, f"numbers must be finite, not {' '.join(words)}")
    return values
