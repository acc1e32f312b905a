"""How the compiled kernels are compiled; importing this imports numba, so do it only when a kernel is needed.

Compiled code is kept on disk beside the source. Numba's cache watches only the file a kernel stands in, so a
kernel may call kernels of its own file only.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit


def kernel(function: Callable) -> Any:
    """Compile at the first call for each set of argument types, cache on disk, release the GIL."""
    return njit(cache=True, nogil=True)(function)


def fast_kernel(function: Callable) -> Any:
    """As :func:`kernel`, and sums may be reordered for vector units; for float32 output only."""
    return njit(cache=True, nogil=True, fastmath={"contract", "reassoc", "nsz", "arcp"}, error_model="numpy")(function)


def inlined(function: Callable) -> Any:
    """As :func:`kernel`, and its code is put into the caller's."""
    return njit(cache=True, nogil=True, inline="always")(function)
