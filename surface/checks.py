"""Checks of arguments: each returns a clean copy or says what is wrong, and where."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .basis import Floats, Ints


def check_sides(samples: Floats, side: ArrayLike | None) -> Ints:
    """(m,) int64 copy of the wanted limits; ``ValueError`` for others than 0 to 3."""
    sides = np.zeros(len(samples), dtype=np.int64)
    if side is not None:
        sides[:] = side
        if ((sides < 0) | (sides > 3)).any():
            raise ValueError("side: must be 0, 1, 2 or 3")
    return sides


def numbers(values: ArrayLike, name: str) -> Floats:
    """A float64 copy; ``ValueError`` naming the first element that is not numbers like the one before."""
    try:
        return np.array(values, dtype=np.float64, order="C")
    except (ValueError, TypeError):
        rows = list(values)  # type: ignore[arg-type]
    for i, row in enumerate(rows):
        try:
            shape = np.shape(np.asarray(row, dtype=np.float64))
        except (ValueError, TypeError):
            raise ValueError(f"{name}[{i}]: must be numbers, got {row!r}") from None
        if shape != np.shape(rows[0]):
            raise ValueError(f"{name}[{i}]: shape {shape}, expected {np.shape(rows[0])}")
    raise ValueError(f"{name}: must be numbers")


def check_points(points: ArrayLike, name: str = "points") -> Floats:
    """(n, 3) float64 copy; ``ValueError`` for another shape, no points, or numbers that are not finite."""
    xyz = numbers(points, name)
    if xyz.ndim != 2 or xyz.shape[1] != 3:
        raise ValueError(f"{name}: shape {xyz.shape}, expected (n, 3)")
    if len(xyz) == 0:
        raise ValueError(f"{name}: empty; a surface needs at least one control point")
    finite = np.isfinite(xyz).all(axis=1)
    if not finite.all():
        i = int(np.argmin(finite))
        raise ValueError(f"{name}[{i}]: must be finite, got {xyz[i].tolist()}")
    return xyz


def check_weights(weights: ArrayLike, name: str = "weights") -> Floats:
    """(n,) float64 copy; ``ValueError`` for another shape or weights that are not positive and finite."""
    w = numbers(weights, name)
    if w.ndim != 1:
        raise ValueError(f"{name}: shape {w.shape}, expected (n,)")
    good = np.isfinite(w) & (w > 0)
    if not good.all():
        i = int(np.argmin(good))
        raise ValueError(f"{name}[{i}]: must be positive and finite, got {w[i]}")
    return w


def check_uv(uv: ArrayLike, name: str = "uv") -> Floats:
    """(m, 2) float64; ``ValueError`` for another shape or NaN."""
    samples = np.ascontiguousarray(np.asarray(uv, dtype=np.float64))
    if samples.ndim != 2 or samples.shape[1] != 2:
        raise ValueError(f"{name}: shape {samples.shape}, expected (m, 2)")
    good = np.isfinite(samples).all(axis=1)
    if not good.all():
        i = int(np.argmin(good))
        raise ValueError(f"{name}[{i}]: must be finite, got {samples[i].tolist()}")
    return samples
