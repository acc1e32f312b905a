"""Read landmarks that somebody picked on a mesh: TOML, JSON, or MeshLab's picked points (.pp)."""

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
from surface.fit.transfer.scan import Scan
from surface.fit.transfer.template import NAMES

FAR = 0.05  # of a mesh's size: a landmark further from it was picked on another mesh, or in another unit
EXAMPLE = "nose_tip = [0.0, 1.2, 9.8], or nose_tip = 3512 for a vertex, counted from 0"


def read_landmarks(path: Path, scan: Scan) -> dict[str, Floats]:
    """Places (3,) on a scan, in its file's coordinates, by names of :data:`surface.fit.transfer.template.NAMES`.

    Raises FitError: the file is missing or damaged, a name is unknown or twice there, a value is neither three finite
    numbers nor a vertex, or a place is far from the mesh; names file and landmark.
    """
    readers = {".toml": _read_toml, ".json": _read_json, ".pp": _read_picked}
    kind = path.suffix.lower()
    if kind not in readers:
        raise FitError(f"--landmarks {path}: is none of {', '.join(readers)}", hint=EXAMPLE)
    table = readers[kind](path)
    if not table:
        raise FitError(f"{path}: holds no landmark", hint=EXAMPLE)
    found = {}
    for name, value in table.items():
        if name not in NAMES:
            raise FitError(f"{path}: {name}: is no landmark", hint=f"there are {', '.join(NAMES)}")
        found[name] = _place(value, scan, f"{path}: {name}")
    _check_near(found, scan, path)
    return found


def _read_toml(path: Path) -> dict[str, Any]:
    with files.reading(path, FitError, hint=EXAMPLE):
        table = files.read_toml(path)
    return _inner(table, path)


def _read_json(path: Path) -> dict[str, Any]:
    with files.reading(path, FitError, hint='{"nose_tip": [0.0, 1.2, 9.8]}'):
        table = files.read_json(path)
    return _inner(table, path)


def _inner(table: Any, path: Path) -> dict[str, Any]:
    """The table of landmarks: the file itself, or its key ``landmarks``."""
    inner = table.get("landmarks", table) if isinstance(table, dict) else None
    if not isinstance(inner, dict):
        raise FitError(f"{path}: is no table of landmarks by name", hint=EXAMPLE)
    return inner


def _read_picked(path: Path) -> dict[str, Any]:
    """Points that MeshLab's tool PickPoints saved; those that are not active are left out."""
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
    return out


def _number(text: str | None) -> float:
    try:
        return float(text or "nan")
    except ValueError:
        return math.nan


def _place(value: Any, scan: Scan, where: str) -> Floats:
    """Where one landmark is."""
    if isinstance(value, Mapping):
        value = value.get("point", value.get("vertex"))
    if isinstance(value, int) and not isinstance(value, bool):
        if not 0 <= value < len(scan.original):
            raise FitError(f"{where}: there is no vertex {value}", hint=f"the mesh has 0 to {len(scan.original) - 1}")
        vertex: Floats = scan.vertices[scan.original[value]]
        return vertex
    numbers = isinstance(value, list) and len(value) == 3
    if not numbers or not all(isinstance(x, int | float) and math.isfinite(x) for x in value):
        raise FitError(f"{where}: {value!r} is neither a place nor a vertex", hint=EXAMPLE)
    return np.array(value, float)


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
