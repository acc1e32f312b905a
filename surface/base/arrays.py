"""Names of array types that every room uses, and the median."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]
Ints = NDArray[np.int64]
Shorts = NDArray[np.int16]
Bools = NDArray[np.bool_]
Array = NDArray[Any]
"""Of any dtype, as files hold them."""


def median(values: Floats | Floats32) -> float:
    """Return the median of some numbers (n,), as numpy's function does; that one imports numpy's masked arrays, which
    takes longer than anything that a start needs it for."""
    middle = np.sort(values)[(len(values) - 1) // 2 : len(values) // 2 + 1]
    return float(middle.mean())
