"""Least squares: positions and displacements of control points for given knots."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from surface.base.arrays import Floats
from surface.dcp import DCPSurface
from surface.fit.points.gram import add_normal
from surface.fit.points.net import Net
from surface.fit.source.slopes import Slopes
from surface.spline.matrix import basis_matrices

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix


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
    from scipy.sparse import identity  # takes a moment to import

    return (identity(len(net)) - basis(net, net.centres)).tocsr()


class System:
    """Normal equations of a weighted least squares problem: upper half of a matrix (n, n), right-hand sides (n, c)."""

    def __init__(self, n: int, columns: int) -> None:
        self.matrix = np.zeros((n, n))
        self.right = np.zeros((n, columns))

    def add(self, rows: csr_matrix, weight: Floats, targets: Floats) -> None:
        """Ask for rows (m, n) @ x = targets (m, c), each row with its weight (m,)."""
        matrix, right = np.zeros_like(self.matrix), np.zeros_like(self.right)
        rows.sort_indices()
        add_normal(rows.indptr, rows.indices, rows.data, weight, targets, matrix, right)
        self.matrix += matrix
        self.right += right


def solve(
    net: Net,
    samples: csr_matrix,
    weight: Floats,
    targets: Floats,
    fair: float,
    slopes: tuple[Slopes, Floats, Floats] | None = None,
) -> Floats:
    """Control point coordinates (n, c) for all targets (m, c) at once.

    Minimises sum weight (B P - target)^2 + slopes + fair (m / n) |F P|^2 with F of :func:`fairness`; one
    factorisation serves every right-hand side. ``slopes`` come with their targets (f, c) in u and in v.
    """
    from scipy.linalg import cho_factor, cho_solve

    n = len(net)
    system = System(n, targets.shape[1])
    system.add(samples, weight, targets)
    if slopes is not None:
        where, *wanted = slopes
        for axis, slope in enumerate(basis_matrices(_surface(net), where.uv, [(1, 0), (0, 1)])):
            slope.data *= np.repeat(where.span[:, axis], np.diff(slope.indptr))
            system.add(slope, where.weight, wanted[axis])
    strength = weight.sum() / n
    f = fairness(net)
    normal = system.matrix + (fair * strength * (f.T @ f)).toarray()
    normal[np.diag_indices(n)] += 1e-7 * strength
    solved: Floats = cho_solve(cho_factor(normal, check_finite=False), system.right, check_finite=False)
    return solved
