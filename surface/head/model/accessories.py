"""Accessories of a head: hair, hats, glasses and jewellery that are drawn as the meshes they are (``accessories.npz``).

They are no surfaces of control points: triangles with a texture, which turn with the head and move with nothing else.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Array, Floats32
from surface.base.errors import HeadFileError
from surface.head.model.sidecar import DAMAGED, Sidecar, numbers, read_sidecar, reason, sidecar_path, write_sidecar

FILE = "accessories.npz"
KINDS = ("hair", "hat", "glasses", "jewellery")
ALPHA = ("OPAQUE", "MASK", "BLEND")
PICTURES = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg"}
"""Kinds of pictures that may be a texture, by their first bytes: those that every reader of glTF knows."""
MAX_ACCESSORIES, MAX_NAME = 256, 256  # accessories of a head, and letters of a name
MAX_VERTICES, MAX_TRIANGLES = 400_000, 1_000_000  # of one accessory
LARGE_MM = 1e5  # no vertex lies further out
TABLES = ("names", "kinds", "alphas", "colours", "cutoffs", "two_sided")
"""Arrays with a row for each accessory."""
HINT = "restore the file or make the head again: omote fit"


@dataclass(frozen=True)
class Accessory:
    """One mesh that is drawn as it is.

    name : of the piece of the mesh that it was. kind : one of :data:`KINDS`.
    vertices, normals : (m, 3) float32, mm in head space, at rest. uv : (m, 2) float32, places in the texture, 0..1 to
        the right and down; it repeats beyond that. triangles : (t, 3) int32, counter-clockwise from outside.
    colour : linear RGB and opacity, by which the texture's are multiplied. texture : a whole PNG or JPEG file of sRGB
        colours; empty without one.
    shade : (m,) float32, how open to light each vertex lies, 0..1.
    alpha : ``OPAQUE``, ``MASK`` (nothing below ``cutoff`` is drawn) or ``BLEND``. two_sided : are backs drawn?
    outside : (k, 3) int32, the sides of triangles that can be seen from anywhere around the head, counter-clockwise
        there; None where that is not known.
    """

    name: str
    kind: str
    vertices: Floats32
    normals: Floats32
    uv: Floats32
    triangles: NDArray[np.int32]
    shade: Floats32
    colour: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    texture: bytes = b""
    alpha: str = "OPAQUE"
    cutoff: float = 0.5
    two_sided: bool = True
    outside: NDArray[np.int32] | None = None

    @property
    def repeats(self) -> bool:
        """Whether the texture repeats on it: one that does not must not show its left edge at its right."""
        return bool((self.uv < 0.0).any() or (self.uv > 1.0).any())

    @property
    def mime(self) -> str:
        """The texture's kind, as ``image/png``; "" without one."""
        return next((kind for start, kind in PICTURES.items() if self.texture.startswith(start)), "")


def read_accessories(head: str | Path) -> tuple[Accessory, ...]:
    """Return the accessories of a head, given by its folder or its head.toml; none where it has no such file.

    Raises HeadFileError: the file is damaged or of a newer version.
    """
    return read_sidecar(sidecar_path(head, FILE), _unpack, HINT) or ()


def write_accessories(head: str | Path, accessories: Sequence[Accessory]) -> Path | None:
    """Write accessories to a head's folder, or remove those of the head that it held before; returns the file's path,
    None where there is nothing to write.

    Raises HeadFileError: it cannot be written, or could not be read again; the file stays as it was.
    """
    path = sidecar_path(head, FILE)
    if not accessories:
        path.unlink(missing_ok=True)
        return None
    if fault := fault_of(*accessories):
        raise HeadFileError(f"{path}: could not be read again: {fault}", hint="leave it out: omote fit --without NAME")
    return write_sidecar(path, _packed(accessories))


def fault_of(*accessories: Accessory) -> str:
    """Return why a head that wears them could not be read, "" where nothing is wrong."""
    try:
        _unpack(Sidecar(Path(FILE), _packed(accessories), {}))
    except DAMAGED as error:
        return reason(error)
    return ""


def _packed(accessories: Sequence[Accessory]) -> dict[str, Array]:
    """Return the arrays of a file."""
    rows: dict[str, Array] = {
        "names": np.array([a.name for a in accessories]), "kinds": np.array([a.kind for a in accessories]),
        "alphas": np.array([a.alpha for a in accessories]),
        "colours": np.array([a.colour for a in accessories], np.float32),
        "cutoffs": np.array([a.cutoff for a in accessories], np.float32),
        "two_sided": np.array([a.two_sided for a in accessories], np.uint8),
    }  # fmt: skip
    for k, one in enumerate(accessories):
        rows |= {f"{k}/{key}": getattr(one, key) for key in ("vertices", "normals", "uv", "triangles", "shade")}
        rows[f"{k}/texture"] = np.frombuffer(one.texture, np.uint8)
        if one.outside is not None:
            rows[f"{k}/outside"] = one.outside
    return rows


