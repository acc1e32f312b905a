"""Reader of G+Smo's XML: tensor-product B-splines and NURBS, hierarchical (HB) and truncated hierarchical splines.

All ``<Geometry>`` elements of the types in :data:`KINDS` are read. In ``<coefs>`` the first direction runs fastest. A
box of a hierarchy holds its lower left and upper right corner as indices into the distinct knots of its own level; a
place has the level of the finest box that holds it. Levels halve every span of the level before unless the file gives
each (``manualLevels``). A knot vector of ``mode="uniform"`` only states how many functions lie on equal steps from 0
to 1. Coefficients in the plane (``geoDim="2"``) get z = 0. Rational hierarchical splines and bases marked as periodic
are refused: G+Smo writes neither.
"""

from __future__ import annotations

from pathlib import Path
from typing import cast
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.base.checks import check_weights
from surface.dcp import DCPSurface
from surface.mesh.domain import Domain
from surface.spline.basis import MAX_DEGREE
from surface.spline.nurbs import nurbs_arrays

from .common import Location, NamedSurface, read_text
from .thb import Hierarchy, Level, dyadic_refinement

KINDS = ("TensorBSpline2", "TensorNurbs2", "HBSpline2", "THBSpline2")
MAX_LEVELS = 16
MAX_CELLS = 1 << 24
MAX_FUNCTIONS = 1 << 14  # along one direction, where a file only says how many
MAX_KNOT = 1e100  # of knots: their products stay finite
CLOSE = 1e-14  # of the range of the knots


class Element(ElementTree.Element):
    """An XML element with its line in the file; wrong content raises ``SurfaceFileError`` that names it."""

    location: Location

    def children(self, tag: str) -> list[Element]:
        """Return children with that tag."""
        return cast(list[Element], self.findall(tag))

    def first(self, tag: str) -> Element:
        """Return the first child with that tag; there must be one."""
        found = self.children(tag)
        if not found:
            raise self.location.error(f"has no <{tag}>")
        return found[0]

    def required(self, name: str) -> str:
        """Return an attribute that must be there."""
        if name not in self.attrib:
            raise self.location.error(f'has no attribute "{name}"')
        return self.attrib[name]

    def integer(self, name: str, low: int, high: int) -> int:
        """Return a whole number in an attribute, ``low`` to ``high``."""
        text = self.required(name)
        if not text.strip().isdecimal() or not low <= int(text) <= high:
            raise self.location.error(f'{name}="{text}" must be a whole number from {low} to {high}')
        return int(text)

    def numbers(self, count: int | None = None) -> Floats:
        """Return (k,): finite numbers of the text, ``count`` of them if given."""
        if self.get("format", "ascii").lower() != "ascii":
            raise self.location.error(f'format="{self.get("format")}" is not read', hint="write it as ASCII")
        words = "".join([self.text or "", *(child.tail or "" for child in self)]).split()
        try:
            row = np.array([float(word) for word in words])
        except ValueError as error:
            raise self.location.error(f"holds what is not a number ({error})") from error
        if not np.isfinite(row).all():
            raise self.location.error(f"holds {words[int(np.argmin(np.isfinite(row)))]}; numbers must be finite")
        if count is not None and len(row) != count:
            raise self.location.error(f"holds {len(row)} numbers, needs {count}")
        return row


def read(path: Path) -> list[NamedSurface]:
    """Return the surfaces of a file; ``SurfaceFileError`` names line and element."""
    root = parse_xml(Location(path), read_text(path))
    if root.tag != "xml":
        raise root.location.error("is no G+Smo file: its root must be <xml>")
    return [_surface(element, number) for number, element in enumerate(root.children("Geometry"))]


