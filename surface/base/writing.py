"""Atomic writing: to a temporary file beside the old one, which it replaces at the end."""

from __future__ import annotations

import os
import secrets
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_MAX_STEM, _MAX_SUFFIX = 40, 16
"""Characters of a file's name that the temporary name repeats; at four bytes each they fit into its 255 bytes."""


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A path to write to; what was written there replaces the file ``path`` when the block ends well.

    Links are followed and stay links, and a file that is replaced keeps its permissions and, where the system allows
    it, its owner. A device or a pipe is never replaced: what was written is copied into it. Neither is the file into
    which standard output or error goes, as ``/dev/stdout`` after ``>>``: what was written follows what is in it.

    Raises OSError: the folder or the file cannot be written; ``path`` stays as it was.
    """
    old = _status(path)
    stream = None if old is None else _stream_into(old)
    if stream is not None or (old is not None and not stat.S_ISREG(old.st_mode) and not stat.S_ISDIR(old.st_mode)):
        with _copying_into(path, stream) as temporary:
            yield temporary
        return
    target = Path(os.path.realpath(path))
    suffix = path.suffix if len(path.suffix) <= _MAX_SUFFIX else ""
    temporary = target.with_name(f".{path.stem[:_MAX_STEM]}-{secrets.token_hex(6)}{suffix}")
    try:
        # created with the permissions that the system gives new files
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        if old is not None:
            _copy_rights(old, temporary)
        yield temporary
        temporary.replace(target)
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


@contextmanager
def _copying_into(path: Path, stream: int | None) -> Iterator[Path]:
    """A path to write to; what was written there is copied into a device or a pipe, or into the descriptor ``stream``
    that is open already, when the block ends well."""
    from surface.base.files import open_file  # it comes with numpy, and the command line starts without

    with tempfile.TemporaryDirectory() as folder:
        temporary = Path(folder) / f"content{path.suffix}"
        temporary.touch()
        yield temporary
        if stream is not None:
            for printed in (sys.stdout, sys.stderr):
                if printed is not None:
                    printed.flush()  # what was printed before comes before
        with (
            open_file(temporary) as content,
            path.open("wb") if stream is None else os.fdopen(os.dup(stream), "wb") as to,
        ):
            shutil.copyfileobj(content, to)


def _stream_into(file: os.stat_result) -> int | None:
    """Return the descriptor of standard output or error where that goes into a file; None for any other file."""
    for stream in (1, 2):
        with suppress(OSError):  # it is closed
            if os.path.samestat(file, os.fstat(stream)):
                return stream
    return None


def _status(path: Path) -> os.stat_result | None:
    """Return what the system says about a file, links followed; None where there is none yet."""
    try:
        return path.stat()
    except FileNotFoundError:
        return None


def _copy_rights(old: os.stat_result, new: Path) -> None:
    """Give a file the owner, where that is allowed, and the permissions of the one that it will replace."""
    if hasattr(os, "chown"):
        with suppress(OSError):  # only root may give files away
            os.chown(new, old.st_uid, old.st_gid)
    with suppress(OSError):  # some file systems have no permissions
        new.chmod(stat.S_IMODE(old.st_mode))
