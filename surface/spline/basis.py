"""B-spline blending functions of single control points, and checks of their knots.

A blending function of degree p has p + 2 knots of its own, 0 <= p <= 9, and is zero outside them.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from surface.base.arrays import Floats, Ints
from surface.base.checks import require

MAX_DEGREE = 9
MIN_SPAN, MAX_KNOT = 1e-30, 1e30  # knots that float64 can divide by, also in products and second derivatives


def blending(knots: ArrayLike, x: ArrayLike, derivative: int = 0, *, side: str = "right") -> Floats:
    """Return the values (m,) of the blending function over ``knots``, or its derivative, at ``x``.

    knots : (p + 2,) float64, not decreasing
    x : (m,) float64
    derivative : 0, 1 or 2
    side : "right" for intervals closed on the left as in NURBS, "left" for the limit from the left,
        which differs only at knots of full multiplicity and for derivatives at repeated knots.

    Returns (m,) float64. ``ValueError`` for bad knots, samples that are not finite, an unknown derivative or side.
    """
    from . import blends  # compiled: loaded when first used

    row, _ = pad_knots([np.asarray(knots, dtype=np.float64)], "knots", 1)
    if derivative not in (0, 1, 2):
        raise ValueError(f"derivative: must be 0, 1 or 2, not {derivative!r}")
    if side not in ("left", "right"):
        raise ValueError(f'side: must be "left" or "right", not {side!r}')
    samples = _row(np.atleast_1d(x), "x")
    require(np.isfinite(samples), samples, "x")
    out = np.zeros((len(samples), 3))
    blends.blend_samples(row, row.shape[1] - 2, samples, side == "left", out)
    return out[:, derivative].copy()


def pad_knots(knots: object, name: str, n: int) -> tuple[Floats, Ints]:
    """Return knot vectors of n points, n sequences of degree + 2 numbers each or an (n, degree + 2) array, as one
    array.

    Returns (n, w) float64, whose rows repeat their last knot up to the largest length w, and degrees (n,) int64.
    ``ValueError`` with the argument's ``name`` and the index of the first bad knot vector.
    """
    if isinstance(knots, np.ndarray) and knots.ndim == 2 and knots.dtype != object:
        padded = np.array(knots, dtype=np.float64, order="C")
        degrees = np.full(len(padded), padded.shape[1] - 2, dtype=np.int64)
    elif not isinstance(knots, Iterable):
        raise ValueError(f"{name}: not {n} sequences of knots but {knots!r}")
    else:
        padded, degrees = _stack(list(knots), name)
    if len(padded) != n:
        raise ValueError(f"{name}: {len(padded)} knot vectors for {n} points")
    check_knots(padded, degrees, name)
    return padded, degrees


def _stack(rows: list[ArrayLike], name: str) -> tuple[Floats, Ints]:
    """Return rows of different lengths into one padded array."""
    flat = [_row(row, f"{name}[{i}]") for i, row in enumerate(rows)]
    lengths = np.array([len(row) for row in flat], dtype=np.int64)
    _check_degrees(lengths - 2, name)
    width = int(lengths.max(initial=2))
    columns = np.minimum(np.arange(width), lengths[:, None] - 1)
    offsets = np.cumsum(lengths) - lengths
    every = np.concatenate(flat) if flat else np.zeros(0)
    return every[offsets[:, None] + columns], lengths - 2


def _row(row: ArrayLike, name: str) -> Floats:
    """Return one knot vector."""
    try:
        values = np.asarray(row, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{name}: must be numbers, got {row!r:.60}") from None
    if values.ndim != 1:
        raise ValueError(f"{name}: not a flat sequence of numbers but {row!r:.60}")
    return np.ascontiguousarray(values)


def _check_degrees(degrees: Ints, name: str) -> None:
    bad = (degrees < 0) | (degrees > MAX_DEGREE)
    if bad.any():
        i = int(np.argmax(bad))
        raise ValueError(f"{name}[{i}]: {degrees[i] + 2} knots; a point has degree + 2 knots, degree 0 to {MAX_DEGREE}")


def check_knots(padded: Floats, degrees: Ints, name: str) -> None:
    """Raise ``ValueError`` for knots that are not finite, decrease, are all equal, or differ by next to nothing."""
    _check_degrees(degrees, name)
    good = np.isfinite(padded).all(axis=1)
    if not good.all():
        i = int(np.argmin(good))
        raise ValueError(f"{name}[{i}]: knots must be finite, got {padded[i, : degrees[i] + 2].tolist()}")
    steps = np.diff(padded, axis=1)
    good = (steps >= 0).all(axis=1) & (padded[:, -1] > padded[:, 0])
    if not good.all():
        i = int(np.argmin(good))
        if (steps[i] >= 0).all():
            raise ValueError(f"{name}[{i}]: fewer than two distinct knots (all are {padded[i, 0]})")
        k = int(np.argmax(steps[i] < 0)) + 1
        raise ValueError(f"{name}[{i}]: knots decrease at knot {k} ({padded[i, k]} after {padded[i, k - 1]})")
    _check_spans(padded, steps, name)


def _check_spans(padded: Floats, steps: Floats, name: str) -> None:
    """Raise ``ValueError`` for knots that are neither equal nor far enough apart to divide by, or too large."""
    far = np.abs(padded) > MAX_KNOT
    bad = ((steps > 0) & (steps < MIN_SPAN)) | far[:, 1:] | far[:, :-1]
    if bad.any():
        i, k = (int(x) for x in np.argwhere(bad)[0])
        raise ValueError(
            f"{name}[{i}]: knots {k} and {k + 1} are {padded[i, k]} and {padded[i, k + 1]}; make them equal, or scale "
            f"the knots: they must differ by {MIN_SPAN:g} or more and lie within {MAX_KNOT:g}"
        )


def check_padded(knots: ArrayLike, degrees: ArrayLike, axis: str, n: int) -> tuple[Floats, Ints]:
    """Return clean copies of knots ``(n, w)`` and degrees ``(n,)`` of n points; ``ValueError`` as :func:`pad_knots`."""
    rows = np.array(knots, dtype=np.float64, order="C", ndmin=2)
    p = np.array(degrees, dtype=np.int64, ndmin=1)
    for name, given in (("knots", rows), ("degrees", p)):
        if len(given) != n:
            raise ValueError(f"{name}_{axis}: {len(given)} rows for {n} points")
    short = p + 2 > rows.shape[1]
    if short.any():
        i = int(np.argmax(short))
        raise ValueError(f"degrees_{axis}[{i}]: {p[i]} needs more knots than the {rows.shape[1]} per row")
    check_knots(rows, p, f"knots_{axis}")
    return np.take_along_axis(rows, np.minimum(np.arange(rows.shape[1]), p[:, None] + 1), 1), p