def _unpack(file: Sidecar) -> tuple[Accessory, ...]:
    """Return the accessories of a file. Raises ValueError or KeyError: it is damaged."""
    z = file.arrays
    names, kinds, alphas = (_words(z, key) for key in TABLES[:3])
    count = len(names)
    colours = numbers(z, "colours", (count, 4), LARGE_MM)
    cutoffs, two_sided = (numbers(z, key, (count,), LARGE_MM) for key in ("cutoffs", "two_sided"))
    for key, words, known in (("kinds", kinds, KINDS), ("alphas", alphas, ALPHA)):
        if len(words) != count or not set(words) <= set(known):
            raise ValueError(f"{key} is no list of {count} of {', '.join(known)}")
    found = list[Accessory]()
    for k, name in enumerate(names):
        try:
            rest = _texture(z, k), alphas[k], float(cutoffs[k]), bool(two_sided[k])
            found.append(Accessory(name, kinds[k], *_mesh(z, k), _colour(colours[k]), *rest, _outside(z, k)))
        except ValueError as error:
            raise ValueError(f"{name!r}: {error}") from error
    return tuple(found)


def _colour(row: Floats32) -> tuple[float, float, float, float]:
    r, g, b, a = row.tolist()
    return r, g, b, a


def _words(arrays: Mapping[str, Array], key: str) -> list[str]:
    words = arrays[key]
    if words.ndim != 1 or words.dtype.kind != "U":
        raise ValueError(f"{key} is no list of words")
    if len(words) > MAX_ACCESSORIES:
        raise ValueError(f"{key} are {len(words)}, {MAX_ACCESSORIES} are the most")
    if words.itemsize > 4 * MAX_NAME:  # 4 bytes a letter
        raise ValueError(f"{key} have {words.itemsize // 4} letters, {MAX_NAME} are the most")
    return [str(word) for word in words]


def _mesh(arrays: Mapping[str, Array], k: int) -> tuple[Floats32, Floats32, Floats32, NDArray[np.int32], Floats32]:
    """Return vertices, normals, texture coordinates, triangles and shade of one accessory."""
    vertices = numbers(arrays, f"{k}/vertices", (-1, 3), LARGE_MM)
    m = len(vertices)
    if m > MAX_VERTICES:
        raise ValueError(f"{k}/vertices holds {m} vertices, {MAX_VERTICES} are the most")
    normals, uv = numbers(arrays, f"{k}/normals", (m, 3), LARGE_MM), numbers(arrays, f"{k}/uv", (m, 2), LARGE_MM)
    triangles = _triangles(arrays, f"{k}/triangles", m, MAX_TRIANGLES)
    if not len(triangles):
        raise ValueError(f"{k}/triangles is empty")
    return vertices, normals, uv, triangles, numbers(arrays, f"{k}/shade", (m,), LARGE_MM)


def _outside(arrays: Mapping[str, Array], k: int) -> NDArray[np.int32] | None:
    key = f"{k}/outside"
    return _triangles(arrays, key, len(arrays[f"{k}/vertices"]), 2 * MAX_TRIANGLES) if key in arrays else None


def _triangles(arrays: Mapping[str, Array], key: str, vertices: int, most: int) -> NDArray[np.int32]:
    """Return triangles (k, 3) of so many vertices, ``most`` of them at most."""
    triangles = arrays[key]
    if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.dtype.kind not in "iu":
        raise ValueError(f"{key} is no table of triangles")
    if len(triangles) > most:
        raise ValueError(f"{key} holds {len(triangles)} triangles, {most} are the most")
    if triangles.min(initial=0) < 0 or triangles.max(initial=0) >= vertices:
        raise ValueError(f"{key} names vertices beyond the {vertices} there are")
    return np.ascontiguousarray(triangles, np.int32)


def _texture(arrays: Mapping[str, Array], k: int) -> bytes:
    data = arrays[f"{k}/texture"]
    if data.ndim != 1 or data.dtype != np.uint8:
        raise ValueError(f"{k}/texture is no picture")
    texture = data.tobytes()
    if texture and not texture.startswith(tuple(PICTURES)):
        raise ValueError(f"{k}/texture is neither PNG nor JPEG")
    return texture
