"""Add the expressions that a file makes of its shapes, as avatars in the VRM format do, to the shapes themselves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from surface.fit.source.mesh import FitMesh
from surface.readers.meshdata import Expression

TOLERANCE = 0.01  # of an amount of 1: an expression that is one shape by 1 is that shape under another name
PREFIX = "expression:"


def with_expressions(mesh: FitMesh, expressions: Sequence[Expression]) -> tuple[FitMesh, dict[int, list[str]]]:
    """The mesh with one more shape for each expression that is a mixture; and other names of the shapes it had.

    expressions : those of shapes that the mesh has not are left out.
    """
    index = {name: k for k, name in enumerate(mesh.names)}
    other: dict[int, list[str]] = {}
    names, moves = [], []
    for expression in expressions:
        binds = [(index[shape], weight) for shape, weight in expression.binds if shape in index]
        if len(binds) == 1 and abs(binds[0][1] - 1.0) < TOLERANCE:
            other.setdefault(binds[0][0], []).append(expression.name)
        elif binds and (title := PREFIX + expression.name) not in names:
            names.append(title)
            moves.append(sum(weight * mesh.deltas[k] for k, weight in binds))
    if not names:
        return mesh, other
    return replace(mesh, names=(*mesh.names, *names), deltas=np.concatenate([mesh.deltas, np.stack(moves)])), other
