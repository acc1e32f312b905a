"""Replaces files atomically, and checks the format version that a file states."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from controller.base.errors import ControllerError
from surface.base import writing

_NO_PLACE = {
    errno.ENOENT: "mkdir -p {folder}",
    errno.ENOTDIR: "choose another folder: {folder} is none",
    errno.ENOSPC: "make room on the disk: df -h {folder}",
    errno.EDQUOT: "make room: your quota is used up, see quota -s",
    errno.EROFS: "choose another folder: {folder} is mounted read-only",
}
NEWER = "written by a newer omote"


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path that replaces ``path`` if the block ends without an error; creates missing folders.

    See :func:`surface.base.writing.replacing`.

    Raises ControllerError: the file cannot be written; ``path`` is unchanged.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with writing.replacing(path) as temporary:
            yield temporary
    except OSError as error:
        why = error.strerror or error
        raise ControllerError(f"{path}: cannot be written: {why}", hint=place_hint(error, path)) from error


def place_hint(error: OSError, path: Path) -> str:
    """Return a hint for a file that cannot be written."""
    return _NO_PLACE.get(error.errno or 0, "choose another folder: ls -ld {folder}").format(folder=path.parent)


def format_fault(found: object, newest: int) -> str | None:
    """Return the fault of the format version that a file states, or None if this omote can read it.

    found : the stated version, which is raised when older readers could misread a file. newest : the newest that this
    omote reads.
    """
    if isinstance(found, bool) or not isinstance(found, int) or found < 1:
        return f"format: must be a whole number from 1 (is {found!r})"
    if found > newest:
        return f"format: is {found}, {NEWER}; this one reads up to {newest}"
    return None
