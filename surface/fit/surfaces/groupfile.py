"""Groups made by hand: files that say which control points of a surface move for which parameter, and how far.

A ``.toml`` file holds a list ``[[groups]]``; places and lengths are in the coordinates of the surface file:

==========  ====================================================================================================
name        the parameter, one of ARKit's 52 shapes
at, radius  a place, and how far from it control points still move: all of it at the place, nothing at the radius
ids         control points by number instead, counted from 0 (with ``part``)
move        displacement at 1.0; with ``ids`` also one for each
hinge, axis, angle_deg  instead of ``move``: a rotation about an axis through a place
part        only this surface, by its name in the file
inside      (u0, u1, v0, v1): only control points the middle of whose subdomain lies there
mirror      the parameter for which the mirror image of the group, left for right, is
file        a group file made by dragging points in the window, instead of all these; ``amount`` scales it
==========  ====================================================================================================

A ``.json`` file is one made by dragging; its name must be the parameter's. Groups of one name add up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np

from surface.base import files
from surface.base.arrays import Floats
from surface.base.errors import FitError
from surface.fit.source.mesh import LARGE
from surface.fit.surfaces.build import sparse_group, with_groups
from surface.head.model.data import Group, PartData
from surface.head.model.parameters import SHAPES, smoothstep
from surface.head.model.placement import Placement
from surface.readers import Ties

HINT = 'a group has a name, a place and a move: name = "jawOpen", at = [0, -60, 90], radius = 40, move = [0, -12, -3]'
KEYS = {
    "name", "at", "radius", "ids", "move", "hinge", "axis", "angle_deg", "part", "inside", "mirror", "file", "amount",
}  # fmt: skip
FLIP = np.array([-1.0, 1.0, 1.0])  # head space: x is to the subject's left


@dataclass(frozen=True)
class _Entry:
    """One table of a file; every error names the file, its place in it and the key."""

    path: Path
    where: str
    table: dict[str, Any]

    def error(self, key: str, why: str, hint: str = HINT) -> FitError:
        return FitError(f"{self.path}: {self.where}{key}: {why}", hint=hint)

    def numbers(self, key: str, shape: tuple[int, ...]) -> Floats:
        """An array of finite numbers of a shape, of which -1 may be any length."""
        if key not in self.table:
            raise self.error(key, "is missing")
        try:
            row = np.asarray(self.table[key], np.float64)
        except (TypeError, ValueError) as error:
            raise self.error(key, "holds what is not a number") from error
        fits = row.ndim == len(shape) and all(w in (-1, g) for g, w in zip(row.shape, shape, strict=True))
        if not fits or not (np.abs(row) < LARGE).all():
            words = " x ".join("any" if w < 0 else str(w) for w in shape) or "one"
            raise self.error(key, f"must be {words} finite numbers of usable size, not {self.table[key]!r:.60}")
        return row

    def parameter(self, key: str) -> str:
        """The name of a shape."""
        name = self.table.get(key)
        if name not in SHAPES:
            near = get_close_matches(str(name), SHAPES, 3)
            hint = f"did you mean {', '.join(near)}?" if near else "names are ARKit's, as omote render --sheet shows"
            raise self.error(key, f"{name!r} is no parameter that groups move", hint)
        return str(name)


@dataclass(frozen=True)
class Context:
    """What the groups of a surface file are about.

    placement : from the file's coordinates. titles : names in the file, by part. ties : of the parts whose control
    points follow fewer of the file.
    """

    placement: Placement
    titles: dict[str, str]
    ties: dict[str, Ties]

    def points(self, part: PartData) -> Floats:
        """(m, 3) mm the points of a part that groups move."""
        tied = self.ties.get(part.name)
        return part.points if tied is None else self.placement.points(tied.points)

    def spread(self, part: PartData, moves: Floats) -> Floats:
        """(n, 3) displacements of the control points of a part for those (m, 3) of its points."""
        tied = self.ties.get(part.name)
        return moves if tied is None else tied.apply(moves)


def add_group_files(parts: list[PartData], paths: Sequence[Path], context: Context) -> list[PartData]:
    """The parts with the groups of some files.

    Raises FitError: a file cannot be read, has a wrong key, or a group of it moves nothing.
    """
    for path in paths:
        for entry in _entries(path):
            parts = _added(parts, entry, context)
    return parts


def _entries(path: Path) -> list[_Entry]:
    """The groups of a file."""
    kind = path.suffix.lower()
    if kind not in (".toml", ".json"):
        raise FitError(f"{path}: is no group file: its name ends in {kind or 'nothing'}", hint="use .toml or .json")
    with files.reading(path, FitError, hint=HINT):
        table = files.read_toml(path) if kind == ".toml" else files.read_json(path)
    if not isinstance(table, dict):
        raise FitError(f"{path}: must hold a table", hint=HINT)
    if kind == ".json":
        return [_Entry(path, "", {"file": path.name, "name": table.get("name")})]
    rows = table.get("groups")
    if not isinstance(rows, list) or not rows or not all(isinstance(row, dict) for row in rows):
        raise FitError(f"{path}: groups: must be a list of tables", hint=HINT)
    entries = [_Entry(path, f"groups[{k}].", row) for k, row in enumerate(rows)]
    for entry in entries:
        for key in set(entry.table) - KEYS:
            near = get_close_matches(key, KEYS, 1)
            raise entry.error(key, "is no key of a group", f"did you mean {near[0]}?" if near else HINT)
    return entries


def _added(parts: list[PartData], entry: _Entry, context: Context) -> list[PartData]:
    """The parts with one entry's group, and its mirror image if it has one."""
    name = entry.parameter("name")
    other = entry.parameter("mirror") if "mirror" in entry.table else None
    moved = [_moves(part, entry, context, np.ones(3)) for part in _meant(parts, entry, context.titles)]
    groups = [(part, sparse_group(name, moves)) for part, moves in moved]
    if other is not None:
        if "ids" in entry.table or "file" in entry.table:
            raise entry.error("mirror", "only places can be mirrored: use at and radius")
        moved = [_moves(part, entry, context, FLIP) for part in _meant(parts, entry, context.titles)]
        groups += [(part, sparse_group(other, moves)) for part, moves in moved]
    for wanted in {name, other} - {None}:
        if not any(len(g.ids) for _, g in groups if g.name == wanted):
            raise entry.error("at" if "at" in entry.table else "name", f"moves no control point for {wanted}",
                              "enlarge radius, or look where the surface is: omote check FILE")  # fmt: skip
    by_part: dict[str, list[Group]] = {}
    for part, group in groups:
        by_part.setdefault(part.name, []).append(group)
    return [with_groups(part, by_part[part.name]) if part.name in by_part else part for part in parts]


