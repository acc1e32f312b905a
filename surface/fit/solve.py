"""Least squares: positions and displacements of control points for given knots."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from surface import DCPSurface
from surface.fit.net import Net

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix


def basis(net: Net, uv: NDArray[np.float64]) -> csr_matrix:
    """Rational weights (m, n) of all control points (weights 1) at the samples."""
    n = len(net)
    return DCPSurface(np.zeros((n, 3)), np.ones(n), net.knots_u, net.knots_v).basis_matrix(uv)


def fairness(net: Net) -> csr_matrix:
    """Rows (n, n) that vanish where every control point lies on the surface at its own centre.

    A Laplacian in effect: it decides what the samples leave open, and damps waves between levels.
    """
    from scipy.sparse import identity

    return (identity(len(net)) - basis(net, net.centres)).tocsr()


def solve(
    net: Net, samples: csr_matrix, weight: NDArray[np.float64], targets: NDArray[np.float64], fair: float
) -> NDArray[np.float64]:
    """Control point coordinates (n, c) for all targets (m, c) at once.

    Minimises sum weight (B P - target)^2 + fair (m / n) |F P|^2 with F of :func:`fairness`; one factorisation
    serves every right-hand side.
    """
    from scipy.linalg import cho_factor, cho_solve
    from scipy.sparse import diags

    n = len(net)
    weighted = samples.T @ diags(weight)
    f = fairness(net)
    strength = fair * weight.sum() / n
    normal = (weighted @ samples + strength * (f.T @ f)).toarray()
    normal[np.diag_indices(n)] += 1e-7 * weight.sum() / n
    return cho_solve(cho_factor(normal, check_finite=False), weighted @ targets, check_finite=False)
