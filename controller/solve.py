"""Bounded least squares with sparsity: the way back from what is shown to the values that show it.

Minimises over ``low <= x <= high``

    1/2 |W (A x - b)|^2 + ridge/2 |x|^2 + sparsity |x|_1

by coordinate descent on the normal equations, which is exact for this problem (Tseng 2001) and, started from the
last solution, takes a few sweeps: it can follow a tracker.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from controller.parameters import Floats

_SWEEPS = 400


@njit(cache=True, nogil=True)
def _descend(
    gram: Floats, wanted: Floats, low: Floats, high: Floats, sparsity: float, tolerance: float, x: Floats
) -> int:
    """Coordinate descent on ``gram`` : (n, n) and ``wanted`` : (n,), in place on ``x``; returns the sweeps it took."""
    n = len(x)
    gradient = gram @ x - wanted
    for sweep in range(_SWEEPS):
        largest = 0.0
        for i in range(n):
            if gram[i, i] <= 0.0:
                continue
            goal = x[i] - gradient[i] / gram[i, i]
            shrink = sparsity / gram[i, i]
            goal = max(goal - shrink, 0.0) if goal > 0.0 else min(goal + shrink, 0.0)
            step = min(max(goal, low[i]), high[i]) - x[i]
            if step != 0.0:
                x[i] += step
                largest = max(largest, abs(step))
                for j in range(n):
                    gradient[j] += step * gram[j, i]
        if largest < tolerance:
            return sweep + 1
    return _SWEEPS


class BoundedSolver:
    """Solves for one matrix and many right-hand sides.

    Parameters
    ----------
    matrix : (m, n) float64. low, high : (n,) bounds.
    weights : (m,) how much each row counts; all alike without.
    ridge : pulls towards 0 and settles what the rows leave open. sparsity : prefers few values that are not 0.
    tolerance : largest change of a value at which it stops.

    Raises
    ------
    ValueError : shapes do not fit, a number is not finite, or bounds are inside out.
    """

    def __init__(
        self,
        matrix: Floats,
        low: Floats,
        high: Floats,
        *,
        weights: Floats | None = None,
        ridge: float = 1e-6,
        sparsity: float = 0.0,
        tolerance: float = 1e-7,
    ) -> None:
        self._matrix = np.ascontiguousarray(matrix, dtype=np.float64)
        m, n = self._matrix.shape
        self._low, self._high = (np.array(np.broadcast_to(b, n), dtype=np.float64) for b in (low, high))
        scale = np.ones(m) if weights is None else np.asarray(weights, dtype=np.float64)
        if scale.shape != (m,):
            raise ValueError(f"weights must be ({m},), not {scale.shape}")
        if not (np.isfinite(self._matrix).all() and np.isfinite(scale).all()):
            raise ValueError("matrix and weights must be finite")
        if not np.all(self._low <= self._high):
            raise ValueError("low must not be above high")
        self._weighted = self._matrix * (scale**2)[:, None]
        self._gram = self._matrix.T @ self._weighted + ridge * np.eye(n)
        self._sparsity, self._tolerance = float(sparsity), float(tolerance)
        self.sweeps = 0

    def solve(self, wanted: Floats, start: Floats | None = None) -> Floats:
        """The best (n,) values for ``wanted`` : (m,).

        Parameters
        ----------
        start : (n,) where to begin; the last solution of something that moves. Zero without.

        Raises
        ------
        ValueError : ``wanted`` is not finite.
        """
        if not np.isfinite(wanted).all():
            raise ValueError("wanted must be finite")
        x = np.zeros(len(self._low)) if start is None else np.array(start, dtype=np.float64)
        np.clip(x, self._low, self._high, out=x)
        right = wanted @ self._weighted
        self.sweeps = int(_descend(self._gram, right, self._low, self._high, self._sparsity, self._tolerance, x))
        return x

    def residual(self, x: Floats, wanted: Floats) -> Floats:
        """(m,) what ``x`` does not reach of ``wanted``."""
        return wanted - self._matrix @ x
