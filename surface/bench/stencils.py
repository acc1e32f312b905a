"""Row-wise evaluation for comparison: every vertex reads a list of its own, as subdivision evaluators do.

A stencil table (Pixar's OpenSubdiv, ``Far::StencilTable``) keeps, per vertex, how many control points reach it, which
they are and with what weight. It is the plain layout; the engine's own is in :mod:`surface.deform.lists`.
"""

# mypy: allow-untyped-defs
from __future__ import annotations

from collections.abc import Callable

import numpy as np

from surface.base.jit import kernel
from surface.dcp import DCPSurface
from surface.mesh.mesh import Mesh


def stencil_evaluator(surface: DCPSurface, mesh: Mesh) -> tuple[Callable[[], None], np.ndarray]:
    """A call that computes all positions row by row with one thread, and the ``(m, 3)`` float32 it writes to."""
    matrix = surface.basis_matrix(mesh.uv, side=mesh.side)
    sizes, ids = np.diff(matrix.indptr).astype(np.int32), matrix.indices.astype(np.int32)
    weights, points = matrix.data.astype(np.float32), surface.points.astype(np.float32)
    out = np.zeros((len(mesh.vertices), 3), dtype=np.float32)
    return lambda: _apply_stencils(sizes, ids, weights, points, out), out


@kernel
def _apply_stencils(sizes, ids, weights, points, out):
    at = 0
    for s in range(sizes.shape[0]):
        x, y, z = np.float32(0), np.float32(0), np.float32(0)
        for q in range(at, at + sizes[s]):
            w, i = weights[q], ids[q]
            x += w * points[i, 0]
            y += w * points[i, 1]
            z += w * points[i, 2]
        out[s, 0], out[s, 1], out[s, 2] = x, y, z
        at += sizes[s]
