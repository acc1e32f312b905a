"""Decorators that compile kernels with numba and keep the compiled code on disk; importing this imports numba.

Compiled code is kept beside the code it was made from, or in the user's cache folder where that cannot be written
(``NUMBA_CACHE_DIR`` names another place). Where neither can, kernels are compiled in every process.

Numba compiles again when the file of a kernel changes. Here it also does when a file of the package changes that this
one imports, directly or not, since kernels and constants from there are compiled into it.

One process at a time compiles a kernel; others that need it wait and load what was kept. Else all would spend the same
time, and two that keep code for different types at once could each overwrite what the other one wrote.
"""

from __future__ import annotations

import hashlib
import logging
import os
import re
import time
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from numba import njit
from numba.core import event
from numba.core.caching import FunctionCache
from numba.core.compiler_lock import global_compiler_lock

try:
    import fcntl
except ImportError:  # Windows: there, every process compiles for itself
    fcntl = None  # type: ignore[assignment]

log = logging.getLogger(__name__)


def _skip_scipy() -> None:
    """Keep numba from importing scipy's linear algebra, 0.4 s, which no kernel of omote needs.

    This patches a private part of numba: a version without it imports scipy, and nothing else changes.
    """
    from numba.np import linalg  # only to be patched here

    original = getattr(linalg, "ensure_blas", None)
    if original is None:
        return
    linalg.ensure_blas = lambda: None
    try:
        import_module("numba.np.arraymath")  # calls it once, when it is imported; products of matrices call it again
    finally:
        linalg.ensure_blas = original


_skip_scipy()
PACKAGE = Path(__file__).parents[1]
LONGEST_WAIT_S = 120.0
"""For a kernel that another process compiles; the largest takes seconds, on a busy machine many."""
IMPORT = re.compile(r"^from[ ]+(\.*)([\w.]*)[ ]+import[ ]+(\([^)]*\)|[^\n#]*)", re.MULTILINE)


def kernel(function: Callable[..., Any]) -> Any:
    """Compile at the first call for each set of argument types, cache on disk, release the GIL."""
    return _compiled(function, _nrt=True)  # else it takes what a lean caller has, and cannot allocate


def lean(function: Callable[..., Any]) -> Any:
    """As :func:`kernel`, for loops that allocate nothing: without numba's counts of references to arrays.

    Those are calls that LLVM cannot look into, around every array that an inlined function takes; each of them makes
    it write all vector registers to memory. Such code may take half of the time of a short loop.
    """
    return _compiled(function, _nrt=False)


def inlined(function: Callable[..., Any]) -> Any:
    """As :func:`kernel`, and its code is put into the caller's."""
    return _compiled(function, inline="always")


def merged(function: Callable[..., Any]) -> Any:
    """As :func:`kernel`, and LLVM puts its code into the caller's: for calls with so many arrays that passing them on
    takes longer than a small update. Unlike :func:`inlined`, it may return from within loops."""
    return _compiled(function, forceinline=True)


def declared(*signatures: Any) -> Callable[[Callable[..., Any]], Any]:
    """As :func:`kernel`, but compile for these types of arguments at once, and for no others."""
    return lambda function: _compiled(function, signatures)


def _compiled(function: Callable[..., Any], signatures: Sequence[Any] = (), **options: Any) -> Any:
    dispatcher = njit(nogil=True, **options)(function)
    try:
        dispatcher.enable_caching()
    except RuntimeError:  # numba finds no folder that it may write to
        _log_once("compiled code can be kept in no folder, so every start compiles it: set NUMBA_CACHE_DIR to one")
    else:
        _tolerate_full_disks(dispatcher._cache)
        _watch_imports(dispatcher)
        _compile_in_one_process(dispatcher)
    for signature in signatures:
        dispatcher.compile(signature)
    if signatures:
        dispatcher.disable_compile()
    return dispatcher


