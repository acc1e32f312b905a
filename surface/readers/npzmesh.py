"""Reader of meshes in the NPZ layout of ICT-FaceKit (Light)::

neutral (n, 3)   deltas (k, n, 3)   names (k,)   faces (f, 4), the last index of a triangle is -1
uv (t, 2)        face_uv (f, 4), texture coordinates per face corner; may be left out
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from surface.base.arrays import Array
from surface.base.errors import FitError
from surface.base.files import read_npz as read_npz_file
from surface.base.files import reading
from surface.readers.meshdata import MeshData, check_size

KEYS = ("neutral", "deltas", "names", "faces", "uv", "face_uv")
MAPPED = ("uv", "face_uv")


def read_npz(path: Path) -> MeshData:
    """Return a mesh in this layout; its indices are checked later, with those of all other meshes.

    Raises FitError: the file is missing or damaged, lacks a key, or holds an array of another kind or shape.
    """
    raw = _arrays(path)
    if not any(key in raw for key in MAPPED):
        raw |= {"uv": np.zeros((0, 2)), "face_uv": np.full(np.shape(raw["faces"]), -1)}
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
    if not path.exists():
        raise FitError(f"{path}: no such mesh file", hint="give the path of a .glb, .gltf, .vrm, .obj or .npz mesh")
    with reading(path, FitError, hint=f"save {', '.join(KEYS)} with numpy.savez"):
        arrays = read_npz_file(path)
    bare = not any(key in arrays for key in MAPPED)
    missing = [k for k in KEYS if k not in arrays and not (bare and k in MAPPED)]
    if missing:
        why = f"key {missing[0]!r} is missing (found: {', '.join(arrays)[:200]})"
        raise FitError(f"{path}: {why}", hint=f"the layout needs {', '.join(KEYS)}")
    return arrays
