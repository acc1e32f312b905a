"""Reader of meshes in the NPZ layout of ICT-FaceKit (Light)::

neutral (n, 3)   deltas (k, n, 3)   names (k,)   faces (f, 4), the last index of a triangle is -1
uv (t, 2)        face_uv (f, 4), texture coordinates per face corner
"""

from __future__ import annotations

import struct
import tokenize
from pathlib import Path
from zipfile import BadZipFile
from zlib import error as ZlibError

import numpy as np

from surface.base.arrays import Array
from surface.base.errors import FitError
from surface.readers.meshdata import MOST_MOVES, MOST_VERTICES, MeshData, check_size

KEYS = ("neutral", "deltas", "names", "faces", "uv", "face_uv")
DAMAGED = (
    OSError, ValueError, EOFError, BadZipFile, ZlibError, KeyError, NotImplementedError, RuntimeError, struct.error,
    MemoryError, OverflowError, SyntaxError, TypeError, tokenize.TokenError, IndexError,
)  # fmt: skip


def read_npz(path: Path) -> MeshData:
    """A mesh in this layout; its indices are checked later, with those of all other meshes.

    Raises FitError: the file is missing or damaged, lacks a key, or holds an array of another kind or shape.
    """
    raw = _arrays(path)
    n, f, k, t = (len(np.atleast_1d(raw[key])) for key in ("neutral", "faces", "names", "uv"))
    shapes = {"neutral": (n, 3), "faces": (f, 4), "uv": (t, 2), "face_uv": (f, 4), "deltas": (k, n, 3), "names": (k,)}
    for key, shape in shapes.items():
        why = "" if raw[key].shape == shape else f"has shape {raw[key].shape}, expected {shape}"
        if raw[key].dtype.kind not in ("US" if key == "names" else "iu" if "face" in key else "fiu"):
            why = why or f"holds {raw[key].dtype}"
        if why:
            raise FitError(f"{path}: {key} {why}", hint="export all arrays from one mesh")
    check_size(str(path), n, k)
    with np.errstate(invalid="ignore"):
        neutral, uv, deltas = (raw[key].astype(float) for key in ("neutral", "uv", "deltas"))
    names = tuple(x.decode("utf-8", "replace") if isinstance(x, bytes) else str(x) for x in raw["names"])
    faces, face_uv = raw["faces"].astype(np.int64), raw["face_uv"].astype(np.int64)
    return MeshData(neutral, faces, uv, face_uv, names, deltas, np.zeros(f, np.int64), ("mesh",))


def _arrays(path: Path) -> dict[str, Array]:
    if not path.is_file():
        raise FitError(f"{path}: no such mesh file", hint="give the path of a .glb, .gltf, .obj or .npz mesh")
    try:
        with path.open("rb") as f:
            if f.read(2) != b"PK":
                raise FitError(f"{path}: is no .npz archive", hint=f"save {', '.join(KEYS)} with numpy.savez")
            f.seek(0)
            with np.load(f, allow_pickle=False) as z:
                missing = [k for k in KEYS if k not in z.files]
                if missing:
                    why = f"key {missing[0]!r} is missing (found: {', '.join(z.files)})"
                    raise FitError(f"{path}: {why}", hint=f"the layout needs {', '.join(KEYS)}")
                _check_declared_sizes(path, z)
                return {k: z[k] for k in KEYS}
    except DAMAGED as e:
        raise FitError(f"{path}: cannot be read as .npz ({type(e).__name__}: {e})", hint="save the mesh again") from e


def _check_declared_sizes(path: Path, archive: np.lib.npyio.NpzFile) -> None:
    """Refuse arrays that would not fit into memory before they are unpacked."""
    for info in archive.zip.infolist() if archive.zip is not None else []:
        if info.file_size > 24 * (MOST_MOVES + MOST_VERTICES):
            raise FitError(f"{path}: {info.filename} is {info.file_size / 1e9:.1f} GB", hint="decimate the mesh first")
