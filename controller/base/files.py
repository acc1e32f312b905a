"""Replaces files atomically, and checks the format version that a file states."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from controller.base.errors import ControllerError

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
    """A temporary path beside ``path`` that takes its place when the block ends well.

    Raises ControllerError: when the folder cannot be written; ``path`` stays as it was.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(suffix=path.suffix, prefix=f".{path.stem}-", dir=path.parent)
    except OSError as error:
        raise ControllerError(
            f"{path}: cannot be written: {error.strerror}", hint="choose another place with -o"
        ) from error
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        os.chmod(temporary, 0o666 & ~_umask())
        temporary.replace(path)
    except OSError as error:
        hint = "make room on the disk, or choose another place with -o"
        raise ControllerError(f"{path}: cannot be written: {error.strerror}", hint=hint) from error
    finally:
        temporary.unlink(missing_ok=True)


def place_hint(error: OSError, path: Path) -> str:
    """What to do where a file of the user's choice cannot be written."""
    return _NO_PLACE.get(error.errno or 0, "choose another folder: ls -ld {folder}").format(folder=path.parent)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def format_fault(found: object, newest: int) -> str | None:
    """What is wrong with the version that a file states; None when this omote reads it.

    found : what the file states; it grows when older readers could misread a file. newest : the newest known version.
    """
    if isinstance(found, bool) or not isinstance(found, int) or found < 1:
        return f"format: must be a whole number from 1 (is {found!r})"
    if found > newest:
        return f"format: is {found}, {NEWER}; this one reads up to {newest}"
    return None
