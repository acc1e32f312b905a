"""Where a head came from: the transformation from the frame of the mesh's file to head space, and back."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from surface.base.arrays import Floats


@dataclass(frozen=True)
class Placement:
    """Transformation of a mesh file's coordinates to head space (mm, y up, z forward, x to the subject's left):
    ``scale * turn @ point + shift``.

    turn : (3, 3) rotation. scale : mm per unit of the file. shift : (3,) mm.
    unit : the file's unit in words, empty where the scale is none of a known unit.
    """

    turn: Floats = field(default_factory=lambda: np.eye(3))
    scale: float = 1.0
    shift: Floats = field(default_factory=lambda: np.zeros(3))
    unit: str = ""

    def points(self, rows: Floats) -> Floats:
        """Return points (..., 3) of the file in head space."""
        return self.scale * (rows @ self.turn.T) + self.shift

    def moves(self, rows: Floats) -> Floats:
        """Return displacements (..., 3) of the file in head space."""
        return self.scale * (rows @ self.turn.T)

    def file_points(self, rows: Floats) -> Floats:
        """Return points (..., 3) of head space in the file's frame."""
        return ((rows - self.shift) @ self.turn) / self.scale

    def file_moves(self, rows: Floats) -> Floats:
        """Return displacements (..., 3) of head space in the file's frame."""
        return (rows @ self.turn) / self.scale

    def file_directions(self, rows: Floats) -> Floats:
        """Return unit vectors (..., 3) of head space in the file's axes."""
        return rows @ self.turn

    def moved(self, shift: Floats) -> Placement:
        """Return this placement followed by a shift (3,), mm."""
        return Placement(self.turn, self.scale, self.shift + shift, self.unit)

    def table(self) -> dict[str, Any]:
        """Return the same in plain numbers and words, as head.toml and exported files keep it."""
        turn, shift = (np.round(rows, 9).tolist() for rows in (self.turn, self.shift))
        return {"turn": turn, "scale": self.scale, "shift": shift, "unit": self.unit}
