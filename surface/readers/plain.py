"""Reader and writer of omote's own surface format: plain JSON, without loss.

::

    {"format": "omote surface", "version": 1, "surfaces": [
      {"name": "cheek",
       "points": [
         {"position": [x, y, z], "weight": 1.0, "degree": [3, 3], "knots_u": [0, 0, 0, 1, 2], "knots_v": [...]},
         ...],
       "closed_u": [start, end],                       (only where joined; also "closed_v")
       "domain": {"rect": [u0, u1, v0, v1],            (optional: everywhere)
                  "loops": [[[u, v], ...], ...],       (optional: none)
                  "slits": [{"axis": "u", "at": v, "start": u0, "end": u1}, ...]}}]}

Each point has its own degree and degree + 2 knots in each direction; "weight" is optional (1), and so is
"degree", which follows from the knots. Numbers are written so that they read back the same to the last bit.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from surface.base.files import parse_json, read_json
from surface.base.writing import replacing
from surface.dcp import DCPSurface
from surface.mesh.domain import Domain, Slit

from .common import Location, NamedSurface, read_text

FORMAT, VERSION = "omote surface", 1
MAX_NUMBER = sys.float_info.max


def is_plain(path: Path) -> bool:
    """Whether a file declares this format (speech takes are JSON files, too)."""
    try:
        table = read_json(path)
    except (OSError, ValueError):
        return False
    return isinstance(table, dict) and ("format" in table or "surfaces" in table)


def read(path: Path) -> list[NamedSurface]:
    """Return the surfaces of a file; ``SurfaceFileError`` names line or element."""
    file = Location(path)
    table = _parse(file, read_text(path))
    if not isinstance(table, dict) or table.get("format") != FORMAT:
        raise file.error(f'"format" must be "{FORMAT}"')
    if table.get("version") != VERSION:
        why = f"must be {VERSION}, not {table.get('version')!r}"
        raise file.at("version").error(why, hint="update omote, or write the file again with this one")
    return [_surface(file.at(f"surfaces[{i}]"), row) for i, row in enumerate(_list(file, table, "surfaces"))]


def _parse(file: Location, text: str) -> Any:
    def refuse(word: str) -> NoReturn:
        line = text[: text.index(word)].count("\n") + 1
        raise file.at(f"line {line}").error(f"{word} is not a number a surface can have")

    try:
        return parse_json(text, parse_constant=refuse)
    except ValueError as error:
        raise file.error(str(error)) from error


def _surface(here: Location, row: Any) -> NamedSurface:
    """Return one entry of "surfaces"."""
    if not isinstance(row, dict):
        raise here.error(f"must be a table, not {row!r:.40}")
    points = [_point(here.child(f".points[{i}]"), point) for i, point in enumerate(_list(here, row, "points"))]
    columns = zip(*points, strict=True) if points else ([], [], [], [])
    closed = {key: row[key] for key in ("closed_u", "closed_v") if row.get(key) is not None}
    closed = {key: tuple(_numbers(here.child(f".{key}"), ends, 2)) for key, ends in closed.items()}
    try:
        surface = DCPSurface(*map(list, columns), **closed)
    except ValueError as error:
        raise here.error(str(error)) from error
    return NamedSurface(str(row.get("name", here.where)), surface, _domain(here.child(".domain"), row.get("domain")))


def _point(here: Location, point: Any) -> tuple[list[float], float, list[float], list[float]]:
    """Return the position, weight and both knot vectors of one control point."""
    if not isinstance(point, dict):
        raise here.error(f"must be a table, not {point!r:.40}")
    missing = [key for key in ("position", "knots_u", "knots_v") if key not in point]
    if missing:
        raise here.error(f'has no "{missing[0]}"')
    position = _numbers(here.child(".position"), point["position"], 3)
    (weight,) = _numbers(here.child(".weight"), [point.get("weight", 1.0)], 1)
    u, v = (_numbers(here.child(f".{key}"), point[key]) for key in ("knots_u", "knots_v"))
    degrees = [len(u) - 2, len(v) - 2]
    if point.get("degree", degrees) != degrees:
        raise here.child(".degree").error(f"{point['degree']} does not fit the knots, which make it {degrees}")
    return position, weight, u, v


def _domain(here: Location, row: Any) -> Domain | None:
    if row is None:
        return None
    if not isinstance(row, dict) or "rect" not in row:
        raise here.error('must be a table with "rect"')
    u0, u1, v0, v1 = _numbers(here.child(".rect"), row["rect"], 4)
    loops = []
    for i, loop in enumerate(_items(here.child(".loops"), row.get("loops", []))):
        at = here.child(f".loops[{i}]")
        loops.append([_numbers(at.child(f"[{k}]"), uv, 2) for k, uv in enumerate(_items(at, loop))])
    slits = enumerate(_items(here.child(".slits"), row.get("slits", [])))
    try:
        return Domain((u0, u1, v0, v1), loops, [_slit(here.child(f".slits[{i}]"), slit) for i, slit in slits])
    except ValueError as error:
        raise here.error(str(error)) from error


def _slit(here: Location, row: Any) -> Slit:
    if not isinstance(row, dict) or set(row) != {"axis", "at", "start", "end"}:
        raise here.error("must be a table of axis, at, start and end")
    return Slit(str(row["axis"]), *_numbers(here, [row[key] for key in ("at", "start", "end")], 3))


def _list(here: Location, table: dict[str, Any], key: str) -> list[Any]:
    at = here.child(f".{key}") if here.where else here.at(key)
    if key not in table:
        raise at.error("is missing")
    return _items(at, table[key])


def _items(here: Location, value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise here.error(f"must be a list, not {value!r:.40}")
    return value


def _numbers(here: Location, value: Any, count: int | None = None) -> list[float]:
    """Return a list of finite numbers, ``count`` of them if given."""
    row = _items(here, value)
    good = all(isinstance(x, (int, float)) and not isinstance(x, bool) and abs(x) <= MAX_NUMBER for x in row)
    if not good or (count is not None and len(row) != count):
        raise here.error(f"must be {count or 'degree + 2'} finite numbers, not {value!r:.60}")
    return [float(x) for x in row]


def write_surfaces(path: str | os.PathLike[str], surfaces: Sequence[NamedSurface]) -> None:
    """Write surfaces, whole or not at all; reading them back gives the same numbers.

    Raises SurfaceFileError: if the file cannot be written; one that was there stays as it was.
    """
    table = {"format": FORMAT, "version": VERSION, "surfaces": [_row(item) for item in surfaces]}
    text = json.dumps(table, allow_nan=False).replace('{"position"', '\n{"position"')
    try:
        with replacing(Path(path)) as temporary:
            temporary.write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise Location(Path(path)).error(f"cannot be written: {error.strerror}", hint="choose another place") from error


def _row(item: NamedSurface) -> dict[str, Any]:
    s = item.surface
    keys = ("position", "weight", "degree", "knots_u", "knots_v")
    degrees = np.column_stack(s.degrees).tolist()
    columns = zip(s.points.tolist(), s.weights.tolist(), degrees, s.knots_u, s.knots_v, strict=True)
    points = [dict(zip(keys, (*own, ku.tolist(), kv.tolist()), strict=True)) for *own, ku, kv in columns]
    row: dict[str, Any] = {"name": item.name, "points": points}
    row |= {f"closed_{axis}": list(ends) for axis, ends in zip("uv", s.closed, strict=True) if ends is not None}
    if item.domain is not None:
        slits = [
            {"axis": x.axis, "at": float(x.at), "start": float(x.start), "end": float(x.end)} for x in item.domain.slits
        ]
        loops = [np.asarray(loop).tolist() for loop in item.domain.loops]
        row["domain"] = {"rect": [float(x) for x in item.domain.rect], "loops": loops, "slits": slits}
    return row
