"""Where a head lay that omote exported: its file says so, and eyes that were made anew would say something else."""

from __future__ import annotations

import json
from collections.abc import Mapping
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from surface.base.arrays import Floats
from surface.fit.source.placing.conventions import GLTF, OBJ, convention_of, first_line, is_export
from surface.fit.source.placing.frame import UNITS
from surface.head.model.placement import Placement
from surface.readers.gltf.container import Gltf

SQUARE_TO = 1e-3  # of the rows of a rotation


def exported_placement(path: Path) -> Placement | None:
    """Return how a file of omote lies to the head space of the head that it shows: as the file says, or as it is for
    all files in head space; None for other files, and for those of older versions in a mesh's own frame.

    Raises FitError: a glTF file is damaged.
    """
    if not is_export(path):
        return None
    for known in (GLTF, OBJ):
        if convention_of(path) == known:
            return Placement(scale=UNITS[known.unit], unit=known.unit)
    return _placement(_said(path))


def _said(path: Path) -> Any:
    """Return what a file in a mesh's own frame says of it: a table, or whatever somebody made of it."""
    if path.suffix.lower() != ".obj":
        return Gltf(path).document["asset"]["extras"].get("placement")
    _, brace, rest = first_line(path).partition("{")
    try:
        return json.loads(brace + rest).get("placement")
    except ValueError:
        return None


def _placement(table: Any) -> Placement | None:
    """Return a placement in plain numbers as one; None where it is none."""
    if not isinstance(table, Mapping) or not isinstance(table.get("unit"), str):
        return None
    try:
        turn, shift = (np.array(table[key], float) for key in ("turn", "shift"))
        scale = float(table["scale"])
    except (KeyError, TypeError, ValueError):
        return None
    good = turn.shape == (3, 3) and shift.shape == (3,) and isfinite(scale) and scale > 0 and _is_rotation(turn)
    return Placement(turn, scale, shift, table["unit"]) if good and np.isfinite(shift).all() else None


def _is_rotation(turn: Floats) -> bool:
    return bool(np.allclose(turn @ turn.T, np.eye(3), atol=SQUARE_TO) and np.linalg.det(turn) > 0)
