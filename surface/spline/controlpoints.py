"""Control points with local knots, and Eq. (1) evaluated over them: S = sum b_i w_i P_i / sum b_i w_i."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from hashlib import blake2b
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from surface.base.arrays import Floats, Ints
from surface.base.checks import check_points, check_sides, check_uv, check_weights

from .basis import check_padded, pad_knots
from .bins import Bins, build_bins
from .closed import Interval, check_closed, shifts_of, wrap

T = TypeVar("T")
Pair = tuple[T, T]  # in u and in v


class ControlPoints:
    """Positions, weights, knots and degrees of n control points; immutable.

    points : (n, 3) float64
    weights : (n,) float64, 1e-30 to 1e30
    knots_u, knots_v : n sequences of degree + 2 knots each, or (n, degree + 2) arrays; the degree may differ
        per point and direction (0 to 9)
    closed_u, closed_v : (start, end) of a direction that is joined at its ends, as around a neck or a torus; the
        points that reach over one end act at the other

    ``ValueError`` for wrong shapes, no points at all, numbers that are not finite, weights that are not positive
    or beyond 1e-30 to 1e30, decreasing knots, fewer than two distinct knots, or knots that differ by less than 1e-30
    without being equal or lie beyond 1e30; names the argument and the index.
    """

    def __init__(
        self,
        points: ArrayLike,
        weights: ArrayLike,
        knots_u: Any,
        knots_v: Any,
        *,
        closed_u: Interval = None,
        closed_v: Interval = None,
    ) -> None:
        xyz = check_points(points)
        w = check_weights(weights, n=len(xyz))
        ku, pu = pad_knots(knots_u, "knots_u", len(xyz))
        kv, pv = pad_knots(knots_v, "knots_v", len(xyz))
        self._keep(xyz, w, (ku, kv), (pu, pv), (closed_u, closed_v))

    @classmethod
    def from_padded(
        cls,
        points: ArrayLike,
        weights: ArrayLike,
        knots_u: ArrayLike,
        knots_v: ArrayLike,
        degrees_u: ArrayLike,
        degrees_v: ArrayLike,
        *,
        closed_u: Interval = None,
        closed_v: Interval = None,
    ) -> Self:
        """Make control points from arrays as of :attr:`padded`, (n, w) float64, and :attr:`degrees`, without
        conversion.

        Row i of the knots holds ``degrees[i] + 2`` and repeats the last one. Errors are those of the constructor.
        """
        xyz = check_points(points)
        w = check_weights(weights, n=len(xyz))
        ku, pu = check_padded(knots_u, degrees_u, "u", len(xyz))
        kv, pv = check_padded(knots_v, degrees_v, "v", len(xyz))
        table = cls.__new__(cls)
        table._keep(xyz, w, (ku, kv), (pu, pv), (closed_u, closed_v))
        return table

    def with_points(self, points: ArrayLike) -> Self:
        """Return the same control points at other positions ``(n, 3)``; knots and bins are shared."""
        xyz = check_points(points)
        if xyz.shape != (self._n, 3):
            raise ValueError(f"points: shape {xyz.shape}, expected {(self._n, 3)}")
        table = copy(self)
        table._points = np.tile(xyz, (len(self._shifts), 1))
        table._points.flags.writeable = False
        table._bins = self.bins
        return table

    def _keep(
        self, points: Floats, weights: Floats, knots: Pair[Floats], degrees: Pair[Ints], closed: Pair[Interval]
    ) -> None:
        """Keep arrays; of a closed direction also shifted copies of every point, block after block."""
        self._n = len(points)
        self._closed = check_closed(closed)
        self._shifts = shifts_of(knots, self._closed)
        blocks = len(self._shifts)
        self._points, self._weights = np.tile(points, (blocks, 1)), np.tile(weights, blocks)
        self._ku, self._kv = (np.concatenate([knots[k] + shift[k] for shift in self._shifts]) for k in range(2))
        self._pu, self._pv = (np.tile(p, blocks) for p in degrees)
        self._bins: Bins | None = None
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
        return _strip_padding(self.padded[0], self.degrees[0])

    @property
    def knots_v(self) -> Sequence[Floats]:
        """n arrays of degree + 2 knots, read-only."""
        return _strip_padding(self.padded[1], self.degrees[1])

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
        ends = [(float(knots[:, 0].min()), float(knots[:, -1].max())) for knots in self.padded]
        return (*(self._closed[0] or ends[0]), *(self._closed[1] or ends[1]))

    @property
    def structure(self) -> bytes:
        """A digest of knots, degrees and closed directions: surfaces that have it in common differ in positions and
        weights only, and a mesh of one is a mesh of the others."""
        digest = blake2b(repr(self._closed).encode(), digest_size=16)
        for knots, degrees in zip(self.padded, self.degrees, strict=True):
            digest.update(np.ascontiguousarray(knots[:, : degrees.max() + 2] + 0.0).tobytes())
            digest.update(degrees.tobytes())
        return digest.digest()

    @property
    def bins(self) -> Bins:
        """Control points by region of (u, v); built at the first evaluation."""
        if self._bins is None:
            self._bins = build_bins(self._ku, self._kv)
        return self._bins

    def arrays(self) -> tuple[np.ndarray, ...]:
        """Return knots in u and v, degrees, points and weights, shifted copies included; what the kernels take."""
        return self._ku, self._kv, self._pu, self._pv, self._points, self._weights

    def bin_arrays(self) -> tuple[np.ndarray, ...]:
        """Return the arrays of :attr:`bins`, as the kernels take them."""
        return self.bins.grid, self.bins.shape, self.bins.start, self.bins.ids

    def sample(self, uv: ArrayLike, side: ArrayLike | None) -> tuple[Floats, np.ndarray, Floats]:
        """Return checked samples, the limit that was taken (-1: uncovered) and S (m, 3); as
        :meth:`sample_derivatives`.
        """
        samples, sides, out = self._sample(uv, side, 1)
        return samples, sides, out[:, 0]

    def sample_derivatives(
        self, uv: ArrayLike, side: ArrayLike | None = None, *, second: bool = False
    ) -> tuple[Ints, Floats]:
        """Return derivatives, and the limits that were taken; places outside :attr:`rect` are uncovered, not refused.

        Returns the limit (m,) int64 that each evaluation really takes, -1 where nothing covers, and (m, 3, 3) float64
        with S, S_u, S_v, or (m, 6, 3) with S_uu, S_uv, S_vv after them.
        """
        return self._sample(uv, side, 6 if second else 3)[1:]

    def _sample(self, uv: ArrayLike, side: ArrayLike | None, kinds: int) -> tuple[Floats, Ints, Floats]:
        from .kernels import sample  # compiled: loaded when first used

        samples = wrap(check_uv(uv), self._closed)
        sides, out = check_sides(samples, side), np.zeros((len(samples), kinds, 3))
        sample(*self.arrays(), *self.bin_arrays(), samples, sides, out)
        return samples, sides, out


def _strip_padding(knots: Floats, degrees: Ints) -> list[Floats]:
    return [row[: p + 2] for row, p in zip(knots, degrees, strict=True)]
