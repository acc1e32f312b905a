"""Decorators that compile kernels with numba and keep the compiled code on disk; importing this imports numba.

Compiled code is kept beside its source file, or in the user's cache folder where the folder of the source cannot be
written (``NUMBA_CACHE_DIR`` names another place). Where neither can be written, every process compiles its kernels.

Numba compiles a kernel again when its source file changes. Here it also does so when a file changes that the source
file imports, directly or through others, since kernels and constants of those files are compiled into it.

One process at a time compiles a kernel; others that need it wait, and load the code that the first one kept. Otherwise
every process would spend the same time, and two that keep code for different types could overwrite each other's.
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

from surface.base.kept_code import speed_up_loading

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
MAX_WAIT_S = 120.0
"""Maximum wait for a kernel that another process compiles; the largest takes seconds, on a busy machine many."""
IMPORT = re.compile(r"^from[ ]+(\.*)([\w.]*)[ ]+import[ ]+(\([^)]*\)|[^\n#]*)", re.MULTILINE)


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function at its first call for each set of argument types, keep the code on disk, release the GIL."""
    return _compile(
        function, _nrt=True
    )  # else it inherits the setting of a caller that is :func:`nonallocating`, and cannot allocate


def nonallocating(function: Callable[..., Any]) -> Any:
    """Do the same as :func:`kernel`, for functions that allocate no array: numba then counts no references to arrays.

    Counting them takes two calls for every array that an inlined function is given. LLVM cannot inline these calls, so
    it stores all vector registers before each of them, which may take half of the time of a short loop.
    """
    return _compile(function, _nrt=False)


def inlined(function: Callable[..., Any]) -> Any:
    """Do the same as :func:`kernel`, and numba inlines the function wherever another kernel calls it."""
    return _compile(function, inline="always")


def merged(function: Callable[..., Any]) -> Any:
    """Do the same as :func:`kernel`, and LLVM inlines the function wherever another kernel calls it.

    It is for functions of so many arrays that passing them takes longer than a small update does. Unlike a function
    that is :func:`inlined`, one that is merged may return from within a loop.
    """
    return _compile(function, forceinline=True)


def declared(*signatures: Any) -> Callable[[Callable[..., Any]], Any]:
    """Do the same as :func:`kernel`, but compile immediately, for these types of arguments and no others."""
    return lambda function: _compile(function, signatures)


def _compile(function: Callable[..., Any], signatures: Sequence[Any] = (), **options: Any) -> Any:
    dispatcher = njit(nogil=True, **options)(function)
    try:
        dispatcher.enable_caching()
    except RuntimeError:  # numba finds no folder that it may write to
        _log_once(
            "no folder for compiled code can be written, so every start compiles all kernels: "
            "set NUMBA_CACHE_DIR to a folder that can"
        )
    else:
        _tolerate_full_disks(dispatcher._cache)
        speed_up_loading(dispatcher._cache)
        _watch_imports(dispatcher)
        _compile_in_one_process(dispatcher)
    for signature in signatures:
        dispatcher.compile(signature)
    if signatures:
        dispatcher.disable_compile()
    return dispatcher


def _tolerate_full_disks(kept: Any) -> None:
    """Let a kernel run although its compiled code cannot be written to disk."""
    save = kept.save_overload

    def save_or_log(signature: Any, data: Any) -> None:
        try:
            save(signature, data)
        except OSError as error:
            _log_once(f"compiled code cannot be kept in {kept.cache_path}: {error.strerror or error}")

    kept.save_overload = save_or_log


def _compile_in_one_process(dispatcher: Any) -> None:
    """Let one process at a time look for a kernel on disk, compile it and keep it.

    No kernel calls itself through others, so processes cannot wait for each other in a circle. Numba's own lock is
    taken first: a thread that holds it may need the kernel whose lock another thread of this process holds.
    """
    compile_or_load, name = dispatcher.compile, dispatcher._cache._cache_file._index_path

    def alone(signature: Any) -> Any:
        with global_compiler_lock, _hold_lock(name):
            return compile_or_load(signature)

    dispatcher.compile = alone


@contextmanager
def _hold_lock(name: str) -> Iterator[None]:
    """Hold the lock of a name within the context; other processes of this installation wait for it.

    Systems without such locks go on without one.
    """
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
    """Lock one byte of a file; give up where the file system has no locks, or after :data:`MAX_WAIT_S`."""
    end = time.monotonic() + MAX_WAIT_S
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
    """Return the descriptor of the lock file beside the compiled code, in which each kernel locks one byte.

    None where there can be no such file. It stays open, because closing any descriptor of a file releases all locks
    that the process holds in it.
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
    """Logs once for each package that its kernels are being compiled, which may take a minute."""

    def on_start(self, event: Any) -> None:
        """Called before numba compiles a function that it has not found on disk."""
        package = event.data["dispatcher"].py_func.__module__.partition(".")[0]
        if package != "numba":  # some of its own functions are compiled into kernels
            _log_once(f"compiling the kernels of {package} for this machine: up to a minute, only once")

    def on_end(self, event: Any) -> None:
        """Required by numba; nothing is logged."""


event.register("numba:compile", _FirstCompilation())  # type: ignore[no-untyped-call]


def _watch_imports(dispatcher: Any) -> Any:
    """Compile a kernel again also when a file changes that its source file imports."""
    file = getattr(dispatcher._cache, "_cache_file", None)
    if file is not None:
        file._source_stamp = (file._source_stamp, _digest(Path(dispatcher.py_func.__code__.co_filename)))
    return dispatcher


@cache
def _digest(file: Path) -> str:
    """Return the digest of a file and of its dependencies."""
    return hashlib.sha256(b"".join(path.read_bytes() for path in sorted(dependencies(file)))).hexdigest()


def dependencies(file: Path) -> set[Path]:
    """Return a file, the files of the package that it imports when it is loaded, those these import, and so on."""
    found, waiting = {file}, [file]
    while waiting:
        new = _imports(waiting.pop()) - found
        found |= new
        waiting += new
    return found


@cache
def _imports(file: Path) -> frozenset[Path]:
    """Return files of the package that a file imports with ``from ... import ...`` at the left margin."""
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
