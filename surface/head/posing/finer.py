"""What is kept beside a head for its meshes, for meshes that were made finer."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from surface.base.arrays import Ints
from surface.head.model.finer_mesh import FinerMesh
from surface.head.posing.baked import (
    LEVELS,
    apply_decimated,
    apply_grain,
    apply_shade,
    read_decimated,
    read_grain,
    read_shade,
    tessellation_key,
)  # fmt: skip
from surface.head.posing.fit_error import apply_fit_error, read_fit_error
from surface.head.posing.part import HeadPart
from surface.mesh.mesh import Mesh


@dataclass(frozen=True)
class Original:
    """A part as the files of a head know it: its name, and the mesh it had before."""

    name: str
    mesh: Mesh
    stored: bool = True


def coarser_of(path: str | Path, name: str, mesh: Mesh) -> Mapping[str, Ints]:
    """Return the decimated triangles (t, 3) of a part of a head in a folder, by level; none without such a file."""
    found = read_decimated(path, [Original(name, mesh)])
    return {level: found[f"{name}/{level}"].astype(np.int64) for level in LEVELS if f"{name}/{level}" in found}


def apply_baked(path: str | Path, parts: Iterable[HeadPart], refined: Mapping[str, FinerMesh]) -> None:
    """Give parts their shade, decimated triangles and fit error; ``refined`` : the parts whose meshes became finer.

    Raises HeadFileError, as the readers do.
    """
    parts = list(parts)
    known = [Original(p.name, refined[p.name].mesh) if p.name in refined else p for p in parts]
    shares, decimated = read_shade(path, known), read_decimated(path, known)
    errors, laid = read_fit_error(path, known), read_grain(path, known)
    for part in parts:
        finer = refined.get(part.name)
        if finer is None:
            continue
        for key in [key for key in shares if key == part.name or key.startswith(f"{part.name}/")]:
            shares[key] = finer.carry(shares[key])
        if part.name in decimated:
            decimated[part.name] = tessellation_key(part)
        decimated |= {f"{part.name}/{level}": t.astype(np.int32) for level, t in finer.coarser.items()}
        if part.name in errors:
            errors[part.name] = finer.carry(errors[part.name])
        if part.name in laid:
            laid[part.name] = finer.carry(laid[part.name])
    apply_shade(parts, shares)
    apply_decimated(parts, decimated)
    apply_grain(parts, laid)
    apply_fit_error(parts, errors)
