"""Learns mixes from pairs: recorded values of parameters, and the position of a servo that belongs to each.

A servo's angle is fitted as a constant and a term for each of a few parameters: a weight, or a monotone curve of
straight pieces. Least squares with bounds on every slope and a penalty on their sum (Tibshirani's lasso, 1996) leave
out parameters that are not needed. The strength of the penalty, and the choice between weights and curves, follow from
the error on blocks of the recording that were left out of the fit (cross-validation). These are blocks because faces
that are close in time are nearly equal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controller.base.parameters import Flags, Floats, Indices
from controller.base.solve import BoundedSolver

FOLDS = 5
MIN_PAIRS = 4 * FOLDS
_MIN_SPAN_DEG = 0.05  # a servo that moves less is not fitted
_MIN_SPAN = 1e-3  # a parameter that moves less is ignored
_PENALTIES = (1e-4, 1e-3, 1e-2)
_PIECES = 4
_CURVE_GAIN = 0.9  # curves are used if their error is below this fraction of the error of weights
_MIN_EXPLAINED = 0.5  # fraction of the left-out variance below which the pairs do not determine a servo
_MAX_SLOPE = 20.0  # spans of the servo per span of a parameter
_MIN_TERM = 0.005  # spans of the servo by which a term must move it
_ALIKE = 0.9995


@dataclass(frozen=True)
class FittedTerm:
    """Degrees that a parameter adds. at : (k,) its values, ascending. gives : (k,) degrees; two points for a weight."""

    parameter: int
    at: Floats
    gives: Floats


@dataclass(frozen=True)
class FittedServo:
    """The fit of one servo.

    rest_deg : its angle where every term is 0. terms : of few parameters. rms_deg : error over all pairs.
    left_out_deg : error (rms) over pairs that the fit did not know. span_deg : how far it moves in the pairs.
    why_not : empty, or why the pairs do not determine it. alike : pairs of parameters that always moved together.
    """

    rest_deg: float
    terms: tuple[FittedTerm, ...]
    rms_deg: float
    left_out_deg: float
    span_deg: float
    why_not: str = ""
    alike: tuple[tuple[int, int], ...] = ()

    def angles(self, values: Floats) -> Floats:
        """(m,) degrees for faces (m, p)."""
        parts = [np.interp(values[:, term.parameter], term.at, term.gives) for term in self.terms]
        return self.rest_deg + np.sum(parts, axis=0) if parts else np.full(len(values), self.rest_deg)


def fit_servo(values: Floats, deg: Floats, candidates: Sequence[int] | None = None) -> FittedServo:
    """Fit one servo.

    Parameters
    ----------
    values : (m, p) faces, in the order they were recorded. deg : (m,) angles of the servo.
    candidates : parameters that it may follow; None: all that move in the pairs.

    Raises ValueError: fewer pairs than :data:`MIN_PAIRS`, or a number that is not finite.
    """
    if len(values) < MIN_PAIRS or not (np.isfinite(values).all() and np.isfinite(deg).all()):
        raise ValueError(f"needs {MIN_PAIRS} pairs or more, all of finite numbers; there are {len(values)}")
    span = float(np.ptp(deg))
    moving = [
        p for p in (range(values.shape[1]) if candidates is None else candidates) if values[:, p].std() > _MIN_SPAN
    ]
    if span < _MIN_SPAN_DEG or not moving:
        why = "it does not move in the pairs" if span < _MIN_SPAN_DEG else "no parameter moves in the pairs"
        return FittedServo(float(np.median(deg)), (), 0.0, 0.0, span, why)
    basis = {pieces: _Basis.over(values[:, moving], pieces) for pieces in (1, _PIECES)}
    errors = {(pieces, x): _left_out(basis[pieces], deg, x) for pieces in basis for x in _PENALTIES}
    best = {pieces: min(_PENALTIES, key=lambda x, k=pieces: errors[k, x]) for pieces in basis}  # type: ignore[misc]
    pieces = _PIECES if errors[_PIECES, best[_PIECES]] < _CURVE_GAIN * errors[1, best[1]] else 1
    return _fitted(basis[pieces], deg, np.array(moving), values, best[pieces], errors[pieces, best[pieces]])


@dataclass(frozen=True)
class _Basis:
    """Pieces of ``j`` parameters. knots : (j, k + 1). design : (m, j k) part of each piece that a face has passed."""

    knots: Floats
    design: Floats

    @classmethod
    def over(cls, values: Floats, pieces: int) -> _Basis:
        knots = np.linspace(np.minimum(values.min(axis=0), 0.0), values.max(axis=0), pieces + 1, axis=1)
        width = np.diff(knots, axis=1)
        gone = np.clip(values[:, :, None] - knots[:, :-1], 0.0, width)
        return cls(knots, gone.reshape(len(values), -1))

    @property
    def pieces(self) -> int:
        """Number of pieces of each parameter."""
        return int(self.knots.shape[1]) - 1


def _left_out(basis: _Basis, deg: Floats, penalty: float) -> float:
    """Error (rms, degrees) on blocks that were left out of the fit."""
    block = np.arange(len(deg)) * FOLDS // len(deg)
    away = np.zeros(len(deg))
    for fold in range(FOLDS):
        out = block == fold
        slopes, rest = _slopes(basis, ~out, deg, penalty)
        away[out] = basis.design[out] @ slopes + rest - deg[out]
    return float(np.sqrt((away**2).mean()))


def _slopes(basis: _Basis, inside: Flags, deg: Floats, penalty: float) -> tuple[Floats, float]:
    """Slopes (j k,) in degrees a unit, monotone for each parameter, and the constant, from some of the pairs."""
    design, wanted = basis.design[inside], deg[inside]
    middle, scale = design.mean(axis=0), np.ptp(basis.knots, axis=1).repeat(basis.pieces)  # of each parameter's range
    span = max(float(np.ptp(wanted)), 1e-9)
    matrix, goal = (design - middle) / scale, (wanted - wanted.mean()) / span
    rising = _direction(matrix, goal, basis.pieces)
    low, high = np.where(rising, 0.0, -_MAX_SLOPE), np.where(rising, _MAX_SLOPE, 0.0)
    solver = BoundedSolver(matrix, low, high, ridge=1e-6 * len(goal), sparsity=penalty * len(goal))
    slopes = solver.solve(goal) * span / scale
    return slopes, float(wanted.mean() - middle @ slopes)


def _direction(matrix: Floats, goal: Floats, pieces: int) -> Flags:
    """(j k,) bool, whether each parameter's curve rises: by the weights alone, which see the others, too."""
    whole = matrix.reshape(len(matrix), -1, pieces).sum(axis=2)
    solver = BoundedSolver(whole, np.full(whole.shape[1], -_MAX_SLOPE), np.full(whole.shape[1], _MAX_SLOPE),
                           ridge=1e-6 * len(goal), sparsity=1e-3 * len(goal))  # fmt: skip
    weights = solver.solve(goal)
    alone = whole.T @ goal
    rising: Flags = np.repeat(np.where(weights != 0.0, weights, alone) >= 0.0, pieces)
    return rising


