"""The arrays of a surface's control points, and what follows from them alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .basis import Floats, Ints
from .bins import Bins, build_bins
from .closed import Interval, check_closed, shifts_of


class ControlPoints:
    """Positions, weights, knots and degrees of n control points; read-only."""

    def _set(
        self,
        points: Floats,
        weights: Floats,
        knots: tuple[Floats, Floats],
        degrees: tuple[Ints, Ints],
        closed: tuple[Interval, Interval],
    ) -> None:
        """Keep arrays; of a closed direction also shifted copies of every point, block after block."""
        self._n = len(points)
        self._closed = check_closed(closed)
        self._shifts = shifts_of(knots, self._closed)
        blocks = len(self._shifts)
        self._points, self._weights = np.tile(points, (blocks, 1)), np.tile(weights, blocks)
        moved = [np.concatenate([knots[k] + shift[k] for shift in self._shifts]) for k in range(2)]
        self._ku, self._kv = moved
        self._pu, self._pv = (np.tile(p, blocks) for p in degrees)
        self._lazy_bins: Bins | None = None
        for array in (self._points, self._weights, self._ku, self._kv, self._pu, self._pv):
            array.flags.writeable = False

    @property
    def n(self) -> int:
        """How many control points."""
        return self._n

    @property
    def closed(self) -> tuple[Interval, Interval]:
        """(start, end) of u and of v where they are joined, None where they are not."""
        return self._closed

    @property
    def shifts(self) -> Floats:
        """(b, 2) float64: shifts in u and v of the copies of a closed surface, (0, 0) first."""
        return self._shifts

    @property
    def points(self) -> Floats:
        """(n, 3) float64, read-only."""
        return self._points[: self._n]

    @property
    def weights(self) -> Floats:
        """(n,) float64, read-only."""
        return self._weights[: self._n]

    @property
    def knots_u(self) -> Sequence[Floats]:
        """n arrays of degree + 2 knots, read-only."""
        return [row[: p + 2] for row, p in zip(self.padded[0], self.degrees[0], strict=True)]

    @property
    def knots_v(self) -> Sequence[Floats]:
        """n arrays of degree + 2 knots, read-only."""
        return [row[: p + 2] for row, p in zip(self.padded[1], self.degrees[1], strict=True)]

    @property
    def degrees(self) -> tuple[Ints, Ints]:
        """Degrees in u and v, (n,) int64 each, read-only."""
        return self._pu[: self._n], self._pv[: self._n]

    @property
    def padded(self) -> tuple[Floats, Floats]:
        """Knots in u and v, (n, w) float64 each, read-only; rows repeat their last knot."""
        return self._ku[: self._n], self._kv[: self._n]

    @property
    def supports(self) -> Floats:
        """(n, 4) float64: u0, u1, v0, v1 of every point's subdomain."""
        return self.all_supports[: self._n]

    @property
    def all_supports(self) -> Floats:
        """As :attr:`supports`, with the shifted copies of a closed surface after them; what :attr:`bins` lists."""
        return np.stack([self._ku[:, 0], self._ku[:, -1], self._kv[:, 0], self._kv[:, -1]], axis=1)

    @property
    def rect(self) -> tuple[float, float, float, float]:
        """u0, u1, v0, v1 of the smallest rectangle that holds every subdomain, or of the closed interval."""
        ends = []
        for knots, closed in zip(self.padded, self._closed, strict=True):
            ends.append(closed or (float(knots[:, 0].min()), float(knots[:, -1].max())))
        return (*ends[0], *ends[1])

    @property
    def bins(self) -> Bins:
        """Control points by region of (u, v); built at the first evaluation."""
        if self._lazy_bins is None:
            self._lazy_bins = build_bins(self._ku, self._kv)
        return self._lazy_bins

    def arrays(self) -> tuple[np.ndarray, ...]:
        """Knots in u and v, degrees, points and weights, shifted copies included; what the kernels take."""
        return self._ku, self._kv, self._pu, self._pv, self._points, self._weights

    def bin_arrays(self) -> tuple[np.ndarray, ...]:
        """The arrays of :attr:`bins`, as the kernels take them."""
        return self.bins.grid, self.bins.shape, self.bins.start, self.bins.ids
