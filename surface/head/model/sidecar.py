"""Arrays in a file of their own beside a head, as shade, decimated triangles and identities are kept."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from surface.base.arrays import Array
from surface.base.errors import HeadFileError

Made = TypeVar("Made")
VERSION = 1
OWN = "omote/"  # names of what stands in every such file beside its arrays
_DAMAGE = (
    ValueError, TypeError, OverflowError, EOFError, KeyError, IndexError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
FORMAT, CHECK = f"{OWN}format", f"{OWN}checksum/"


def sidecar_path(head: str | Path, file: str) -> Path:
    """Where a head keeps ``file``; ``head`` is its folder or its head.toml."""
    folder = Path(head)
    return (folder.parent if folder.suffix == ".toml" else folder) / file


@dataclass(frozen=True)
class Sidecar:
    """What such a file holds.

    Attributes
    ----------
    path : the file
    arrays : by name
    checks : checksums of what each part's arrays depend on, by part; empty in files of before there were any
    """

    path: Path
    arrays: dict[str, Array]
    checks: dict[str, int]


def read_sidecar(path: Path, make: Callable[[Sidecar], Made], hint: str) -> Made | None:
    """What ``make`` makes of the arrays of a file; None where there is no such file.

    Raises
    ------
    HeadFileError : the file is damaged or of a newer version, or ``make`` raised KeyError or ValueError over what it
        holds.
    """
    if not path.is_file():
        return None
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as stored:
            every = {name: stored[name] for name in stored.files}
        _check_version(path, every)
        checks = {name.removeprefix(CHECK): int(array[0]) for name, array in every.items() if name.startswith(CHECK)}
        return make(Sidecar(path, {k: v for k, v in every.items() if not k.startswith(OWN)}, checks))
    except (OSError, *_DAMAGE) as error:
        raise HeadFileError(f"{path}: {error}", hint=hint) from error


def _check_version(path: Path, stored: Mapping[str, Array]) -> None:
    """HeadFileError for a file of a later omote; those without a version are from before there was one."""
    version = int(stored[FORMAT][0]) if FORMAT in stored else 0
    if version > VERSION:
        raise HeadFileError(f"{path}: is of version {version}, this omote reads up to {VERSION}", hint="update omote")


def write_sidecar(path: Path, arrays: Mapping[str, Array], checks: Mapping[str, int] | None = None) -> Path:
    """Keep arrays by name, all or none of them, and checksums by part; returns the file's path.

    Raises
    ------
    HeadFileError : the file cannot be written, or the disk is full.
    """
    new = path.with_suffix(".npz.new")
    packed: dict[str, Any] = {**arrays, FORMAT: np.array([VERSION], np.int64)}
    packed |= {f"{CHECK}{part}": np.array([check], np.int64) for part, check in (checks or {}).items()}
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
