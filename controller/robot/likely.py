"""Guesses which face the angles of a servo head show, among the many that have the same angles.

A servo head has fewer degrees of freedom than a face: one servo lifts the lower lid for a raised cheek and for a
narrowed eye. Faces that people make are no random mixtures, so the guess is sparse over a dictionary (LASSO, Tibshirani
1996): every known expression is one entry, and every parameter alone is one. An expression that explains many angles
costs less than its dozen parameters one by one; what no expression explains, single parameters do.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from controller.base.parameters import Flags, Floats
from controller.base.solve import BoundedSolver

_RIDGE, _SPARSITY, _TOLERANCE = 1e-3, 1e-2, 1e-5
_EXPRESSION = 0.35  # an expression costs this share of what its parameters cost one by one: more would leave out what
# is shown, less would see expressions in faces that have none (measured on a recorded performance)
_BEYOND = 30.0  # a mix beyond the end of its curve costs this much less than a parameter of that size
MAX_BEYOND = 1.0
"""How far a mix may be guessed to lie beyond the end of its curve, in halves of the curve's range."""


class LikelyFace:
    """Finds the likely face for the mixes of ``n`` channels.

    mixed : from parameters (P,) to mixes (n,). linear : (n, P) increase of each mix per unit of each parameter.
    faces : (k, P) what each known expression adds to the neutral face. rest : (P,) the neutral face.
    bounds : (P,) least and (P,) greatest parameters. ends : (n,) least and (n,) greatest mix that a channel can show.
    """

    def __init__(
        self, mixed: Callable[[Floats], Floats], linear: Floats, faces: Floats, *, rest: Floats,
        bounds: tuple[Floats, Floats], ends: tuple[Floats, Floats],
    ) -> None:  # fmt: skip
        self._bounds, self._ends, self._rest = bounds, ends, rest
        (k, p), n = faces.shape, len(linear)
        cost = _EXPRESSION * np.maximum(np.abs(faces).sum(axis=1), 1e-9)
        self._faces = faces / cost[:, None]
        self._zero = np.nan_to_num(mixed(rest))
        self._scale = 2.0 / np.maximum(ends[1] - ends[0], 1e-9)  # units differ: mm of pull, shares of a range
        known = [self._scale * (np.nan_to_num(mixed(np.clip(rest + face, *bounds))) - self._zero) for face in faces]
        # a column for each expression, each parameter, and how far each mix lies beyond the end of its curve
        self._columns = np.hstack(
            [np.reshape(known, (k, n)).T / cost, linear * self._scale[:, None], -_BEYOND * np.eye(n)]
        )
        self._low = np.concatenate([np.zeros(k), bounds[0] - rest, np.zeros(n)])
        self._high = np.concatenate([cost, bounds[1] - rest, np.zeros(n)])
        self._last = np.zeros(k + p + n)
        self._solver = lru_cache(64)(self._make_solver)  # most cycles use the same channels
        self._solver(np.ones(n, bool).tobytes())  # compiles the solver here, so that no cycle of a bus waits for it

    def find(self, mixes: Floats, counted: Flags) -> Floats:
        """Return parameters (P,) for ``mixes`` : (n,), of which those ``counted`` : (n,) are known.

        A mix at the end of its curve may have been beyond it.
        """
        k, p = self._faces.shape
        low, high = self._low.copy(), self._high.copy()
        low[k + p :] = np.where(counted & (mixes <= self._ends[0]), -MAX_BEYOND / _BEYOND, 0.0)
        high[k + p :] = np.where(counted & (mixes >= self._ends[1]), MAX_BEYOND / _BEYOND, 0.0)
        wanted = np.where(counted, self._scale * (mixes - self._zero), 0.0)
        self._last = self._solver(counted.tobytes()).solve(wanted, start=self._last, bounds=(low, high))
        found = self._rest + self._last[:k] @ self._faces + self._last[k : k + p]
        clipped: Floats = np.clip(found, *self._bounds)
        return clipped

    def _make_solver(self, counted: bytes) -> BoundedSolver:
        """Create the solver for the channels that are counted: their flags as bytes."""
        weights = np.frombuffer(counted, bool).astype(np.float64)
        return BoundedSolver(self._columns, self._low, self._high, weights=weights, ridge=_RIDGE, sparsity=_SPARSITY,
                             tolerance=_TOLERANCE)  # fmt: skip