def _fitted(
    basis: _Basis, deg: Floats, moving: Indices, values: Floats, penalty: float, left_out: float
) -> FittedServo:
    span = float(np.ptp(deg))
    everything = np.ones(len(deg), dtype=bool)
    slopes, rest = _slopes(basis, everything, deg, penalty)
    kept = [j for j, slope in enumerate(slopes.reshape(len(moving), -1)) if _moves(basis, j, slope) > _MIN_TERM * span]
    terms, by_piece = [], slopes.reshape(len(moving), -1)
    for j in kept:
        gives = np.concatenate([[0.0], np.cumsum(by_piece[j] * np.diff(basis.knots[j]))])
        at_zero = float(np.interp(0.0, basis.knots[j], gives))  # so that a parameter at 0 adds nothing
        rest += at_zero
        terms.append(FittedTerm(int(moving[j]), basis.knots[j], gives - at_zero))
    found = FittedServo(rest, tuple(terms), 0.0, left_out, span)
    away = found.angles(values) - deg
    rest, rms = rest - float(away.mean()), float(away.std())
    explained = 1.0 - (left_out / max(float(deg.std()), 1e-9)) ** 2
    why = "" if explained >= _MIN_EXPLAINED else f"what was left out is only predicted to {left_out:.2f} degrees (rms)"
    return FittedServo(rest, tuple(terms), rms, left_out, span, why, _alike(values, moving, kept))


def _moves(basis: _Basis, j: int, slopes: Floats) -> float:
    return float(np.abs((slopes * np.diff(basis.knots[j])).sum()))


def _alike(values: Floats, moving: Indices, kept: Sequence[int]) -> tuple[tuple[int, int], ...]:
    """Pairs of a used parameter and another that always moved with it, so that the servo may follow either."""
    near = np.abs(np.corrcoef(values[:, moving].T)).reshape(len(moving), len(moving)) > _ALIKE
    return tuple((int(moving[i]), int(moving[j])) for i in kept for j in np.flatnonzero(near[i]) if j != i)