def _tolerate_full_disks(kept: Any) -> None:
    """Let a kernel run that could be compiled but not be kept."""
    save = kept.save_overload

    def save_or_log(signature: Any, data: Any) -> None:
        try:
            save(signature, data)
        except OSError as error:
            _log_once(f"compiled code cannot be kept in {kept.cache_path}: {error.strerror or error}")

    kept.save_overload = save_or_log


def _compile_in_one_process(dispatcher: Any) -> None:
    """Let a kernel be looked for on disk, compiled and kept by one process at a time.

    Kernels call each other in no circle, so neither do processes wait for each other in one. Numba's own lock is taken
    first: a thread that holds it may need the kernel that another thread of this process would hold.
    """
    compile_or_load, name = dispatcher.compile, dispatcher._cache._cache_file._index_path

    def alone(signature: Any) -> Any:
        with global_compiler_lock, _held(name):
            return compile_or_load(signature)

    dispatcher.compile = alone


@contextmanager
def _held(name: str) -> Iterator[None]:
    """Hold a name until the end, as far as the system can; other processes of this installation wait for it."""
    descriptor, place = _lock_file(), zlib.crc32(name.encode()) >> 1  # a file's offset may have 31 bits
    if descriptor is None:
        yield
        return
    _wait_for(descriptor, place)
    try:
        yield
    finally:
        with suppress(OSError):
            fcntl.lockf(descriptor, fcntl.LOCK_UN, 1, place)


def _wait_for(descriptor: int, place: int) -> None:
    """Take a byte's lock; go on without it where there are none, or where its holder seems to have been stopped."""
    end = time.monotonic() + LONGEST_WAIT_S
    while time.monotonic() < end:
        try:
            fcntl.lockf(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, place)
            return
        except (BlockingIOError, PermissionError):  # another process has it
            time.sleep(0.02)
        except OSError:  # a file system without locks
            return


@cache
def _lock_file() -> int | None:
    """Descriptor of a file whose bytes stand for kernels, beside compiled code; None where there can be none.

    It stays open: closing any descriptor of a file gives up all locks that a process holds in it.
    """
    if fcntl is None:
        return None
    try:
        kept = FunctionCache(kernel)  # type: ignore[no-untyped-call]
        return os.open(Path(kept.cache_path) / "kernels.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    except (OSError, RuntimeError):  # RuntimeError: numba finds no folder
        return None


@cache
def _log_once(text: str) -> None:
    log.warning("%s", text)


class _FirstCompilation(event.Listener):
    """Says that a room's kernels are being compiled, which takes so long that a person would wonder."""

    def on_start(self, event: Any) -> None:
        """Called before numba compiles a function that it has not found on disk."""
        room = event.data["dispatcher"].py_func.__module__.partition(".")[0]
        if room != "numba":  # some of its own functions are compiled into kernels
            _log_once(f"compiling the kernels of {room} for this machine: up to a minute, only once")

    def on_end(self, event: Any) -> None:
        """Nothing to say."""


event.register("numba:compile", _FirstCompilation())  # type: ignore[no-untyped-call]


def _watch_imports(dispatcher: Any) -> Any:
    """Let changes of what a kernel's file imports invalidate its code on disk, too."""
    file = getattr(dispatcher._cache, "_cache_file", None)
    if file is not None:
        file._source_stamp = (file._source_stamp, _digest(Path(dispatcher.py_func.__code__.co_filename)))
    return dispatcher


@cache
def _digest(file: Path) -> str:
    """Digest of a file and of its dependencies."""
    return hashlib.sha256(b"".join(path.read_bytes() for path in sorted(dependencies(file)))).hexdigest()


def dependencies(file: Path) -> set[Path]:
    """A file, the files of the package that it imports when it is loaded, those these import, and so on."""
    found, waiting = {file}, [file]
    while waiting:
        new = _imports(waiting.pop()) - found
        found |= new
        waiting += new
    return found


@cache
def _imports(file: Path) -> frozenset[Path]:
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
