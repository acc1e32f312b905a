"""Arrays in a file of their own beside a head, as shade, lean triangles and identities are kept."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from surface.base.errors import HeadFileError

Made = TypeVar("Made")


def beside(head: str | Path, file: str) -> Path:
    """Where a head keeps ``file``; ``head`` is its folder or its head.toml."""
    folder = Path(head)
    return (folder.parent if folder.suffix == ".toml" else folder) / file


def read_beside(path: Path, make: Callable[[np.lib.npyio.NpzFile], Made], hint: str) -> Made | None:
    """What ``make`` makes of the arrays of a file; None where there is no such file.

    Raises
    ------
    HeadFileError : the file is damaged, or ``make`` raised KeyError or ValueError over what it holds.
    """
    if not path.is_file():
        return None
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as stored:
            return make(stored)
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile, zlib.error) as error:
        raise HeadFileError(f"{path}: {error}", hint=hint) from error


def write_beside(path: Path, arrays: Mapping[str, NDArray[Any]]) -> Path:
    """Keep arrays by name, all or none of them; returns the file's path.

    Raises
    ------
    HeadFileError : the file cannot be written, or the disk is full.
    """
    new = path.with_suffix(".npz.new")
    packed: dict[str, Any] = dict(arrays)
    try:
        with new.open("wb") as stream:
            np.savez_compressed(stream, **packed)
        new.replace(path)
    except OSError as error:
        raise HeadFileError(f"{path}: cannot be written ({error})", hint="make room on the disk") from error
    finally:
        if path.parent.is_dir():
            new.unlink(missing_ok=True)
    return path
