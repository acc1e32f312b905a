"""Read and write .npz files that lie beside a head's own: baked shade, decimated triangles and identities."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from surface.base.arrays import Array, Floats32
from surface.base.errors import HeadFileError
from surface.base.files import read_npz, reading

Made = TypeVar("Made")
VERSION = 1
META = "omote/"  # keys that begin so are about the file, the others are its arrays
FORMAT, CHECK = f"{META}format", f"{META}checksum/"
DAMAGED = (ValueError, TypeError, ArithmeticError, LookupError)
"""What reading arrays that are not as they should be may raise."""


def sidecar_path(head: str | Path, file: str) -> Path:
    """Return the path of ``file`` beside a head, which is given by its folder or its head.toml."""
    folder = Path(head)
    return (folder.parent if folder.suffix == ".toml" else folder) / file


@dataclass(frozen=True)
class Sidecar:
    """Contents of such a file: arrays by name, and checksums of each part's mesh (none in files without them)."""

    path: Path
    arrays: dict[str, Array]
    checks: dict[str, int]


def read_sidecar(path: Path, make: Callable[[Sidecar], Made], hint: str) -> Made | None:
    """Return ``make`` of the file's contents; None where there is no such file. A file without a version is read.

    Raises HeadFileError: the file is damaged or of a newer version, or ``make`` raised one of :data:`DAMAGED`.
    """
    if not path.exists():
        return None
    try:
        with reading(path, HeadFileError, hint):
            every = read_npz(path)
        version = int(every[FORMAT][0]) if FORMAT in every else 0
        if version > VERSION:
            why = f"is of version {version}, this omote reads up to {VERSION}"
            raise HeadFileError(f"{path}: {why}", hint="update omote")
        checks = {name.removeprefix(CHECK): int(array[0]) for name, array in every.items() if name.startswith(CHECK)}
        return make(Sidecar(path, {k: v for k, v in every.items() if not k.startswith(META)}, checks))
    except DAMAGED as error:
        raise HeadFileError(f"{path}: {reason(error)}", hint=hint) from error


def numbers(arrays: Mapping[str, Array], key: str, shape: tuple[int, ...], most: float) -> Floats32:
    """Return the numbers of an array; -1 in the ``shape`` is any length. ``most`` : none is as large, either way.

    Raises KeyError: there is no such array. ValueError: it has another shape, or holds what is no such number.
    """
    found = arrays[key]
    if found.ndim != len(shape) or any(w not in (-1, g) for g, w in zip(found.shape, shape, strict=True)):
        raise ValueError(f"{key} has shape {found.shape}, expected {shape}".replace("-1", "any"))
    if found.dtype.kind not in "fiu" or not (np.abs(found) < most).all():
        raise ValueError(f"{key} holds what is no number of usable size")
    return np.ascontiguousarray(found, np.float32)


def reason(error: Exception) -> str:
    """Return what is wrong with arrays, in words for who has the file; those of the interpreter name nothing in it."""
    if isinstance(error, KeyError):
        return f"has no array {error}"
    own = type(error) is ValueError
    return str(error) if own else "holds an array of another shape or kind than it was written with"


def write_sidecar(path: Path, arrays: Mapping[str, Array], checks: Mapping[str, int] | None = None) -> Path:
    """Write arrays by name, all or none of them, and checksums by part; returns the file's path.

    Raises HeadFileError: the file cannot be written, or the disk is full.
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