def parse_xml(file: Location, text: str) -> Element:
    """Return the root element; ``SurfaceFileError`` with the line where the text is not XML."""
    parser = expat.ParserCreate()
    body = text.lstrip()  # G+Smo writes lines before the declaration, which XML forbids
    skipped = text[: len(text) - len(body)].count("\n")

    def make(tag: str, attributes: dict[str, str]) -> Element:
        element = Element(tag, attributes)
        element.location = file.at(f"line {parser.CurrentLineNumber + skipped} <{tag}>")
        return element

    def refuse(name: str, *_: object) -> None:
        here = file.at(f"line {parser.CurrentLineNumber + skipped}")
        raise here.error(f"declares an entity ({name}), which is not read")

    builder = ElementTree.TreeBuilder(make)
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(body.encode("utf-8"), True)
    except expat.ExpatError as error:
        why = expat.errors.messages[error.code]
        raise file.at(f"line {error.lineno + skipped}").error(f"is not XML: {why}") from error
    return cast(Element, builder.close())


def _surface(element: Element, number: int) -> NamedSurface:
    kind = element.required("type")
    name = element.get("label") or f"{kind} {element.get('id', number)}"
    if kind not in KINDS:
        hint = f"use {', '.join(KINDS)}"
        if kind.startswith("Rational"):
            hint = "give every weight 1 and save a THBSpline2, or insert knots until it is a TensorNurbs2"
        raise element.location.error(f'type="{kind}" is no surface omote reads', hint=hint)
    if element.children("transform"):
        raise element.location.error("has a <transform>, which is not read", hint="apply it to the coefficients")
    basis = element.first("Basis")
    if kind == "TensorBSpline2":
        level = _level(basis)
        surface = _tensor(element, level, None)
    elif kind == "TensorNurbs2":
        level = _level(basis.first("Basis"))
        surface = _tensor(element, level, basis.first("weights"))
    else:
        surface, level = _hierarchical(element, basis, kind)
    # The basis sums to 1 here: everywhere with open knot vectors, with others in less than where points reach.
    (u0, u1), (v0, v1) = ((float(t[p]), float(t[-p - 1])) for t, p in zip(level.knots, level.degrees, strict=True))
    rect = u0, u1, v0, v1
    return NamedSurface(name, surface, None if rect == surface.rect else Domain(rect))


def _level(element: Element) -> Level:
    """Return a tensor-product basis."""
    sides = element.children("Basis")
    if len(sides) != 2:
        raise element.location.error(f"has {len(sides)} directions, a surface has 2")
    for each in (element, *sides):
        _refuse_periodic(each)
    degrees, knots = zip(*(_knots(side.first("KnotVector")) for side in sides), strict=True)
    return Level((degrees[0], degrees[1]), (knots[0], knots[1]))


def _refuse_periodic(element: Element) -> None:
    """G+Smo itself writes periodic bases as plain knots; a mark that says otherwise must not be ignored."""
    if element.get("periodic", "-1").strip().lower() not in ("-1", "false"):
        raise element.location.error("is periodic, which is not read", hint="unclamp it into an open knot vector")


def _knots(element: Element) -> tuple[int, Floats]:
    """Return degree and knot vector."""
    _refuse_periodic(element)
    p = element.integer("degree", 0, MAX_DEGREE)
    if element.get("mode") == "uniform":
        count = element.integer("csize", p + 1, MAX_FUNCTIONS)
        return p, np.concatenate([[0.0] * p, np.linspace(0, 1, count - p + 1), [1.0] * p])
    knots = element.numbers()
    if len(knots) < 2 * p + 2:
        raise element.location.error(f"holds {len(knots)} knots, degree {p} needs {2 * p + 2} at least")
    if (np.abs(knots) > MAX_KNOT).any():
        raise element.location.error(f"holds knots beyond {MAX_KNOT:g}")
    steps = np.diff(knots)
    if (steps < 0).any():
        k = int(np.argmax(steps < 0)) + 1
        raise element.location.error(f"knots decrease at knot {k} ({knots[k]} after {knots[k - 1]})")
    rising = knots[p + 1 :] > knots[: -p - 1]
    if not rising.all():
        raise element.location.error(f"knot {knots[int(np.argmin(rising))]} occurs more than {p + 1} times")
    close = (steps > 0) & (steps < CLOSE * np.ptp(knots))
    if close.any():
        k = int(np.argmax(close))
        raise element.location.error(f"knots {k} and {k + 1} are too close to tell apart")
    return p, knots


