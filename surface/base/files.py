"""Reading files that strangers wrote: nothing but files, and never more than a limit.

Every reader of omote takes its bytes from here, so that a named pipe, a device, a file of many gigabytes, brackets that
are nested a thousand deep or an archive that unpacks to terabytes is one message and not a program that hangs. What is
wrong with a file itself is an :class:`OSError` with a ``strerror``, what is wrong with its content a
:class:`ValueError`; the readers add which file it was and what to do.
"""

from __future__ import annotations

import errno
import json
import os
import stat
import tomllib
import zipfile
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

TEXT_LIMIT = 64 << 20
"""Bytes of a text file that a person may have written (TOML, JSON, CSV)."""
DATA_LIMIT = 1 << 30
"""Bytes of a mesh, a surface file, a sound or an archive, before and after unpacking."""

_CHUNK = 1 << 20
_KINDS = {
    stat.S_ISDIR: "is a folder, not a file",
    stat.S_ISFIFO: "is a named pipe, not a file",
    stat.S_ISCHR: "is a device, not a file",
    stat.S_ISBLK: "is a device, not a file",
    stat.S_ISSOCK: "is a socket, not a file",
}


def open_file(path: str | os.PathLike[str], limit: int = DATA_LIMIT) -> IO[bytes]:
    """Open a regular file of at most `limit` bytes for reading; never waits for a writer.

    Raises
    ------
    OSError : it is not there, may not be read, is no regular file, or is larger; ``strerror`` says which.
    """
    # without O_NONBLOCK the call waits until somebody writes to a named pipe
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    try:
        _check_kind(os.fstat(handle), limit)
        return os.fdopen(handle, "rb")
    except OSError as error:
        os.close(handle)
        error.filename = os.fspath(path)
        raise


def _check_kind(found: os.stat_result, limit: int) -> None:
    for test, text in _KINDS.items():
        if test(found.st_mode):
            raise OSError(errno.EINVAL, text)
    if found.st_size > limit:
        raise OSError(errno.EFBIG, f"is larger than {limit >> 20} MB ({found.st_size >> 20} MB)")


def read_file(path: str | os.PathLike[str], limit: int = DATA_LIMIT) -> bytes:
    """All bytes of a regular file. Raises OSError, as :func:`open_file`."""
    pieces, size = list[bytes](), 0
    with open_file(path, limit) as file:
        while piece := file.read(_CHUNK):
            size += len(piece)
            if size > limit:  # a file of the kernel's, or one that grows: its size did not say how much there is
                raise OSError(errno.EFBIG, f"is larger than {limit >> 20} MB", os.fspath(path))
            pieces.append(piece)
    return b"".join(pieces)


def read_text(path: str | os.PathLike[str], limit: int = TEXT_LIMIT) -> str:
    """The text of a UTF-8 file, with or without a byte order mark.

    Raises
    ------
    OSError : as :func:`open_file`. ValueError : it is not UTF-8; the message names the likely encoding.
    """
    return decode(read_file(path, limit))


def decode(data: bytes) -> str:
    """UTF-8, with or without a byte order mark, as text. Raises ValueError, which names the likely encoding."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ValueError(f"not UTF-8 (line {line}), but {_encoding(data)}: save it as UTF-8") from error


def _encoding(data: bytes) -> str:
    if data.startswith((b"\xff\xfe", b"\xfe\xff")) or data[:200].count(0) > 20:
        return "probably UTF-16"
    return "probably Latin-1 or Windows-1252"


def parse_toml(text: str) -> dict[str, Any]:
    """TOML as a table. Raises ValueError with line and column, also where it is nested too deeply."""
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("nested too deeply") from None


def parse_json(text: str | bytes, **options: Any) -> Any:
    """JSON; `options` are those of :func:`json.loads`. Raises ValueError, also where it is nested too deeply."""
    try:
        return json.loads(text, **options)
    except RecursionError:
        raise ValueError("nested too deeply") from None


def read_npz(path: str | os.PathLike[str], limit: int = DATA_LIMIT) -> dict[str, NDArray[Any]]:
    """All arrays of an ``.npz`` archive, which together take at most `limit` bytes unpacked.

    Raises
    ------
    OSError : as :func:`open_file`. ValueError : no archive of numpy arrays, damaged, or larger when unpacked.
    """
    with open_file(path, limit) as file:
        try:
            _check_archive(file, limit)
            with np.load(file, allow_pickle=False) as stored:
                found = {name: stored[name] for name in stored.files}
        except (zipfile.BadZipFile, EOFError, KeyError, NotImplementedError, MemoryError, UnicodeError) as error:
            raise ValueError(f"not a sound archive of arrays: {error}") from error
        except ValueError as error:
            if "allow_pickle" in str(error):  # numpy's words for what is no archive name an option of its own
                raise ValueError("holds Python objects, which omote does not load") from error
            raise
    if foreign := [name for name, array in found.items() if not isinstance(array, np.ndarray)]:
        raise ValueError(f"{foreign[0]} is no array")  # numpy gives the bytes of a member that it does not know
    return found


def _check_archive(file: IO[bytes], limit: int) -> None:
    """Refuse an archive that says itself that it unpacks to more than `limit`; zipfile enforces what it says."""
    with zipfile.ZipFile(file) as archive:
        size = sum(entry.file_size for entry in archive.infolist())
    if size > limit:
        raise ValueError(f"unpacks to {size >> 20} MB, more than {limit >> 20} MB")
    file.seek(0)
