"""Shapes that take mouth or jaw to a side, and go to the other one in the file: exchanged, and said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from surface.base.arrays import Floats
from surface.fit.source.mesh import FitMesh

PAIRS = (("mouthLeft", "mouthRight"), ("jawLeft", "jawRight"))
SURE = 0.2  # of a shape's motion that goes sideways: less does not say where it goes


def right_sides(mesh: FitMesh) -> tuple[FitMesh, list[str]]:
    """A mesh in head space with such shapes under the names of the sides that they go to, and what was exchanged, in
    words. Left is the subject's, +x. Only pairs are exchanged of which both go astray."""
    names, notes = list(mesh.names), []
    for left, right in PAIRS:
        if left in names and right in names:
            k, m = names.index(left), names.index(right)
            if _goes_left(mesh.deltas[k]) < -SURE and _goes_left(mesh.deltas[m]) > SURE:
                names[k], names[m] = right, left
                notes.append(f"{left} and {right} go to the other side in the file (left is the subject's): exchanged")
    return replace(mesh, names=tuple(names)), notes


def _goes_left(delta: Floats) -> float:
    """-1..1: how much of a shape's motion (n, 3) goes to the subject's left."""
    total = float(np.linalg.norm(delta, axis=1).sum())
    return float(delta[:, 0].sum()) / total if total > 0 else 0.0