def _meant(parts: list[PartData], entry: _Entry, titles: dict[str, str]) -> list[PartData]:
    """The parts that an entry is about: one by its name in the head or in the file, or all of the skin."""
    if "file" in entry.table:
        entry = replace(entry, table={**entry.table, **_dragged(entry)})
    if "part" not in entry.table:
        return [part for part in parts if part.follows == "skin"]
    word = entry.table["part"]
    found = [part for part in parts if word in (part.name, titles.get(part.name))]
    if not found:
        names = ", ".join(sorted({titles.get(part.name, part.name) for part in parts}))
        raise entry.error("part", f"{word!r} is no surface of the head", f"use one of {names}")
    return found


def _dragged(entry: _Entry) -> dict[str, Any]:
    """A file made by dragging, as keys of an entry."""
    path = entry.path.parent / str(entry.table["file"])
    with files.reading(path, FitError, hint="make it again, or take it from a copy"):
        table = files.read_json(path)
    if not isinstance(table, dict) or not {"part", "ids", "moves_mm"} <= set(table):
        raise entry.error("file", f"{path} is no group file", "drag points in the window and save them")
    return {"part": table["part"], "ids": table["ids"], "moves_mm": table["moves_mm"]}


def _moves(part: PartData, entry: _Entry, context: Context, mirror: Floats) -> tuple[PartData, Floats]:
    """(n, 3) mm displacements of a part's control points at 1.0; ``mirror`` is :data:`FLIP` for the mirror image."""
    placement, at = context.placement, context.points(part)
    if "file" in entry.table:
        table = _dragged(entry)
        own = replace(entry, table={**entry.table, **table})
        amount = float(own.numbers("amount", ())) if "amount" in own.table else 1.0
        return part, _by_number(part, own, amount * own.numbers("moves_mm", (-1, 3)), len(part.points))
    if "ids" in entry.table:
        rows = entry.table.get("move")
        each = isinstance(rows, list) and bool(rows) and isinstance(rows[0], list)
        move = np.atleast_2d(entry.numbers("move", (-1, 3) if each else (3,)))
        return part, context.spread(part, _by_number(part, entry, placement.moves(move), len(at)))
    place, radius = placement.points(entry.numbers("at", (3,))), placement.scale * float(entry.numbers("radius", ()))
    if radius <= 0:
        raise entry.error("radius", f"{entry.table['radius']} is not greater than 0")
    near = np.linalg.norm(at * mirror - place, axis=1) / radius
    share = (1.0 - smoothstep(near, 0.0, 1.0)) * _within(part, entry, tied=part.name in context.ties)
    moves = share[:, None] * _displacement(at * mirror, entry, placement) * mirror
    return part, context.spread(part, moves)


