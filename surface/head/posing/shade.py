"""Baked shade: how much sky each vertex of a head sees, kept beside the head in ``occlusion.npz``.

For some parts there is more: which way the sky lies, ``PART/visible`` (m, 4), and how thin the flesh is,
``PART/thin`` (m, 1), 0 thick.

The file belongs to one tessellation, see :mod:`surface.head.posing.order`. Parts that are tessellated in another way,
or a head without it, are drawn unshaded.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Floats32
from surface.head.model.sidecar import read_sidecar, sidecar_path, write_sidecar
from surface.head.posing.order import checksums, matching_arrays
from surface.head.posing.part import HeadPart

FILE = "occlusion.npz"
Shares = Mapping[str, NDArray[np.floating]]


def read_shade(head: str | Path, parts: Iterable[HeadPart] = ()) -> dict[str, Floats32]:
    """Shares (m, k) of each part, 0..1, by the part's name; empty where the head has no such file.

    Parameters
    ----------
    head : the head's folder or its head.toml.
    parts : what the shares are for; those of another tessellation are left out.

    Raises
    ------
    HeadFileError : the file is damaged, of a newer version, or was made for another mesh of a part.
    """
    path = shade_path(head)
    hint = f"delete {path}, or make the head again: omote fit"
    return read_sidecar(path, lambda kept: {k: _rows(v) for k, v in matching_arrays(kept, parts).items()}, hint) or {}


def write_shade(head: str | Path, shares: Shares, parts: Iterable[HeadPart] = ()) -> Path:
    """Keep shares (m, k), 0..1, of ``parts`` beside the head; returns the file's path."""
    packed = {
        name: np.rint(np.clip(np.squeeze(share), 0.0, 1.0) * 255.0).astype(np.uint8) for name, share in shares.items()
    }
    return write_sidecar(shade_path(head), packed, checksums(parts))


def apply_shade(parts: Iterable[HeadPart], shares: Shares) -> None:
    """Multiply the parts' ``occlusion`` attribute by their shares; shares of another tessellation are passed over.

    What is painted as ``occlusion_floor`` stays at least that light.
    """
    for part in parts:
        share = shares.get(part.name)
        if share is not None and share.shape == (len(part.vertices), 1):
            painted = part.attributes.get("occlusion", np.float32(1.0))
            floor = part.attributes.get("occlusion_floor", np.float32(0.0))
            part.attributes["occlusion"] = np.maximum(painted * share, floor).astype(np.float32)
        for name in ("visible", "thin"):
            more = shares.get(f"{part.name}/{name}")
            if more is not None and len(more) == len(part.vertices):
                part.attributes[name] = more


def _rows(stored: NDArray[np.uint8]) -> Floats32:
    """Bytes (m,) or (m, k) as shares (m, k)."""
    return stored.reshape(len(stored), -1).astype(np.float32) / np.float32(255)


def shade_path(head: str | Path) -> Path:
    """Where a head's shade is kept."""
    return sidecar_path(head, FILE)
