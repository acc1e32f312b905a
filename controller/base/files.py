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
    """A temporary path that takes the place of ``path`` when the block ends well; see
    :func:`surface.base.writing.replacing`. Folders that are missing are made.

    Raises ControllerError: when the file cannot be written; ``path`` stays as it was.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with writing.replacing(path) as temporary:
            yield temporary
    except OSError as error:
        why = error.strerror or error
        raise ControllerError(f"{path}: cannot be written: {why}", hint=place_hint(error, path)) from error


def place_hint(error: OSError, path: Path) -> str:
    """What to do where a file of the user's choice cannot be written."""
    return _NO_PLACE.get(error.errno or 0, "choose another folder: ls -ld {folder}").format(folder=path.parent)


def format_fault(found: object, newest: int) -> str | None:
    """What is wrong with the version that a file states; None when this omote reads it.

    found : what the file states; it grows when older readers could misread a file. newest : the newest known version.
    """
    if isinstance(found, bool) or not isinstance(found, int) or found < 1:
        return f"format: must be a whole number from 1 (is {found!r})"
    if found > newest:
        return f"format: is {found}, {NEWER}; this one reads up to {newest}"
    return None
