"""Texture of a head's skin and eyes, as the mesh brought it that the head was made from (``texture.npz``).

One picture holds all of it. Each part of the skin has a rectangle in it for each of its tiles of (u, v), which lie
:data:`TILE` apart in u and are one wide and high. So the picture fits every tessellation of the parts. An eyeball has
one rectangle, in which it is seen from the front, a radius of it to each side.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from surface.base.arrays import Array, Floats32
from surface.head.model.accessories import PICTURES
from surface.head.model.sidecar import Sidecar, numbers, read_sidecar, sidecar_path, write_sidecar

FILE = "texture.npz"
PICTURE, COLOUR, TILES = "picture", "colour", "tiles/"
TILE = 2.0
"""Distance in u between two tiles of a part, whose own (u, v) are 0 to 1."""
BESIDE = 0.5  # half of the gap between two tiles: what rounding puts beside one is not in the next
LARGE = 1e3  # no rectangle reaches further, in pictures
HINT = "delete the file, and skin and irises are drawn in one colour, or make the head again: omote fit"


@dataclass(frozen=True)
class HeadTexture:
    """A texture.

    picture : a whole PNG or JPEG file of sRGB colours. Its first texel, and some around it, have ``colour``.
    colour : linear RGB of a texel that leaves the skin as it is painted: others change it by their ratio to this one,
        so that a person's own tone of skin keeps what the texture draws on it.
    tiles : (k, 4) by part, one row for an eye, left, top, right and bottom of each tile's rectangle, 0..1 to the right
        and down, as v runs. It may reach beyond the picture, and a part beyond it: some have (u, v) beside the tile.
    """

    picture: bytes
    colour: tuple[float, float, float]
    tiles: Mapping[str, Floats32]

    def places(self, part: str, uv: Array) -> Floats32:
        """Return where in the picture a part's ``uv`` (m, 2) lie, (m, 2) 0..1 to the right and down; the first texel,
        0, for a part without rectangles."""
        rows = self.tiles.get(part)
        if rows is None:
            return np.zeros((len(uv), 2), np.float32)
        at = np.asarray(uv, np.float64)
        tile = np.clip(np.floor((at[:, 0] + BESIDE) / TILE), 0, len(rows) - 1).astype(int)
        left, top, right, bottom = rows[tile].T
        across = left + (at[:, 0] - TILE * tile) * (right - left)
        return np.column_stack([across, top + at[:, 1] * (bottom - top)]).astype(np.float32)


def read_texture(head: str | Path) -> HeadTexture | None:
    """Return the texture of a head's skin, given by its folder or its head.toml; None where it has no such file.

    Raises HeadFileError: the file is damaged or of a newer version.
    """
    return read_sidecar(sidecar_path(head, FILE), _unpack, HINT)


def write_texture(head: str | Path, texture: HeadTexture | None) -> Path | None:
    """Write a texture to a head's folder, or remove that of the head before where there is none; returns the file's
    path. Raises HeadFileError: it cannot be written."""
    path = sidecar_path(head, FILE)
    if texture is None:
        path.unlink(missing_ok=True)
        return None
    rows: dict[str, Array] = {f"{TILES}{part}": np.asarray(r, np.float32) for part, r in texture.tiles.items()}
    rows[PICTURE], rows[COLOUR] = np.frombuffer(texture.picture, np.uint8), np.array(texture.colour, np.float32)
    return write_sidecar(path, rows)


def _unpack(file: Sidecar) -> HeadTexture:
    """Return the texture of a file. Raises ValueError or KeyError: it is damaged."""
    picture, colour = file.arrays[PICTURE], numbers(file.arrays, COLOUR, (3,), LARGE)
    if picture.ndim != 1 or picture.dtype != np.uint8 or not picture.tobytes().startswith(tuple(PICTURES)):
        raise ValueError(f"{PICTURE} is neither PNG nor JPEG")
    if not ((colour > 0.0) & (colour <= 1.0)).all():
        raise ValueError(f"{COLOUR} is no colour: {colour.tolist()}")
    names = [key for key in file.arrays if key.startswith(TILES)]
    tiles = {key.removeprefix(TILES): numbers(file.arrays, key, (-1, 4), LARGE) for key in names}
    if not all(map(len, tiles.values())):
        raise ValueError("names a part without rectangles")
    red, green, blue = colour.tolist()
    return HeadTexture(picture.tobytes(), (red, green, blue), tiles)
