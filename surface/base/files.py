"""Reading untrusted files: only regular files, and never more bytes than a limit.

Every reader of omote gets its bytes from here. So a named pipe, a device, a file of many gigabytes, brackets nested a
thousand deep or an archive that unpacks to terabytes leads to an error message, and the program does not hang. Errors
of access are an :class:`OSError` with a ``strerror``, errors of content a :class:`ValueError`; the readers add which
file it was and what to do.
"""

from __future__ import annotations

import errno
import io
import json
import math
import os
import re
import stat
import struct
import sys
import tokenize
import tomllib
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO, Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

CONFIG_LIMIT = 1 << 20
"""Bytes of a file of settings (TOML)."""
TEXT_LIMIT = 64 << 20
"""Bytes of a text file that a program may have written (takes, recordings)."""
DATA_LIMIT = 1 << 30
"""Bytes of a mesh, a surface file, a sound or an archive, before and after unpacking."""

MAX_DEPTH = 64
"""Maximum nesting depth of tables and lists."""
_DEEP = f"nested too deeply: {MAX_DEPTH} tables and lists inside each other are the most"

DAMAGED = (
    OSError, ValueError, TypeError, OverflowError, EOFError, KeyError, IndexError, NotImplementedError, RuntimeError,
    MemoryError, SyntaxError, struct.error, tokenize.TokenError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
"""What numpy and zipfile raise for damaged archives."""

_CHUNK = 1 << 20
_PREFIX = 10  # bytes of an array in a file before its header: numpy's magic, version, the header's length
_HEADER = re.compile(
    rb"\{'descr': '([<|][bifu][1248])', 'fortran_order': False, 'shape': \((\d{0,12},?(?: \d{1,12},?)*)\), \} *\n"
)
_KINDS = {
    stat.S_ISDIR: "is a folder, not a file",
    stat.S_ISFIFO: "is a named pipe, not a file",
    stat.S_ISCHR: "is a device, not a file",
    stat.S_ISBLK: "is a device, not a file",
    stat.S_ISSOCK: "is a socket, not a file",
}


Parsed = TypeVar("Parsed")


class _Error(Protocol):
    def __call__(self, message: str, /, *, hint: str = "") -> Exception: ...


@contextmanager
def reading(path: str | os.PathLike[str], error: _Error, hint: str = "") -> Iterator[None]:
    """Context that converts errors of these functions to `error`, with the file's name and what to do next.

    hint : what to do about wrong content.
    """
    try:
        yield
    except OSError as found:
        raise error(f"{path}: cannot be read: {found.strerror or found}", hint=f"look at: ls -l {path}") from found
    except ValueError as found:
        raise error(f"{path}: {found}", hint=hint) from found


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
    """Return all bytes of a regular file. Raises OSError, as :func:`open_file`."""
    with open_file(path, limit) as file:
        data = file.read(os.fstat(file.fileno()).st_size + 1)
        while len(data) <= limit and (more := file.read(_CHUNK)):  # it grows, or is the kernel's
            data += more
    if len(data) > limit:
        raise OSError(errno.EFBIG, f"is larger than {limit >> 20} MB", os.fspath(path))
    return data


def read_text(path: str | os.PathLike[str], limit: int = TEXT_LIMIT) -> str:
    """Return the text of a UTF-8 file, with or without a byte order mark.

    Raises
    ------
    OSError : as :func:`open_file`. ValueError : it is not UTF-8; the message names the likely encoding.
    """
    return decode(read_file(path, limit))


def decode(data: bytes) -> str:
    """Decode UTF-8, with or without a byte order mark. Raises ValueError, which names the likely encoding."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ValueError(f"not UTF-8 (line {line}), but {_encoding(data)}: save it as UTF-8") from error


def _encoding(data: bytes) -> str:
    if data.startswith((b"\xff\xfe", b"\xfe\xff")) or data[:200].count(0) > 20:
        return "probably UTF-16"
    return "probably Latin-1 or Windows-1252"


def read_toml(path: str | os.PathLike[str], limit: int = CONFIG_LIMIT) -> dict[str, Any]:
    """Read a TOML file as a table. Raises OSError and ValueError, as :func:`read_text` and :func:`parse_toml`."""
    return parse_toml(read_text(path, limit))


def read_json(path: str | os.PathLike[str], limit: int = TEXT_LIMIT) -> Any:
    """Read a JSON file. Raises OSError and ValueError, as :func:`read_text` and :func:`parse_json`."""
    return parse_json(read_text(path, limit))


def parse_toml(text: str) -> dict[str, Any]:
    """Parse TOML into a table. Raises ValueError with line and column, also where it is nested too deeply."""
    try:
        return _shallow(tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"not valid TOML: {error}") from error
    except RecursionError:
        raise ValueError(_DEEP) from None


def parse_json(text: str | bytes, **options: Any) -> Any:
    """Parse JSON; `options` are those of :func:`json.loads`. Raises ValueError, also where it is nested too deeply."""
    try:
        return _shallow(json.loads(text, **options))
    except json.JSONDecodeError as error:
        raise ValueError(f"not valid JSON: {error.msg} (line {error.lineno}, column {error.colno})") from error
    except RecursionError:
        raise ValueError(_DEEP) from None


def _shallow(value: Parsed) -> Parsed:
    """Return the value; raise ValueError if its tables and lists are nested too deeply."""
    level: list[Any] = [value]
    for _ in range(MAX_DEPTH):
        level = [
            inner for each in level if isinstance(each, dict | list)
            for inner in (each.values() if isinstance(each, dict) else each)
        ]  # fmt: skip
        if not level:
            return value
    raise ValueError(_DEEP)


def read_npz(path: str | os.PathLike[str], limit: int = DATA_LIMIT) -> dict[str, NDArray[Any]]:
    """Return all arrays of an ``.npz`` archive, which together take at most `limit` bytes unpacked.

    Raises
    ------
    OSError : as :func:`open_file`. ValueError : no archive of numpy arrays, damaged, or larger when unpacked.
    """
    with open_file(path, limit) as file:
        try:
            with zipfile.ZipFile(file) as archive:
                _check_size(archive, limit)
                found = {entry.filename.removesuffix(".npy"): _array(archive.read(entry)) for entry in archive.filelist}
        except DAMAGED as error:
            if "allow_pickle" in str(error):  # numpy's words for what is no archive name an option of its own
                raise ValueError("holds Python objects, which omote does not load") from error
            if isinstance(error, OSError) and error.strerror:
                raise  # the disk's fault, not the content's
            foreign_words = isinstance(error, UnicodeError | TypeError | LookupError)  # the interpreter's own
            why = "it is damaged" if foreign_words else str(error)
            raise ValueError(f"not a sound archive of arrays: {why}") from error
    if foreign := [name for name, array in found.items() if not isinstance(array, np.ndarray)]:
        raise ValueError(f"{foreign[0]} is no array")  # numpy gives the bytes of a member that it does not know
    if damaged := [name for name, array in found.items() if array.dtype.kind == "U" and not _is_text(array)]:
        raise ValueError(f"{damaged[0]} holds characters that do not exist")
    return found


def _is_text(array: NDArray[Any]) -> bool:
    """Whether all characters of an array of strings are code points that may be printed and written."""
    points = np.frombuffer(array.astype(array.dtype.newbyteorder("=")).tobytes(), np.uint32)
    return bool(((points < 0xD800) | ((points > 0xDFFF) & (points <= sys.maxunicode))).all())


def _check_size(archive: zipfile.ZipFile, limit: int) -> None:
    """Refuse an archive whose declared unpacked size exceeds `limit`; zipfile enforces the declared sizes."""
    size = sum(entry.file_size for entry in archive.filelist)
    if size > limit:
        raise ValueError(f"unpacks to {size >> 20} MB, more than {limit >> 20} MB")


def _array(data: bytes) -> Any:
    """Return the array of a member of an archive, or its bytes where it holds none.

    Numbers in the usual form of header are read here, in half of the time that numpy takes for a head's hundreds of
    small arrays: it parses each header as Python. All else is numpy's to read.
    """
    if not data.startswith(np.lib.format.MAGIC_PREFIX):
        return data
    end = _PREFIX + int.from_bytes(data[_PREFIX - 2 : _PREFIX], "little")
    header = _HEADER.fullmatch(data, _PREFIX, end) if data[6:8] == b"\1\0" else None
    if header is None:
        return np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
    kind, shape = np.dtype(header[1].decode()), tuple(int(length) for length in header[2].split(b",") if length)
    return np.frombuffer(data, kind, math.prod(shape), end).reshape(shape).copy()