def _by_number(part: PartData, entry: _Entry, moves: Floats, count: int) -> Floats:
    """(count, 3) displacements ``moves`` (k, 3), or one for all, of control points by number."""
    ids = entry.numbers("ids", (-1,))
    whole = ids.astype(np.int64)
    if len(ids) and (not np.array_equal(whole, ids) or whole.min() < 0 or whole.max() >= count):
        raise entry.error("ids", f"must be whole numbers from 0 to {count - 1}: {part.name!r} has no others")
    if len(moves) not in (1, len(ids)):
        raise entry.error("move", f"{len(moves)} displacements for {len(ids)} control points")
    out = np.zeros((count, 3))
    np.add.at(out, whole, np.broadcast_to(moves, (len(ids), 3)))
    return out


def _within(part: PartData, entry: _Entry, *, tied: bool) -> Floats | float:
    """(n,) 1 for control points whose subdomain has its middle where the entry says, else 0."""
    if "inside" not in entry.table:
        return 1.0
    if tied:
        raise entry.error("inside", f"{part.name!r} lies in several charts, not in one (u, v)", "use at and radius")
    u0, u1, v0, v1 = entry.numbers("inside", (4,))
    middles = []
    for knots, degrees in zip((part.knots_u, part.knots_v), part.degrees.T, strict=True):
        last = knots[np.arange(len(knots)), degrees + 1]
        middles.append(0.5 * (knots[:, 0] + last))
    u, v = middles
    inside: Floats = ((u >= u0) & (u <= u1) & (v >= v0) & (v <= v1)).astype(float)
    return inside


def _displacement(points: Floats, entry: _Entry, placement: Placement) -> Floats:
    """(n, 3) mm how far each of points (n, 3) in head space moves where all of the group acts."""
    if "hinge" not in entry.table:
        return np.broadcast_to(placement.moves(entry.numbers("move", (3,))), points.shape)
    axis = placement.turn @ entry.numbers("axis", (3,))
    length = float(np.linalg.norm(axis))
    if length == 0:
        raise entry.error("axis", "has no length")
    angle = np.radians(float(entry.numbers("angle_deg", ())))
    local = points - placement.points(entry.numbers("hinge", (3,)))
    along = axis / length
    turned = (  # Rodrigues' formula
        local * np.cos(angle) + np.cross(along, local) * np.sin(angle)
        + (local @ along)[:, None] * along * (1.0 - np.cos(angle))
    )  # fmt: skip
    out: Floats = turned - local
    return out
