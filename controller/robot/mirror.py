"""Solves the channels backwards: from measured servo angles to the parameters that show them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from controller.base.parameters import Floats, Parameters
from controller.base.solve import BoundedSolver
from controller.robot.channels import ChannelTable

_RIDGE = 1e-4
_SPARSITY = 1e-3
_TOLERANCE = 1e-5


class Mirror:
    """Finds parameters whose channels give measured angles.

    A servo head shows fewer things than a face, so many faces have one pose; the one with few and small values is
    taken. The eyes are read as eye angles, never as eyeLook shapes.

    Attributes
    ----------
    readable : (n,) bool, the channels that can be inverted; one whose map turns back or is flat cannot.
    """

    def __init__(self, table: ChannelTable, parameters: Parameters) -> None:
        self._table = table
        high = parameters.high.copy()
        high[[i for i, name in enumerate(parameters.names) if name.startswith("eyeLook")]] = 0.0
        self._bounds = parameters.low, high
        self._at, self._rad = _points(table)
        steps = np.diff(self._rad, axis=1)
        real = np.diff(self._at, axis=1) > 0.0
        self.readable = np.array([_is_monotonic(row[keep]) for row, keep in zip(steps, real, strict=True)])
        self._solvers: dict[bytes, BoundedSolver] = {}
        self._last = parameters.neutral()
        self._solver(self.readable)  # compiled now, not while a bus waits

    def read(self, angles_rad: Floats, fresh: NDArray[np.bool_] | None = None) -> Floats:
        """Parameters (P,) that show ``angles_rad`` : (n,) best; angles that are not ``fresh`` : (n,) do not count."""
        counted = self.readable & np.isfinite(angles_rad)
        if fresh is not None:
            counted &= fresh
        wanted = np.where(counted, self._mixes(angles_rad), 0.0)
        self._last = self._solver(counted).solve(wanted, start=self._last)
        return self._last.copy()

    def _mixes(self, angles_rad: Floats) -> Floats:
        """(n,) mix values that give the angles, inside the calibrated points."""
        mixes = np.zeros(len(angles_rad))
        for i, angle in enumerate(angles_rad):
            if self.readable[i] and np.isfinite(angle):
                rad, at = self._rad[i], self._at[i]
                mixes[i] = np.interp(angle, rad, at) if rad[-1] > rad[0] else np.interp(-angle, -rad, at)
        return mixes

    def _solver(self, counted: NDArray[np.bool_]) -> BoundedSolver:
        """The solver for one set of angles that count; sets repeat, so solvers are cached."""
        key = counted.tobytes()
        if key not in self._solvers:
            if len(self._solvers) > 64:
                self._solvers.clear()
            self._solvers[key] = BoundedSolver(
                self._table.linear,
                *self._bounds,
                weights=counted.astype(np.float64),
                ridge=_RIDGE,
                sparsity=_SPARSITY,
                tolerance=_TOLERANCE,
            )
        return self._solvers[key]


def _points(table: ChannelTable) -> tuple[Floats, Floats]:
    """Calibrated points (n, k + 1) of mix and angle (rad); missing pieces repeat the last point."""
    curves = table.curves
    ends = np.where(curves.widths > 0.0, curves.knots + curves.widths, -np.inf)
    at = np.maximum.accumulate(np.concatenate([curves.knots[:, :1], ends], axis=1), axis=1)
    rise = np.cumsum(curves.widths * curves.slopes, axis=1)
    return at, curves.start[:, None] + np.concatenate([np.zeros((len(at), 1)), rise], axis=1)


def _is_monotonic(steps: Floats) -> bool:
    return len(steps) > 0 and bool(np.all(steps > 0.0) or np.all(steps < 0.0))
