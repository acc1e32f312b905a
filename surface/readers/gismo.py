"""G+Smo's XML: tensor-product B-splines and NURBS, hierarchical (HB) and truncated hierarchical (THB) splines.

Read are ``<Geometry>`` elements of the types in :data:`KINDS`, all of a file. Coefficients stand with the first
direction running fastest. A box of a hierarchy holds lower left and upper right corner in numbers of the distinct
knots of its own level; a place has the level of the finest box that holds it. Levels halve every span of the one
before unless the file gives each (``manualLevels``). A knot vector of ``mode="uniform"`` only tells how many
functions stand on equal steps from 0 to 1. Coefficients in the plane (``geoDim="2"``) get z = 0. Rational hierarchical
splines and bases that call themselves periodic are refused: G+Smo writes neither.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.base.checks import check_weights
from surface.dcp import DCPSurface
from surface.mesh.domain import Domain
from surface.spline.basis import MAX_DEGREE
from surface.spline.nurbs import nurbs_arrays

from . import xmltree
from .named import NamedSurface, Place, read_text
from .thb import Hierarchy, Level, halved
from .xmltree import Element

KINDS = ("TensorBSpline2", "TensorNurbs2", "HBSpline2", "THBSpline2")
MOST_LEVELS = 16
MOST_CELLS = 1 << 24
MOST_FUNCTIONS = 1 << 14  # along one direction, where a file only says how many
LARGEST = 1e100  # of knots: their products stay numbers
CLOSE = 1e-14  # of the range of the knots


def read(path: Path) -> list[NamedSurface]:
    """The surfaces of a file; ``SurfaceFileError`` names line and element."""
    place = Place(path)
    root = xmltree.parse(place, read_text(path))
    if root.tag != "xml":
        raise root.place.error("is no G+Smo file: its root must be <xml>")
    return [_surface(element, number) for number, element in enumerate(root.all("Geometry"))]


def _surface(element: Element, number: int) -> NamedSurface:
    kind = element.get("type")
    name = element.attributes.get("label") or f"{kind} {element.attributes.get('id', number)}"
    if kind not in KINDS:
        hint = f"use {', '.join(KINDS)}"
        if kind.startswith("Rational"):
            hint = "give every weight 1 and save a THBSpline2, or insert knots until it is a TensorNurbs2"
        raise element.place.error(f'type="{kind}" is no surface omote reads', hint=hint)
    if element.all("transform"):
        raise element.place.error("has a <transform>, which is not read", hint="apply it to the coefficients")
    basis = element.first("Basis")
    if kind == "TensorBSpline2":
        surface, level = _tensor(element, _level(basis), None)
    elif kind == "TensorNurbs2":
        level = _level(basis.first("Basis"))
        nu, nv = level.shape
        surface, level = _tensor(element, level, _weights(basis.first("weights"), nu * nv))
    else:
        surface, level = _hierarchical(element, basis, kind)
    return NamedSurface(name, surface, _domain(surface, level))


def _weights(element: Element, count: int) -> Floats:
    try:
        return check_weights(element.numbers(count))
    except ValueError as error:
        raise element.place.error(str(error)) from error


def _domain(surface: DCPSurface, level: Level) -> Domain | None:
    """Where the basis sums to 1: of open knot vectors everywhere, of others less than where points reach."""
    ends = [(float(t[p]), float(t[-p - 1])) for t, p in zip(level.knots, level.degrees, strict=True)]
    rect = (*ends[0], *ends[1])
    return None if rect == surface.rect else Domain(rect)


def _level(element: Element) -> Level:
    """A tensor-product basis."""
    sides = element.all("Basis")
    if len(sides) != 2:
        raise element.place.error(f"has {len(sides)} directions, a surface has 2")
    for each in (element, *sides):
        _check_open(each)
    degrees, knots = zip(*(_knots(side.first("KnotVector")) for side in sides), strict=True)
    return Level((degrees[0], degrees[1]), (knots[0], knots[1]))


def _check_open(element: Element) -> None:
    """G+Smo itself writes periodic bases as plain knots; a mark that says otherwise is not to be overlooked."""
    if element.attributes.get("periodic", "-1").strip().lower() not in ("-1", "false"):
        raise element.place.error("is periodic, which is not read", hint="unclamp it into an open knot vector")


def _knots(element: Element) -> tuple[int, Floats]:
    _check_open(element)
    p = element.integer("degree", 0, MAX_DEGREE)
    if element.attributes.get("mode") == "uniform":
        count = element.integer("csize", p + 1, MOST_FUNCTIONS)
        return p, np.concatenate([[0.0] * p, np.linspace(0, 1, count - p + 1), [1.0] * p])
    knots = element.numbers()
    if len(knots) < 2 * p + 2:
        raise element.place.error(f"holds {len(knots)} knots, degree {p} needs {2 * p + 2} at least")
    if (np.abs(knots) > LARGEST).any():
        raise element.place.error(f"holds knots beyond {LARGEST:g}")
    if (np.diff(knots) < 0).any():
        k = int(np.argmax(np.diff(knots) < 0)) + 1
        raise element.place.error(f"knots decrease at knot {k} ({knots[k]} after {knots[k - 1]})")
    if not (knots[p + 1 :] > knots[: -p - 1]).all():
        k = int(np.argmin(knots[p + 1 :] > knots[: -p - 1]))
        raise element.place.error(f"knot {knots[k]} stands more than {p + 1} times")
    steps = np.diff(knots)
    if (steps[steps > 0] < CLOSE * np.ptp(knots)).any():
        k = int(np.argmax((steps > 0) & (steps < CLOSE * np.ptp(knots))))
        raise element.place.error(f"knots {k} and {k + 1} are too close to tell apart")
    return p, knots


def _coefficients(element: Element, count: int) -> Floats:
    """(count, 3) float64."""
    coefs = element.first("coefs")
    dimension = coefs.integer("geoDim", 1, 9)
    if dimension not in (2, 3):
        raise coefs.place.error(f"geoDim={dimension}: a surface is in the plane or in space (2 or 3)")
    row = coefs.numbers(count * dimension)
    by_coordinate = coefs.attributes.get("order") == "coordinates"
    table = row.reshape(dimension, count).T if by_coordinate else row.reshape(count, dimension)
    return np.hstack([table, np.zeros((count, 3 - dimension))])


def _tensor(element: Element, level: Level, weights: Floats | None) -> tuple[DCPSurface, Level]:
    nu, nv = level.shape
    net = _coefficients(element, nu * nv).reshape(nv, nu, 3).transpose(1, 0, 2)
    w = None if weights is None else weights.reshape(nv, nu).T
    arrays = nurbs_arrays(*level.degrees, *level.knots, net, w)
    return DCPSurface(*arrays), level


def _hierarchical(element: Element, basis: Element, kind: str) -> tuple[DCPSurface, Level]:
    boxes = basis.all("box")
    finest = max((box.integer("level", 0, MOST_LEVELS) for box in boxes), default=0)
    levels = _levels(basis, finest)
    hierarchy = Hierarchy(levels, _depth(basis, boxes, levels))
    coefficients = _coefficients(element, len(hierarchy.active))
    if kind == "HBSpline2":
        coefficients = hierarchy.plain(coefficients)
    return DCPSurface(*hierarchy.control_points(coefficients)), levels[0]


def _levels(basis: Element, finest: int) -> list[Level]:
    """All levels that boxes ask for, each nested in the next."""
    given = basis.all("Basis")
    levels = [_level(basis.first("Basis"))]
    if basis.attributes.get("manualLevels", "false").lower() == "true":
        levels += [_level(one) for one in given[1:]]
        if len(levels) <= finest:
            raise basis.place.error(f"gives {len(levels)} levels, a box asks for level {finest}")
        for number in range(1, len(levels)):
            _check_nested(given[number], levels[number - 1], levels[number])
    while len(levels) <= finest:
        levels.append(halved(levels[-1]))
        _check_size(basis, levels[-1])
    return levels[: finest + 1]


def _check_nested(element: Element, coarse: Level, fine: Level) -> None:
    if coarse.degrees != fine.degrees:
        raise element.place.error("has another degree than the level before, so it cannot be taken exactly")
    for axis, (a, b) in enumerate(zip(coarse.knots, fine.knots, strict=True)):
        values, counts = np.unique(a, return_counts=True)
        if any((b == x).sum() < n for x, n in zip(values, counts, strict=True)):
            raise element.place.error(f"direction {axis} lacks a knot of the level before: levels are not nested")


def _check_size(element: Element, level: Level) -> None:
    nu, nv = level.shape
    if nu * nv > MOST_CELLS:
        raise element.place.error(f"its finest level has {nu} x {nv} functions, more than {MOST_CELLS}")


def _depth(basis: Element, boxes: list[Element], levels: list[Level]) -> Ints:
    """(a, b): the level wanted in every cell of the finest level."""
    lines = [np.unique(t) for t in levels[-1].knots]
    depth = np.zeros([len(x) - 1 for x in lines], dtype=np.int64)
    for box in boxes:
        number = box.integer("level", 0, MOST_LEVELS)
        corners = [int(x) for x in box.numbers(4)]
        slices = []
        for axis in range(2):
            own = np.unique(levels[number].knots[axis])
            low, high = corners[axis], corners[axis + 2]
            if not 0 <= low < high < len(own):
                raise box.place.error(f"reaches from {low} to {high} in direction {axis}; 0 to {len(own) - 1} exist")
            slices.append(slice(*np.searchsorted(lines[axis], [own[low], own[high]])))
        part = depth[slices[0], slices[1]]
        np.maximum(part, number, out=part)
    return depth
