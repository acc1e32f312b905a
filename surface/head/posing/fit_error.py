"""Read, write and apply how far a head's surface lies from the mesh that it was fitted to (``fit_error.npz``).

Distances are of vertices at rest, by part, in whole hundredths of a millimetre. As what is baked, the file belongs to
one order of the vertices; heads without it, and parts that no mesh was fitted with, have no such attribute.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from surface.base.arrays import Floats, Floats32
from surface.head.model.sidecar import sidecar_path
from surface.head.posing.baked import Meshed, read_baked, set_attribute, write_rows
from surface.head.posing.part import HeadPart

FIT_ERROR = "fit_error.npz"
ATTRIBUTE = "fit_error"
STEP_MM = 0.01
UNKNOWN = np.iinfo(np.uint16).max
"""Stored for a vertex that was not measured."""


def read_fit_error(head: str | Path, parts: Iterable[Meshed] = ()) -> dict[str, Floats32]:
    """Return distances (m,) mm by part, NaN where none was measured; empty where the head has no such file.

    head : the head's folder or its head.toml. parts : what they are for; those of another tessellation are left out.

    Raises HeadFileError: the file is damaged, of a newer version, or was made for another mesh of a part.
    """
    return read_baked(head, FIT_ERROR, parts, _unpack)


def _unpack(stored: np.ndarray) -> Floats32:
    """Return the distances (m,), mm. Raises ValueError: the array is damaged."""
    if stored.ndim != 1 or stored.dtype != np.uint16:
        raise ValueError(f"holds an array of shape {stored.shape} and type {stored.dtype}, expected (any,) uint16")
    return np.where(stored == UNKNOWN, np.nan, STEP_MM * stored).astype(np.float32)


def write_fit_error(head: str | Path, errors: Mapping[str, Floats], parts: Iterable[HeadPart]) -> Path:
    """Write distances (m,) mm of ``parts`` to the head's folder, NaN where none was measured; returns the file's path.

    Raises HeadFileError: it cannot be written.
    """
    packed = {}
    for name, mm in errors.items():
        steps = np.minimum(np.rint(np.nan_to_num(mm) / STEP_MM), UNKNOWN - 1)
        packed[name] = np.where(np.isnan(mm), UNKNOWN, steps).astype(np.uint16)
    return write_rows(sidecar_path(head, FIT_ERROR), packed, parts)


def apply_fit_error(parts: Iterable[HeadPart], errors: Mapping[str, Floats32]) -> None:
    """Set the ``fit_error`` attribute (m,) mm of the parts that were measured."""
    set_attribute(parts, ATTRIBUTE, errors)
