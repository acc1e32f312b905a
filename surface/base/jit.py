"""How the compiled kernels are compiled; importing this imports numba, so do it only when a kernel is needed.

Compiled code is kept on disk beside the source. Numba keeps it until the file a kernel stands in changes; here it
also watches the files in ``SHARED``, whose kernels are called from other files.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from numba import njit


def _leave_scipy() -> None:
    """Keep numba from importing scipy's linear algebra, 0.4 s, before a kernel asks for it; none here does.

    This is inside numba: where a version of it is made otherwise, scipy is imported, and nothing else changes.
    """
    from numba.np import linalg

    ask = getattr(linalg, "ensure_blas", None)
    if ask is None:
        return
    linalg.ensure_blas = lambda: None
    try:
        import_module("numba.np.arraymath")  # asks once, when it is imported; products of matrices ask again
    finally:
        linalg.ensure_blas = ask


_leave_scipy()
SHARED = (
    "deform/apply.py", "deform/binding.py", "spline/blends.py", "spline/kernels.py", "spline/lanes.py",
    "deform/updates.py",
)  # fmt: skip


def kernel(function: Callable) -> Any:
    """Compile at the first call for each set of argument types, cache on disk, release the GIL."""
    return _watching(njit(cache=True, nogil=True)(function))


def inlined(function: Callable) -> Any:
    """As :func:`kernel`, and its code is put into the caller's."""
    return _watching(njit(cache=True, nogil=True, inline="always")(function))


def _watching(dispatcher: Any) -> Any:
    """Add the shared files to what makes the code kept on disk stale."""
    file = getattr(dispatcher._cache, "_cache_file", None)
    if file is not None:
        file._source_stamp = (file._source_stamp, shared_stamp())
    return dispatcher


@cache
def shared_stamp() -> str:
    """Digest of the files in ``SHARED``."""
    digest = hashlib.sha256()
    for name in SHARED:
        digest.update((Path(__file__).parents[1] / name).read_bytes())
    return digest.hexdigest()
