"""Read landmarks that a user picked on a mesh: TOML, JSON, or MeshLab's picked points (.pp).

A value is a place in the mesh's coordinates, a vertex, or a pixel of the picture that ``omote landmarks`` drew.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from surface.base import files
from surface.base.arrays import Floats
from surface.base.errors import FitError
from surface.fit.transfer.relief import mirrored
from surface.fit.transfer.reports.picture import Frontal
from surface.fit.transfer.scan import Scan
from surface.fit.transfer.template import NAMES

FAR = 0.05  # distance from the mesh, relative to its size, from which a landmark belongs to another mesh or unit
LARGEST = 1e12  # greatest absolute value of a number in a file
EXAMPLE = "nose_tip = [0.0, 1.2, 9.8], or nose_tip = 3512 for a vertex, counted from 0"

_Table = tuple[dict[str, Any], Frontal | None]


def read_landmarks(path: Path, scan: Scan) -> dict[str, Floats]:
    """Places (3,) on a scan, in its file's coordinates, by names of :data:`surface.fit.transfer.template.NAMES`.

    Raises FitError: the file is missing or damaged, a name is unknown or twice there, a value is neither three finite
    numbers nor a vertex, or a place is far from the mesh; names file and landmark.
    """
    readers = {".toml": _read_toml, ".json": _read_json, ".pp": _read_picked}
    kind = path.suffix.lower()
    if kind not in readers:
        raise FitError(f"--landmarks {path}: is none of {', '.join(readers)}", hint=EXAMPLE)
    table, view = readers[kind](path)
    if not table:
        raise FitError(f"{path}: holds no landmark", hint=EXAMPLE)
    found = {}
    for name, value in table.items():
        if name not in NAMES:
            raise FitError(f"{path}: {name}: is no landmark", hint=f"there are {', '.join(NAMES)}")
        found[name] = _place(value, scan, view, f"{path}: {name}")
    _check_near(found, scan, path)
    return found


def _read_toml(path: Path) -> _Table:
    with files.reading(path, FitError, hint=EXAMPLE):
        table = files.read_toml(path)
    return _inner(table, path)


def _read_json(path: Path) -> _Table:
    with files.reading(path, FitError, hint='{"nose_tip": [0.0, 1.2, 9.8]}'):
        table = files.read_json(path)
    return _inner(table, path)


def _inner(table: Any, path: Path) -> _Table:
    """The table of landmarks: the file itself, or its key ``landmarks``; and the view of its ``picture``."""
    inner = table.get("landmarks", table) if isinstance(table, dict) else None
    if not isinstance(inner, dict):
        raise FitError(f"{path}: is no table of landmarks by name", hint=EXAMPLE)
    picture = table.get("picture") if inner is not table else None
    return inner, None if picture is None else _view(picture, path)


def _view(table: Any, path: Path) -> Frontal:
    """The front view of a table ``turn`` (9 numbers), ``scale``, ``shift`` (3 numbers)."""
    try:
        turn, shift = np.array(table["turn"], float).reshape(3, 3), np.array(table["shift"], float).reshape(3)
        scale = float(table["scale"])
        sound = bool((np.abs(turn) < 2.0).all() and (np.abs(shift) < LARGEST).all() and 0.0 < scale < LARGEST)
        if not sound or np.abs(turn @ turn.T - np.eye(3)).max() > 1e-3:
            raise ValueError
    except (TypeError, KeyError, ValueError, OverflowError):
        hint = "leave [picture] as omote landmarks wrote it, or write it again"
        raise FitError(f"{path}: picture: is no view that omote landmarks writes", hint=hint) from None
    return Frontal(turn, scale, shift)


def _read_picked(path: Path) -> _Table:
    """Points that MeshLab's tool PickPoints saved, without those that are not active."""
    with files.reading(path, FitError, hint="save it again in MeshLab: Edit, PickPoints"):
        text = files.read_file(path, files.TEXT_LIMIT)
        if b"<!ENTITY" in text:
            raise ValueError("it defines entities")
        try:
            root = ElementTree.fromstring(text)
        except ElementTree.ParseError as e:
            raise ValueError(f"it is no XML: {e}") from e
    out: dict[str, Any] = {}
    for point in root.iter("point"):
        if point.get("active", "1") != "0":
            name = point.get("name", "")
            if name in out:
                raise FitError(f"{path}: {name}: is picked twice", hint="delete one of the two points")
            out[name] = [_number(point.get(axis)) for axis in "xyz"]
    return out, None


def _number(text: str | None) -> float:
    try:
        return float(text or "nan")
    except ValueError:
        return math.nan


def _place(value: Any, scan: Scan, view: Frontal | None, where: str) -> Floats:
    """The place (3,) that the value of one landmark describes. Raises FitError, which begins with ``where``."""
    if isinstance(value, Mapping) and "pixel" in value:
        return _at_pixel(value["pixel"], scan, view, where)
    if isinstance(value, Mapping):
        value = value.get("point", value.get("vertex"))
    if isinstance(value, int) and not isinstance(value, bool):
        if not 0 <= value < len(scan.original):
            raise FitError(f"{where}: there is no vertex {value}", hint=f"the mesh has 0 to {len(scan.original) - 1}")
        vertex: Floats = scan.vertices[scan.original[value]]
        return vertex
    if not _are_numbers(value, 3):
        raise FitError(f"{where}: {value!r} is neither a place nor a vertex", hint=EXAMPLE)
    return np.array(value, float)


def _are_numbers(value: Any, count: int) -> bool:
    """Whether a value is a list of ``count`` usable numbers."""
    numbers = isinstance(value, list) and len(value) == count
    return numbers and all(isinstance(x, int | float) and not isinstance(x, bool) and abs(x) <= LARGEST for x in value)


def _at_pixel(value: Any, scan: Scan, view: Frontal | None, where: str) -> Floats:
    """The place of a scan at a pixel of its front view."""
    if not _are_numbers(value, 2):
        raise FitError(f"{where}: {value!r} is no pixel", hint="{ pixel = [412, 388] }: right and down, from 0")
    if view is None:
        hint = "pixels belong to the picture of omote landmarks MESH -o FILE.toml, which writes [picture]"
        raise FitError(f"{where}: a pixel, but the file has no table [picture]", hint=hint)
    place = view.place(scan, float(value[0]), float(value[1]))
    if place is None:
        raise FitError(f"{where}: the scan shows nothing at pixel {value}", hint="take one on the left half's face")
    return place


def _check_near(found: dict[str, Floats], scan: Scan, path: Path) -> None:
    used = scan.vertices[np.unique(scan.triangles)]
    size = float(np.ptp(used, axis=0).max())
    for name, place in found.items():
        outside = np.maximum(np.maximum(used.min(axis=0) - place, place - used.max(axis=0)), 0.0)
        if float(np.linalg.norm(outside)) > FAR * size:
            raise FitError(f"{path}: {name}: lies outside the mesh, which reaches from {_shown(used.min(axis=0))} to "
                           f"{_shown(used.max(axis=0))}",
                           hint="pick it on this very file, in its own unit and axes")  # fmt: skip


def _shown(place: Floats) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in place) + ")"


def swapped(found: Mapping[str, Floats]) -> dict[str, Floats]:
    """The landmarks with left and right exchanged."""
    return {mirrored(n): p for n, p in found.items()}
