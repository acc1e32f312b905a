"""Correct shapes that do not do what their names say, with a note on each.

Shapes that move mouth or jaw to the wrong side are exchanged; a ``mouthClose`` that does not close an open jaw is
replaced.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from surface.base.arrays import Floats
from surface.fit.source.mesh import FitMesh
from surface.fit.source.naming.closes import made_close

PAIRS = (("mouthLeft", "mouthRight"), ("jawLeft", "jawRight"))
MIN_CLOSING = 0.25  # of the way of jawOpen: a mouthClose that moves nothing this far only presses the lips
MIN_SIDEWAYS = 0.2  # fraction of a shape's motion that goes sideways; with less its direction is not known


def correct_shapes(mesh: FitMesh) -> tuple[FitMesh, list[str]]:
    """A mesh in head space with shapes that do what their names say, and notes on what was changed."""
    mesh, sides = correct_sides(mesh)
    mesh, closes = closing(mesh)
    return mesh, [*sides, *closes]


def closing(mesh: FitMesh) -> tuple[FitMesh, list[str]]:
    """The mesh with a mouthClose that brings the lips together over its jawOpen, and a note of what that took.

    One that cannot do so, as in drawn characters, whose jaw is made from a vowel, is replaced by one made from jawOpen,
    or left out where the lips cannot be found; one that is missing is made.
    """
    if "jawOpen" not in mesh.names:
        return mesh, []
    why, kept = "the mesh has none", mesh
    if "mouthClose" in mesh.names:
        close, jaw = (float(np.abs(_delta(mesh, n)).max(initial=0.0)) for n in ("mouthClose", "jawOpen"))
        if close >= MIN_CLOSING * jaw:
            return mesh, []
        why = f"that of the mesh moves the lips by {close:.1f} mm, and closes no jaw that opens by {jaw:.1f} mm"
        rows = [k for k, n in enumerate(mesh.names) if n != "mouthClose"]
        kept = replace(mesh, names=tuple(mesh.names[k] for k in rows), deltas=mesh.deltas[rows])
    made = made_close(kept)
    if made is None:
        return kept, [f"mouthClose: left out: {why}"] if kept is not mesh else []
    names, deltas = (*kept.names, "mouthClose"), np.concatenate([kept.deltas, made[None]])
    return replace(kept, names=names, deltas=deltas), [f"mouthClose: made from jawOpen: {why}"]


def _delta(mesh: FitMesh, name: str) -> Floats:
    delta: Floats = mesh.deltas[mesh.names.index(name)]
    return delta


def correct_sides(mesh: FitMesh) -> tuple[FitMesh, list[str]]:
    """A mesh in head space with such shapes under the names of the sides that they go to, and what was exchanged, in
    words. Left is the subject's, +x. Only pairs are exchanged of which both go astray."""
    names, notes = list(mesh.names), []
    for left, right in PAIRS:
        if left in names and right in names:
            k, m = names.index(left), names.index(right)
            if _goes_left(mesh.deltas[k]) < -MIN_SIDEWAYS and _goes_left(mesh.deltas[m]) > MIN_SIDEWAYS:
                names[k], names[m] = right, left
                notes.append(f"{left} and {right} go to the other side in the file (left is the subject's): exchanged")
    return replace(mesh, names=tuple(names)), notes


def _goes_left(delta: Floats) -> float:
    """-1..1: how much of a shape's motion (n, 3) goes to the subject's left."""
    total = float(np.linalg.norm(delta, axis=1).sum())
    return float(delta[:, 0].sum()) / total if total > 0 else 0.0
