"""Exported parts in the frame of the file that their head was fitted to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from surface.base.arrays import Floats, Floats32
from surface.base.errors import ExportError
from surface.export.shapes import ExportPart
from surface.head import Head
from surface.head.model.placement import Placement

FRAMES = ("head", "file")


def placement_of(head: Head) -> Placement:
    """Return the placement of a head. Raises ExportError: nothing is known of the file that it was fitted to."""
    if head.data.placement is None:
        raise ExportError(
            f"{head.name}: the head's folder does not say how its mesh was placed",
            hint="fit it again with this omote, or export it in head space",
        )
    return head.data.placement


def in_file(parts: list[ExportPart], placement: Placement, per_unit: float = 1.0) -> list[ExportPart]:
    """Return parts in the axes, origin and unit of the file, times ``per_unit``."""

    def points(rows: Floats | Floats32) -> Floats32:
        return (per_unit * placement.file_points(np.asarray(rows, float))).astype(np.float32)

    def moves(rows: Floats32) -> Floats32:
        return (per_unit * placement.file_moves(np.asarray(rows, float))).astype(np.float32)

    def directions(rows: Floats32) -> Floats32:
        return placement.file_directions(np.asarray(rows, float)).astype(np.float32)

    return [
        replace(
            part, vertices=points(part.vertices), normals=directions(part.normals),
            pivot=points(part.pivot).astype(float) if part.pivot.any() else part.pivot,
            displacements={n: moves(rows) for n, rows in part.displacements.items()},
            normal_changes={n: directions(rows) for n, rows in part.normal_changes.items()},
        )
        for part in parts
    ]  # fmt: skip
