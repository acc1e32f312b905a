"""Checks of array arguments: they raise ``ValueError`` with the argument's name and the index; most return an array."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from surface.base.arrays import Bools, Floats, Ints

MIN_WEIGHT, MAX_WEIGHT = 1e-30, 1e30


def numbers(values: ArrayLike, name: str) -> Floats:
    """Return a float64 copy.

    ``ValueError`` names the first element that is no number, or whose shape differs from that of most elements.
    """
    try:
        return np.array(values, dtype=np.float64, order="C")
    except (ValueError, TypeError):
        if not isinstance(values, Sequence) or isinstance(values, str):
            raise ValueError(f"{name}: must be numbers, got {values!r:.60}") from None
        rows = list(values)
    shapes = []
    for i, row in enumerate(rows):
        try:
            shapes.append(np.shape(np.asarray(row, dtype=np.float64)))
        except (ValueError, TypeError):
            raise ValueError(f"{name}[{i}]: must be numbers, got {row!r:.60}") from None
    usual = max(shapes, key=shapes.count)
    i = next(k for k, shape in enumerate(shapes) if shape != usual)
    raise ValueError(f"{name}[{i}]: shape {shapes[i]}, expected {usual}")


def require(good: Bools | np.bool_, values: Floats, name: str, wanted: str = "finite") -> None:
    """Raise ``ValueError`` with the index and the value of the first element that is not ``good``."""
    if not good.all():
        at = tuple(np.argwhere(~good)[0].tolist())
        raise ValueError(f"{name}[{', '.join(map(str, at))}]: must be {wanted}, got {values[at].tolist()}")


def check_points(points: ArrayLike, name: str = "points") -> Floats:
    """Return a copy (n, 3) float64; ``ValueError`` for another shape, no points, or numbers that are not finite."""
    xyz = numbers(points, name)
    if xyz.ndim != 2 or xyz.shape[1] != 3:
        raise ValueError(f"{name}: shape {xyz.shape}, expected (n, 3)")
    if len(xyz) == 0:
        raise ValueError(f"{name}: empty; a surface needs at least one control point")
    require(np.isfinite(xyz).all(axis=1), xyz, name)
    return xyz


def require_weights(weights: Floats, name: str = "weights") -> None:
    """Raise ``ValueError`` for the first weight that is not positive, or that 32-bit sums cannot hold."""
    require(np.isfinite(weights) & (weights > 0), weights, name, "positive and finite")
    within = (weights >= MIN_WEIGHT) & (weights <= MAX_WEIGHT)
    require(within, weights, name, f"between {MIN_WEIGHT:g} and {MAX_WEIGHT:g} (scale all weights alike)")


def check_weights(weights: ArrayLike, name: str = "weights", n: int | None = None) -> Floats:
    """Return a copy (n,) float64; ``ValueError`` for another shape or weights that :func:`require_weights` refuses."""
    w = numbers(weights, name)
    if w.ndim != 1:
        raise ValueError(f"{name}: shape {w.shape}, expected (n,)")
    require_weights(w, name)
    if n is not None and len(w) != n:
        raise ValueError(f"{name}: {len(w)} weights for {n} points")
    return w


def integers(ids: ArrayLike) -> Ints:
    """Return the integers (k,) int64; ``ValueError`` for anything else."""
    if type(ids) is np.ndarray and ids.dtype == np.int64 and ids.ndim == 1 and ids.flags.c_contiguous:
        return ids
    try:
        which = np.ascontiguousarray(ids)
    except ValueError:
        raise ValueError(f"ids: needs a flat sequence of integers, got {ids!r:.60}") from None
    if which.ndim != 1 or (which.size and which.dtype.kind not in "iu"):
        raise ValueError(f"ids: needs a flat sequence of integers, got shape {which.shape} of {which.dtype}")
    return which.astype(np.int64, copy=False)


def check_ids(ids: ArrayLike, n: int) -> Ints:
    """Return (k,) int64: numbers of control points; ``ValueError`` for the first that is not one of ``n``."""
    which = integers(ids)
    bad = (which < 0) | (which >= n)
    if bad.any():
        k = int(np.argmax(bad))
        raise ValueError(f"ids[{k}]: {which[k]} is not a control point (0 to {n - 1})")
    return which


def check_uv(uv: ArrayLike, name: str = "uv") -> Floats:
    """Return the samples (m, 2) float64; ``ValueError`` for another shape or NaN."""
    fast = isinstance(uv, np.ndarray) and uv.dtype == np.float64
    samples = np.ascontiguousarray(uv) if fast else numbers(uv, name)
    if samples.ndim != 2 or samples.shape[1] != 2:
        raise ValueError(f"{name}: shape {samples.shape}, expected (m, 2)")
    require(np.isfinite(samples).all(axis=1), samples, name)
    return samples


def check_inside(
    samples: Floats, rect: tuple[float, float, float, float], closed: tuple[object, object], name: str = "uv"
) -> Floats:
    """Return ``samples (m, 2)``; ``ValueError`` for the first outside ``rect``, whose closed directions have no
    outside."""
    for axis, word in enumerate("uv"):
        low, high = rect[2 * axis], rect[2 * axis + 1]
        out = (samples[:, axis] < low) | (samples[:, axis] > high)
        if closed[axis] is None and out.any():
            i = int(np.argmax(out))
            raise ValueError(f"{name}[{i}]: {word} = {samples[i, axis]} is outside the domain, {low} to {high}")
    return samples


def check_sides(samples: Floats, side: ArrayLike | None) -> Ints:
    """Return a copy (m,) int64 of the limits to take; ``ValueError`` for another shape or values beyond 0 to 3."""
    if side is None:
        return np.zeros(len(samples), dtype=np.int64)
    fast = isinstance(side, np.ndarray) and side.dtype == np.int64
    wanted = np.asarray(side) if fast else numbers(side, "side")
    if wanted.shape not in ((), (len(samples),)):
        raise ValueError(f"side: shape {wanted.shape}, expected {(len(samples),)}")
    wanted = np.broadcast_to(wanted, len(samples))
    sides = wanted.astype(np.int64)
    bad = (sides < 0) | (sides > 3) | (sides != wanted)
    if bad.any():
        i = int(np.argmax(bad))
        raise ValueError(f"side[{i}]: must be 0, 1, 2 or 3, not {wanted[i]:g}")
    return sides
