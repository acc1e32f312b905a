"""Parses ``.tsm`` files (T-splines of Rhino and Fusion) into records, and checks the references between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from surface.base.errors import SurfaceFileError

from .common import Location

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
    """Records by kind. The n-th line of a kind has number n; deleted entities are left out.

    header : by keyword: its line and the rest of that line
    links, edges : by number: half-edge; knot interval
    vertices : by number: line, link, compass word
    creases : line and edge number of each
    grips : by number: line and [x, y, z, weight] of each control point
    owners : line, whether it is the vertex' own grip, and vertex, of every grip in order, deleted ones included
    extras : line, vertex, four counts, grips of each list of extra grips
    missing : line, by vertex, of extra grips that are not those of a regular vertex
    """

    location: Location
    header: dict[str, tuple[int, str]] = field(default_factory=dict)
    links: dict[int, Link] = field(default_factory=dict)
    edges: dict[int, float] = field(default_factory=dict)
    vertices: dict[int, tuple[int, int, str]] = field(default_factory=dict)
    creases: list[tuple[int, int]] = field(default_factory=list)
    grips: dict[int, tuple[int, list[float]]] = field(default_factory=dict)
    owners: list[tuple[int, bool, int]] = field(default_factory=list)
    extras: list[tuple[int, int, list[int], list[int]]] = field(default_factory=list)
    missing: dict[int, int] = field(default_factory=dict)

    def error(self, line: int, why: str, hint: str = "") -> SurfaceFileError:
        """Return the error for a line."""
        return self.location.at(f"line {line}").error(why, hint=hint)


def parse(location: Location, text: str) -> TsmFile:
    """Return the records of a file; ``SurfaceFileError`` names the line."""
    out = TsmFile(location)
    lines = text.splitlines()
    if not lines or lines[0].split()[:1] != [HEADER]:
        raise out.error(1, f"is no T-spline file: it must begin with {HEADER}")
    count = dict.fromkeys(FIELDS, 0)
    for number, line in enumerate(lines[1:], 2):
        kind, *words = line.split("#")[0].split() or [""]
        if kind in FIELDS:
            if words:  # else it is deleted
                _add_entity(out, number, kind, count[kind], words)
            count[kind] += 1
        elif kind:
            _add_other(out, number, kind, words)
    _check_links(out)
    if not out.owners:  # without a grip map, grip n belongs to vertex n
        out.owners = [(out.vertices.get(k, (1,))[0], k in out.vertices, k) for k in range(count["0g"])]
    _check_owners(out)
    if len(out.owners) != count["0g"]:
        raise location.error(f'has {count["0g"]} grips ("0g") and {len(out.owners)} owners ("0m gv", "0m gvp")')
    return out


def _add_entity(out: TsmFile, line: int, kind: str, number: int, words: list[str]) -> None:
    """Add the record of one line of a numbered kind; faces are not needed."""
    if len(words) != FIELDS[kind]:
        raise out.error(line, f'"{kind}" needs {FIELDS[kind]} values, has {len(words)}')
    if kind == "l":
        out.links[number] = Link(line, *_integers(out, line, words)[1:])
    elif kind == "e":
        _, out.edges[number] = _floats(out, line, words)
        if out.edges[number] <= 0:
            raise out.error(line, f"the knot interval must be positive, not {words[1]}")
    elif kind == "v":
        if words[1] not in COMPASS:
            raise out.error(line, f"{words[1]!r} is no compass point ({', '.join(COMPASS)})")
        out.vertices[number] = line, _integers(out, line, words[:1])[0], words[1]
    elif kind == "0g":
        out.grips[number] = line, _floats(out, line, words)
        if out.grips[number][1][3] <= 0:
            raise out.error(line, f"the weight must be positive, not {words[3]}")


def _add_other(out: TsmFile, line: int, kind: str, words: list[str]) -> None:
    """Add the record of a crease, grip map or header line; other lines are not needed."""
    if kind == "ec":
        out.creases.append((line, _integers(out, line, words[:1] or ["nothing"])[0]))
    elif kind == "0m" and words[:1] in (["gv"], ["gvp"]):
        out.owners.append((line, words[0] == "gvp", _integers(out, line, words[1:2] or ["nothing"])[0]))
    elif kind == "0m" and words[:1] == ["cg"]:
        vertex, *values = _integers(out, line, words[1:]) or [0]
        if not values or values[0] < 1:
            raise out.error(line, "a vertex with extra grips must have sides, 4 if it is regular")
        if values[0] != 4 or -1 in values[5:]:  # a star point, or a corner of the outline that points inwards
            out.missing[vertex] = line
            return
        counts, grips = values[1:5], values[5:]
        sizes = [a + a * b for a, b in zip(counts, counts[1:] + counts[:1], strict=True)]
        if len(counts) != 4 or min(counts) < 0 or len(grips) != sum(sizes):
            raise out.error(line, f"lists {len(grips)} grips, which does not fit its counts {counts}")
        out.extras.append((line, vertex, counts, grips))
    else:
        out.header.setdefault(kind, (line, " ".join(words)))


def _check_links(out: TsmFile) -> None:
    """Links and vertices must refer to entities that exist."""
    for link in out.links.values():
        if link.turn not in (0, 1, 2):
            raise out.error(link.line, f"turn must be 0, 1 or 2, not {link.turn}")
        for kind, number, known in (
            ("l", link.next, out.links),
            ("l", link.opposite, out.links),
            ("v", link.vertex, out.vertices),
            ("e", link.edge, out.edges),
        ):
            if number not in known:
                raise out.error(link.line, f'refers to "{kind}" {number}, which the file does not have')
    for vertex, (line, leaving, _) in out.vertices.items():
        if leaving not in out.links or out.links[leaving].vertex != vertex:
            raise out.error(line, f'"v" {vertex} names link {leaving}, which does not leave it')


def _check_owners(out: TsmFile) -> None:
    """Grip maps must refer to vertices and grips that exist."""
    references: list[tuple[int, int, list[int]]] = [
        (line, vertex, []) for line, own, vertex in out.owners if own or vertex >= 0
    ]
    references += [(line, vertex, grips) for line, vertex, _, grips in out.extras]
    references += [(line, vertex, []) for vertex, line in out.missing.items()]
    for line, vertex, grips in references:
        if vertex not in out.vertices:
            raise out.error(line, f'refers to "v" {vertex}, which the file does not have')
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
