"""Eight lanes at once against one number at a time."""

from __future__ import annotations

import numpy as np
from numba import njit

from surface.spline import lanes


@njit
def combined(a, b, number, out):
    """Every operation once."""
    x, y = lanes.load(a, 1), lanes.load(b, 0)
    lanes.prefetch(a, 10_000)
    lanes.store(out, 0, lanes.add(x, y))
    lanes.store(out, 8, lanes.sub(x, y))
    lanes.store(out, 16, lanes.mul(x, y))
    lanes.store(out, 24, lanes.div(x, y))
    lanes.store(out, 32, lanes.fma(x, number, y))
    lanes.store(out, 40, lanes.root(y))
    lanes.store(out, 48, lanes.splat(number))
    lanes.store(out, 56, lanes.zero())
    lanes.store3(out, 64, x, y, lanes.splat(number))


def test_every_operation() -> None:
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=9).astype("f4"), rng.uniform(1, 2, 8).astype("f4")
    number, out = np.float32(1.25), np.full(88, np.nan, dtype=np.float32)
    combined(a, b, number, out)
    x = a[1:]
    wanted = [x + b, x - b, x * b, x / b, x * number + b, np.sqrt(b), np.full(8, number), np.zeros(8)]
    assert np.allclose(out[:64].reshape(8, 8), wanted, rtol=3e-7, atol=3e-7)
    assert np.array_equal(out[64:].reshape(8, 3), np.stack([x, b, np.full(8, number)], axis=1))
