"""Solve for positions and displacements of control points with given knots, by least squares."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import csr_matrix, diags, identity

from surface.base.arrays import Floats, Ints
from surface.base.jit import kernel
from surface.dcp import DCPSurface
from surface.fit.points.net import Net
from surface.fit.source.chart import Slopes
from surface.spline.matrix import basis_matrices


def basis(net: Net, uv: Floats) -> csr_matrix:
    """Rational weights (m, n) of all control points (weights 1) at the samples."""
    return _surface(net).basis_matrix(uv)


def _surface(net: Net) -> DCPSurface:
    n = len(net)
    return DCPSurface(np.zeros((n, 3)), np.ones(n), net.knots_u, net.knots_v)


def fairness(net: Net) -> csr_matrix:
    """Rows (n, n) that vanish where every control point lies on the surface at its own centre.

    A Laplacian in effect: it decides what the samples leave open, and damps waves between levels.
    """
    return (identity(len(net)) - basis(net, net.centres)).tocsr()


def bending(net: Net, slopes: Slopes, axis: int, centre: csr_matrix) -> Iterator[csr_matrix]:
    """Rows (f, n) that vanish where the surface does not bend within the faces of a mesh, for one corner after another.

    What stands closer than the mesh's vertices may wave between them, for positions and slopes say nothing there. These
    rows are the differences of the slope along ``axis`` half-way to a corner and that in the face's ``centre (f, n)``.
    """
    derivative = ((1, 0), (0, 1))[axis]
    for k in range(slopes.corners.shape[1]):
        half = 0.5 * (slopes.uv + slopes.corners[:, k])
        (rows,) = basis_matrices(_surface(net), half, [derivative])
        rows.data *= np.repeat(slopes.span[:, axis], np.diff(rows.indptr))
        yield (rows - centre).tocsr()


@kernel
def add_normal(
    start: Ints, columns: Ints, data: Floats, weight: Floats, targets: Floats, matrix: Floats, right: Floats
) -> None:
    """Add rows' W rows to the upper half of ``matrix (n, n)`` and rows' W targets to ``right (n, c)``.

    Control points overlap so much that the matrix is as good as full: a dense one is filled directly.

    start (m + 1,), columns, data : the rows as CSR with sorted columns; weight (m,); targets (m, c).
    """
    for k in range(len(start) - 1):
        for p in range(start[k], start[k + 1]):
            share, i = data[p] * weight[k], columns[p]
            for q in range(p, start[k + 1]):
                matrix[i, columns[q]] += share * data[q]
            for c in range(targets.shape[1]):
                right[i, c] += share * targets[k, c]


def normal_equations(rows: csr_matrix, weight: Floats, targets: Floats) -> tuple[Floats, Floats]:
    """Upper half of the matrix (n, n) and right-hand sides (n, c) for rows (m, n) @ x = targets (m, c)."""
    matrix, right = np.zeros((rows.shape[1], rows.shape[1])), np.zeros((rows.shape[1], targets.shape[1]))
    rows.sort_indices()
    add_normal(rows.indptr, rows.indices, rows.data, weight, targets, matrix, right)
    return matrix, right


def solve(
    net: Net, samples: csr_matrix, weight: Floats, targets: Floats, fair: float | Floats,
    slopes: tuple[Slopes, Floats, Floats] | None = None, bend: float | Floats = 0.0,
    turns: tuple[Floats, Floats] | None = None,
) -> Floats:  # fmt: skip
    """Control point coordinates (n, c) for all targets (m, c) at once.

    Minimises sum weight (B P - target)^2 + slopes + fair (m / n) |F P|^2 with F of :func:`fairness`; one
    factorisation serves every right-hand side. ``slopes`` come with their targets (f, c) in u and in v. ``fair`` is one
    number, or one of each control point (n,). ``bend`` : weight of :func:`bending` relative to that of slopes, one
    number or one of each face (f,). ``turns`` : what those rows should be in u and in v, (4 f, c), corner after corner
    of each face; without them 0, a surface that does not bend there.
    """
    n = len(net)
    normal, right = normal_equations(samples, weight, targets)
    if slopes is not None:
        where, *wanted = slopes
        for axis, slope in enumerate(basis_matrices(_surface(net), where.uv, [(1, 0), (0, 1)])):
            slope.data *= np.repeat(where.span[:, axis], np.diff(slope.indptr))
            more, more_right = normal_equations(slope, where.weight, wanted[axis])
            normal += more
            right += more_right
            if np.any(bend):
                corners = where.corners.shape[1]
                turn = np.zeros((corners * len(where.weight), right.shape[1])) if turns is None else turns[axis]
                for k, rows in enumerate(bending(net, where, axis, slope)):
                    more, more_right = normal_equations(rows, bend * where.weight, turn[k::corners])
                    normal += more
                    right += more_right
    strength = weight.sum() / n
    f = fairness(net)
    normal += (strength * (f.T @ diags(np.broadcast_to(fair, n)) @ f)).toarray()
    normal[np.diag_indices(n)] += 1e-7 * strength
    solved: Floats = cho_solve(cho_factor(normal, check_finite=False), right, check_finite=False)
    return solved
