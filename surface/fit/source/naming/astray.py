"""Shapes that do something else than their names say: exchanged or left out, and said.

Those that take mouth or jaw to a side and go to the other one, and a ``mouthClose`` that closes no open jaw.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from surface.base.arrays import Floats
from surface.fit.source.mesh import FitMesh

PAIRS = (("mouthLeft", "mouthRight"), ("jawLeft", "jawRight"))
CLOSES = 0.25  # of the way of jawOpen: a mouthClose that moves nothing so far only presses the lips
SURE = 0.2  # of a shape's motion that goes sideways: less does not say where it goes


def right_shapes(mesh: FitMesh) -> tuple[FitMesh, list[str]]:
    """A mesh in head space with shapes that do what their names say, and what was changed, in words."""
    mesh, sides = right_sides(mesh)
    mesh, closes = closing(mesh)
    return mesh, [*sides, *closes]


def closing(mesh: FitMesh) -> tuple[FitMesh, list[str]]:
    """The mesh without a mouthClose that cannot bring the lips together over its jawOpen, and a note of it."""
    if not {"jawOpen", "mouthClose"} <= set(mesh.names):
        return mesh, []
    most = {n: float(np.abs(mesh.deltas[mesh.names.index(n)]).max(initial=0.0)) for n in ("jawOpen", "mouthClose")}
    if most["mouthClose"] >= CLOSES * most["jawOpen"]:
        return mesh, []
    kept = [k for k, n in enumerate(mesh.names) if n != "mouthClose"]
    note = (
        f"mouthClose: left out: it moves the lips by {most['mouthClose']:.1f} mm, and closes no jaw that opens by "
        f"{most['jawOpen']:.1f} mm"
    )
    return replace(mesh, names=tuple(mesh.names[k] for k in kept), deltas=mesh.deltas[kept]), [note]


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
