"""omote's own surface format: plain JSON, read and written without loss.

::

    {"format": "omote surface", "version": 1, "surfaces": [
      {"name": "cheek",
       "points": [
         {"position": [x, y, z], "weight": 1.0, "degree": [3, 3], "knots_u": [0, 0, 0, 1, 2], "knots_v": [...]},
         ...],
       "closed_u": [start, end],                       (left out where not joined; also "closed_v")
       "domain": {"rect": [u0, u1, v0, v1],            (left out: everywhere)
                  "loops": [[[u, v], ...], ...],       (left out: none)
                  "slits": [{"axis": "u", "at": v, "start": u0, "end": u1}, ...]}}]}

Each point has its own degree and degree + 2 knots in each direction; "weight" may be left out (1), and so may
"degree", which the knots already tell. Numbers are written so that they read back the same to the last bit.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from surface.dcp import DCPSurface
from surface.mesh.domain import Domain, Slit

from .named import NamedSurface, Place, read_text

FORMAT, VERSION = "omote surface", 1
LARGEST = sys.float_info.max


def is_plain(path: Path) -> bool:
    """Does the file say that it is of this format? (Speech takes are JSON files, too.)"""
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return isinstance(table, dict) and ("format" in table or "surfaces" in table)


def read(path: Path) -> list[NamedSurface]:
    """The surfaces of a file; ``SurfaceFileError`` names line or element."""
    place = Place(path)
    table = _load(place, read_text(path))
    if not isinstance(table, dict) or table.get("format") != FORMAT:
        raise place.error(f'"format" must be "{FORMAT}"')
    if table.get("version") != VERSION:
        why = f"must be {VERSION}, not {table.get('version')!r}"
        raise place.at("version").error(why, hint="update omote, or write the file again with this one")
    return [_surface(place, f"surfaces[{i}]", row) for i, row in enumerate(_list(place, table, "", "surfaces"))]


def _load(place: Place, text: str) -> Any:
    def refuse(word: str) -> NoReturn:
        line = text[: text.index(word)].count("\n") + 1
        raise place.at(f"line {line}").error(f"{word} is not a number a surface can have")

    try:
        return json.loads(text, parse_constant=refuse)
    except json.JSONDecodeError as error:
        raise place.at(f"line {error.lineno} column {error.colno}").error(f"is not JSON: {error.msg}") from error
    except RecursionError as error:
        raise place.error("is not JSON a surface can have: nested too deep") from error


def _surface(place: Place, where: str, row: Any) -> NamedSurface:
    """One entry of "surfaces"."""
    if not isinstance(row, dict):
        raise place.at(where).error(f"must be a table, not {row!r:.40}")
    points = _list(place, row, where, "points")
    columns: dict[str, list[Any]] = {"position": [], "weight": [], "knots_u": [], "knots_v": []}
    for i, point in enumerate(points):
        for key, value in _point(place, f"{where}.points[{i}]", point).items():
            columns[key].append(value)
    closed = {key: tuple(_numbers(place, row[key], f"{where}.{key}", 2)) for key in _closed_keys(row)}
    try:
        surface = DCPSurface(*columns.values(), **closed)  # type: ignore[arg-type]
    except ValueError as error:
        raise place.at(where).error(str(error)) from error
    return NamedSurface(str(row.get("name", where)), surface, _domain(place, f"{where}.domain", row.get("domain")))


def _closed_keys(row: dict[str, Any]) -> list[str]:
    return [key for key in ("closed_u", "closed_v") if row.get(key) is not None]


def _point(place: Place, where: str, point: Any) -> dict[str, Any]:
    """Position, weight and knots of one control point."""
    if not isinstance(point, dict):
        raise place.at(where).error(f"must be a table, not {point!r:.40}")
    missing = [key for key in ("position", "knots_u", "knots_v") if key not in point]
    if missing:
        raise place.at(where).error(f'has no "{missing[0]}"')
    out: dict[str, Any] = {"position": _numbers(place, point["position"], f"{where}.position", 3)}
    out["weight"] = _numbers(place, [point.get("weight", 1.0)], f"{where}.weight", 1)[0]
    for key in ("knots_u", "knots_v"):
        out[key] = _numbers(place, point[key], f"{where}.{key}")
    found = [len(out["knots_u"]) - 2, len(out["knots_v"]) - 2]
    if point.get("degree", found) != found:
        raise place.at(f"{where}.degree").error(f"{point['degree']} does not fit the knots, which tell {found}")
    return out


def _domain(place: Place, where: str, row: Any) -> Domain | None:
    if row is None:
        return None
    if not isinstance(row, dict) or "rect" not in row:
        raise place.at(where).error('must be a table with "rect"')
    u0, u1, v0, v1 = _numbers(place, row["rect"], f"{where}.rect", 4)
    loops = [
        [
            _numbers(place, uv, f"{where}.loops[{i}][{k}]", 2)
            for k, uv in enumerate(_items(place, loop, f"{where}.loops[{i}]"))
        ]
        for i, loop in enumerate(_items(place, row.get("loops", []), f"{where}.loops"))
    ]
    slits = _items(place, row.get("slits", []), f"{where}.slits")
    try:
        return Domain((u0, u1, v0, v1), loops, [_slit(place, f"{where}.slits[{i}]", x) for i, x in enumerate(slits)])
    except ValueError as error:
        raise place.at(where).error(str(error)) from error


def _slit(place: Place, where: str, row: Any) -> Slit:
    if not isinstance(row, dict) or set(row) != {"axis", "at", "start", "end"}:
        raise place.at(where).error("must be a table of axis, at, start and end")
    at, start, end = _numbers(place, [row[key] for key in ("at", "start", "end")], where, 3)
    return Slit(str(row["axis"]), at, start, end)


def _list(place: Place, table: dict[str, Any], where: str, key: str) -> list[Any]:
    path = f"{where}.{key}" if where else key
    if key not in table:
        raise place.at(path).error("is missing")
    return _items(place, table[key], path)


def _items(place: Place, value: Any, where: str) -> list[Any]:
    if not isinstance(value, list):
        raise place.at(where).error(f"must be a list, not {value!r:.40}")
    return value


def _numbers(place: Place, value: Any, where: str, count: int | None = None) -> list[float]:
    """A list of finite numbers, ``count`` of them if given."""
    row = _items(place, value, where)
    good = all(isinstance(x, (int, float)) and not isinstance(x, bool) and abs(x) <= LARGEST for x in row)
    if not good or (count is not None and len(row) != count):
        raise place.at(where).error(f"must be {count or 'degree + 2'} finite numbers, not {value!r:.60}")
    return [float(x) for x in row]


def write_surfaces(path: str | os.PathLike[str], surfaces: Sequence[NamedSurface]) -> None:
    """Write surfaces; reading them back gives the same numbers.

    Raises
    ------
    SurfaceFileError
        if the file cannot be written.
    """
    table = {"format": FORMAT, "version": VERSION, "surfaces": [_row(item) for item in surfaces]}
    text = json.dumps(table, allow_nan=False).replace('{"position"', '\n{"position"')
    try:
        Path(path).write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise Place(Path(path)).error(f"cannot be written: {error.strerror}", hint="choose another place") from error


def _row(item: NamedSurface) -> dict[str, Any]:
    s = item.surface
    columns = zip(s.points, s.weights, *s.degrees, s.knots_u, s.knots_v, strict=True)
    points = [
        {
            "position": xyz.tolist(),
            "weight": float(w),
            "degree": [int(pu), int(pv)],
            "knots_u": ku.tolist(),
            "knots_v": kv.tolist(),
        }
        for xyz, w, pu, pv, ku, kv in columns
    ]
    row: dict[str, Any] = {"name": item.name, "points": points}
    row.update({f"closed_{axis}": list(ends) for axis, ends in zip("uv", s.closed, strict=True) if ends is not None})
    if item.domain is not None:
        row["domain"] = _domain_row(item.domain)
    return row


def _domain_row(domain: Domain) -> dict[str, Any]:
    loops = [np.asarray(loop).tolist() for loop in domain.loops]
    slits = [{"axis": x.axis, "at": float(x.at), "start": float(x.start), "end": float(x.end)} for x in domain.slits]
    return {"rect": [float(x) for x in domain.rect], "loops": loops, "slits": slits}
