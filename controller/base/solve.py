"""Solves bounded, sparse least squares problems, for example for the parameters that reproduce a given face.

Minimises over ``low <= x <= high``

    1/2 |W (A x - b)|^2 + ridge/2 |x|^2 + sparsity |x|_1

by coordinate descent on the normal equations, which is exact for this problem (Tseng 2001), with Newton steps of
the values inside their bounds in between, for columns that are nearly collinear. Started from the last solution it
takes a few rounds, fast enough to follow a tracker.
"""

from __future__ import annotations

import numpy as np

from controller.base.parameters import Floats
from surface.base.jit import kernel

_MAX_ROUNDS = 200
_ZERO = 1e-13  # smaller values after a Newton step are set to zero


@kernel
def _sweep(gram: Floats, gradient: Floats, low: Floats, high: Floats, sparsity: float, x: Floats) -> float:
    """Update every coordinate once, in place on ``x`` and ``gradient``; return the largest change."""
    largest = 0.0
    for i in range(len(x)):
        goal = x[i] - gradient[i] / gram[i, i]
        shrink = sparsity / gram[i, i]
        goal = max(goal - shrink, 0.0) if goal > 0.0 else min(goal + shrink, 0.0)
        step = min(max(goal, low[i]), high[i]) - x[i]
        if step != 0.0:
            x[i] += step
            largest = max(largest, abs(step))
            for j in range(len(x)):
                gradient[j] += step * gram[j, i]
    return largest


@kernel
def _step_fraction(x: float, step: float, low: float, high: float) -> float:
    """Return the fraction 0..1 of ``step`` that keeps ``x`` within its bounds and on its side of zero."""
    end = x + step
    stop = high if step > 0.0 else low
    if x > 0.0 and step < 0.0:
        stop = max(low, 0.0)
    elif x < 0.0 and step > 0.0:
        stop = min(high, 0.0)
    return 1.0 if (end <= stop) == (step > 0.0) or end == stop else (stop - x) / step


@kernel
def _solve(matrix: Floats, right: Floats) -> None:
    """Solve by Gauss elimination with pivots: ``right (n,)`` becomes the solution; ``matrix (n, n)`` is overwritten.

    numba's own matrix functions would import scipy, which takes longer than everything else in this module.
    """
    n = len(right)
    for i in range(n):
        best = i + int(np.argmax(np.abs(matrix[i:, i])))
        if best != i:
            for k in range(i, n):
                matrix[i, k], matrix[best, k] = matrix[best, k], matrix[i, k]
            right[i], right[best] = right[best], right[i]
        if matrix[i, i] == 0.0:
            raise ValueError("the values inside their bounds do not determine each other")
        for j in range(i + 1, n):
            factor = matrix[j, i] / matrix[i, i]
            if factor != 0.0:
                for k in range(i + 1, n):
                    matrix[j, k] -= factor * matrix[i, k]
                right[j] -= factor * right[i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]


@kernel
def _newton_step(gram: Floats, gradient: Floats, low: Floats, high: Floats, sparsity: float, x: Floats) -> None:
    """Take a common Newton step of all nonzero values inside their bounds, until the first bound or zero; in place."""
    free = np.flatnonzero((x > low) & (x < high) & (x != 0.0))
    if len(free) == 0:
        return
    block = np.empty((len(free), len(free)))
    slope = np.empty(len(free))
    for i in range(len(free)):
        slope[i] = gradient[free[i]] + sparsity * np.sign(x[free[i]])
        for j in range(len(free)):
            block[i, j] = gram[free[i], free[j]]
    _solve(block, slope)
    step = -slope
    fraction = 1.0
    for i in range(len(free)):
        k = free[i]
        fraction = min(fraction, _step_fraction(x[k], step[i], low[k], high[k]))
    for i in range(len(free)):
        k = free[i]
        x[k] = min(max(x[k] + fraction * step[i], low[k]), high[k])
        if abs(x[k]) < _ZERO:
            x[k] = 0.0


@kernel
def _descend(
    gram: Floats, wanted: Floats, low: Floats, high: Floats, sparsity: float, tolerance: float, x: Floats
) -> int:
    """Minimise for ``gram`` : (n, n) and ``wanted`` : (n,), in place on ``x``; return the number of rounds."""
    gradient = np.empty(len(x))
    for round_ in range(_MAX_ROUNDS):
        for i in range(len(x)):
            gradient[i] = -wanted[i]
            for j in range(len(x)):
                gradient[i] += gram[i, j] * x[j]
        if _sweep(gram, gradient, low, high, sparsity, x) < tolerance:
            return round_ + 1
        _sweep(gram, gradient, low, high, sparsity, x)
        _newton_step(gram, gradient, low, high, sparsity, x)
    return _MAX_ROUNDS


class BoundedSolver:
    """Solves for one matrix and many right-hand sides.

    matrix : (m, n) float64. low, high : (n,) bounds. weights : (m,) of the rows. Default: 1.
    ridge : L2 penalty, which decides where the rows leave a choice. sparsity : L1 penalty.
    tolerance : iteration stops when no value changes by more than this.

    Raises ValueError: shapes do not fit, a number is not finite, or a lower bound is above its upper bound.
    """

    def __init__(
        self,
        matrix: Floats,
        low: Floats,
        high: Floats,
        *,
        weights: Floats | None = None,
        ridge: float = 1e-9,
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
        self._gram = self._matrix.T @ self._weighted
        least = 1e-12 * max(float(np.trace(self._gram)) / n, 1.0)  # keeps Newton's system solvable
        self._gram += max(ridge, least) * np.eye(n)
        self._sparsity, self._tolerance = float(sparsity), float(tolerance)
        self.rounds = 0
        self.solve(np.zeros(m))  # compiles, which may take seconds, before a bus waits for an answer

    def solve(self, wanted: Floats, start: Floats | None = None, bounds: tuple[Floats, Floats] | None = None) -> Floats:
        """Return the best (n,) values for ``wanted`` : (m,).

        ``start`` : (n,) initial values, as the last solution when following a motion. Default: zero. ``bounds`` : (n,)
        lower and (n,) upper bounds for this problem alone. Default: those of the solver.

        Raises ValueError: ``wanted`` is not finite.
        """
        if not np.isfinite(wanted).all():
            raise ValueError("wanted must be finite")
        low, high = (self._low, self._high) if bounds is None else bounds
        x = np.zeros(len(low)) if start is None else np.array(start, dtype=np.float64)
        np.clip(x, low, high, out=x)
        right = wanted @ self._weighted
        self.rounds = int(_descend(self._gram, right, low, high, self._sparsity, self._tolerance, x))
        return x
