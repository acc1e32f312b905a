"""Surfaces as JSON files: plain, documented, exact.

::

    {
      "format": "omote-surface", "version": 1,
      "points":  [[x, y, z], ...],
      "weights": [w, ...],                  optional, 1 if left out
      "knots_u": [[t, ...], ...],           degree + 2 numbers per point
      "knots_v": [[t, ...], ...],
      "closed_u": [start, end],             optional, for directions joined at their ends
      "closed_v": [start, end]
    }

or, for a NURBS surface, ``"degree_u"``, ``"degree_v"``, ``"knots_u"``, ``"knots_v"`` (one list each),
``"control_points"`` (nu x nv x 3) and optionally ``"weights"`` (nu x nv).
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from .dcp import DCPSurface
from .errors import SurfaceFileError

FORMAT, VERSION = "omote-surface", 1
SCATTERED = {"points", "weights", "knots_u", "knots_v", "closed_u", "closed_v"}
NURBS = {"degree_u", "degree_v", "knots_u", "knots_v", "control_points", "weights"}


def read_json(path: str | Path) -> DCPSurface:
    """The surface in a file.

    Raises
    ------
    SurfaceFileError
        Naming the file, and the line or the key and element that is wrong.
    """
    where = Path(path)
    data = _content(where)
    kind = NURBS if "control_points" in data else SCATTERED
    unknown = sorted(set(data) - kind - {"format", "version"})
    missing = sorted(kind - {"weights", "closed_u", "closed_v"} - set(data))
    if unknown or missing:
        parts = [f"{name} {', '.join(keys)}" for name, keys in (("unknown", unknown), ("missing", missing)) if keys]
        raise SurfaceFileError(f"{where}: {'; '.join(parts)}", hint=f"keys are {', '.join(sorted(kind))}")
    try:
        if kind is NURBS:
            return DCPSurface.from_nurbs(
                *(data[k] for k in ("degree_u", "degree_v", "knots_u", "knots_v")), **_net(data)
            )
        weights = data.get("weights", [1.0] * len(data["points"]))
        ends = {name: data[name] for name in ("closed_u", "closed_v") if data.get(name) is not None}
        return DCPSurface(data["points"], weights, data["knots_u"], data["knots_v"], **ends)
    except (ValueError, TypeError) as error:
        raise SurfaceFileError(f"{where}: {error}", hint="see docs/surface.md for the format") from error


def _net(data: dict[str, Any]) -> dict[str, Any]:
    return {"control_points": data["control_points"], "weights": data.get("weights")}


def _content(where: Path) -> dict[str, Any]:
    try:
        data = json.loads(where.read_text(encoding="utf-8"))
    except OSError as error:
        raise SurfaceFileError(f"{where}: cannot be read ({error.strerror})", hint="check the path") from error
    except UnicodeDecodeError as error:
        raise SurfaceFileError(f"{where}: not a text file", hint="a surface file is JSON in UTF-8") from error
    except json.JSONDecodeError as error:
        text = f"{where}: line {error.lineno}, column {error.colno}: {error.msg}"
        raise SurfaceFileError(text, hint="the file is not valid JSON") from error
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise SurfaceFileError(f'{where}: no "format": "{FORMAT}"', hint="is this a surface file?")
    if data.get("version") != VERSION:
        raise SurfaceFileError(
            f"{where}: version {data.get('version')!r}, this program reads {VERSION}", hint="update omote"
        )
    return data


def write_json(surface: DCPSurface, path: str | Path) -> None:
    """Write a surface; :func:`read_json` gives the same numbers back, bit for bit."""
    data: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "points": surface.points.tolist(),
        "weights": surface.weights.tolist(),
        "knots_u": [row.tolist() for row in surface.knots_u],
        "knots_v": [row.tolist() for row in surface.knots_v],
    }
    for name, interval in zip(("closed_u", "closed_v"), surface.closed, strict=True):
        if interval is not None:
            data[name] = list(interval)
    Path(path).write_text(json.dumps(data) + "\n", encoding="utf-8")