def _coefficients(element: Element, count: int) -> Floats:
    """Return (count, 3): float64."""
    coefs = element.first("coefs")
    dimension = coefs.integer("geoDim", 1, 9)
    if dimension not in (2, 3):
        raise coefs.location.error(f"geoDim={dimension}: a surface is in the plane or in space (2 or 3)")
    row = coefs.numbers(count * dimension)
    by_coordinate = coefs.get("order") == "coordinates"
    table = row.reshape(dimension, count).T if by_coordinate else row.reshape(count, dimension)
    return np.hstack([table, np.zeros((count, 3 - dimension))])


def _tensor(element: Element, level: Level, weights: Element | None) -> DCPSurface:
    nu, nv = level.shape
    w = None
    if weights is not None:
        try:
            w = check_weights(weights.numbers(nu * nv)).reshape(nv, nu).T
        except ValueError as error:
            raise weights.location.error(str(error)) from error
    net = _coefficients(element, nu * nv).reshape(nv, nu, 3).transpose(1, 0, 2)
    return DCPSurface(*nurbs_arrays(*level.degrees, *level.knots, net, w))


def _hierarchical(element: Element, basis: Element, kind: str) -> tuple[DCPSurface, Level]:
    boxes = basis.children("box")
    levels = _levels(basis, max((box.integer("level", 0, MAX_LEVELS) for box in boxes), default=0))
    hierarchy = Hierarchy(levels, _depth(boxes, levels))
    coefficients = _coefficients(element, len(hierarchy.active))
    if kind == "HBSpline2":
        coefficients = hierarchy.to_truncated(coefficients)
    return DCPSurface(*hierarchy.control_points(coefficients)), levels[0]


def _levels(basis: Element, finest: int) -> list[Level]:
    """Return levels 0 to ``finest``, each nested in the next."""
    given = basis.children("Basis")
    levels = [_level(basis.first("Basis"))]
    if basis.get("manualLevels", "false").lower() == "true":
        levels += [_level(one) for one in given[1:]]
        if len(levels) <= finest:
            raise basis.location.error(f"gives {len(levels)} levels, a box asks for level {finest}")
        for number in range(1, len(levels)):
            _check_nested(given[number], levels[number - 1], levels[number])
    while len(levels) <= finest:
        levels.append(dyadic_refinement(levels[-1]))
        nu, nv = levels[-1].shape
        if nu * nv > MAX_CELLS:
            raise basis.location.error(f"its finest level has {nu} x {nv} functions, more than {MAX_CELLS}")
    return levels[: finest + 1]


def _check_nested(element: Element, coarse: Level, fine: Level) -> None:
    if coarse.degrees != fine.degrees:
        raise element.location.error("has another degree than the level before, so it cannot be taken exactly")
    for axis, (a, b) in enumerate(zip(coarse.knots, fine.knots, strict=True)):
        values, counts = np.unique(a, return_counts=True)
        if any((b == x).sum() < n for x, n in zip(values, counts, strict=True)):
            raise element.location.error(f"direction {axis} lacks a knot of the level before: levels are not nested")


def _depth(boxes: list[Element], levels: list[Level]) -> Ints:
    """Return (a, b): the level of every cell of the finest level's knot lines."""
    lines = [np.unique(t) for t in levels[-1].knots]
    depth = np.zeros([len(x) - 1 for x in lines], dtype=np.int64)
    for box in boxes:
        number = box.integer("level", 0, MAX_LEVELS)
        corners = [int(x) for x in box.numbers(4)]
        slices = []
        for axis in range(2):
            own = np.unique(levels[number].knots[axis])
            low, high = corners[axis], corners[axis + 2]
            if not 0 <= low < high < len(own):
                why = f"reaches from {low} to {high} in direction {axis}; 0 to {len(own) - 1} exist"
                raise box.location.error(why)
            slices.append(slice(*np.searchsorted(lines[axis], [own[low], own[high]])))
        part = depth[slices[0], slices[1]]
        np.maximum(part, number, out=part)
    return depth
