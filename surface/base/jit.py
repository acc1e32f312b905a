"""How the compiled kernels are compiled; importing this imports numba, so do it only when a kernel is needed.

Compiled code is kept on disk beside the source. Numba keeps it until the file a kernel stands in changes; here it
also watches every file of the package that this one imports, and those these import, since kernels and numbers from
there are compiled into it.
"""

from __future__ import annotations

import hashlib
import re
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
    from numba.np import linalg  # only to be changed here

    ask = getattr(linalg, "ensure_blas", None)
    if ask is None:
        return
    linalg.ensure_blas = lambda: None
    try:
        import_module("numba.np.arraymath")  # asks once, when it is imported; products of matrices ask again
    finally:
        linalg.ensure_blas = ask


_leave_scipy()
PACKAGE = Path(__file__).parents[1]
IMPORT = re.compile(r"^from[ ]+(\.*)([\w.]*)[ ]+import[ ]+(\([^)]*\)|[^\n#]*)", re.MULTILINE)


def kernel(function: Callable[..., Any]) -> Any:
    """Compile at the first call for each set of argument types, cache on disk, release the GIL."""
    return _watching(njit(cache=True, nogil=True)(function))


def inlined(function: Callable[..., Any]) -> Any:
    """As :func:`kernel`, and its code is put into the caller's."""
    return _watching(njit(cache=True, nogil=True, inline="always")(function))


def _watching(dispatcher: Any) -> Any:
    """Add what a kernel's file imports to what makes the code kept on disk stale."""
    file = getattr(dispatcher._cache, "_cache_file", None)
    if file is not None:
        file._source_stamp = (file._source_stamp, stamp(Path(dispatcher.py_func.__code__.co_filename)))
    return dispatcher


@cache
def stamp(file: Path) -> str:
    """Digest of a file and of all files of the package that it draws on."""
    digest = hashlib.sha256()
    for path in sorted(drawn_on(file)):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def drawn_on(file: Path) -> set[Path]:
    """A file, what it imports of the package where it is loaded, what these import, and so on."""
    found, waiting = {file}, [file]
    while waiting:
        fresh = imported(waiting.pop()) - found
        found |= fresh
        waiting += fresh
    return found


@cache
def imported(file: Path) -> frozenset[Path]:
    """Files of the package that a file imports with ``from ... import ...`` at the left margin."""
    out = set()
    for dots, module, names in IMPORT.findall(file.read_text(encoding="utf-8")):
        parts = module.split(".") if module else []
        if dots:
            folder = file.parents[len(dots) - 1].joinpath(*parts)
        elif parts[0] == PACKAGE.name:
            folder = PACKAGE.joinpath(*parts[1:])
        else:
            continue
        modules = [folder / f"{name.split()[0]}.py" for name in names.strip("() \n").split(",") if name.strip()]
        out |= {*modules, folder.with_suffix(".py")}
        if not all(path.is_file() for path in modules):
            out.add(folder / "__init__.py")
    return frozenset(path for path in out if path.is_file())
