"""Materials of an exported OBJ: colours, and pictures in a folder of their own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from surface.export.shapes import ExportPart
from surface.export.textures import eye_column, materials, png_bytes
from surface.readers.meshdata import kind_of_picture, srgb


class ObjMaterials:
    """The materials of parts, in the order in which they are first used.

    names : of each part's material. pictures : whole files that lie beside the OBJ, by name.
    """

    def __init__(self, parts: Sequence[ExportPart]) -> None:
        self.names = list[str]()
        self.pictures: dict[str, bytes] = {}
        self._shown: dict[str, tuple[str, str | None, list[ExportPart]]] = {}
        files = dict[bytes, str]()
        for part in parts:
            picture = _picture_of(part)
            if picture and picture not in files:
                word = f"{part.material}_{len(files) + 1}" if files else part.material
                files[picture] = f"{word}.{kind_of_picture(picture).removeprefix('image/')}"
                self.pictures[files[picture]] = picture
            self.names.append(self._name(part, files[picture] if picture else None))

    def _name(self, part: ExportPart, file: str | None) -> str:
        """The name of a part's material, which parts of one kind with the same picture share."""
        for name, (kind, own, parts) in self._shown.items():
            if (kind, own) == (part.material, file) and (part.worn is None or part.worn is parts[0].worn):
                parts.append(part)
                return name
        same = sum(kind == part.material for kind, _, _ in self._shown.values())
        name = f"{part.material}_{same + 1}" if same else part.material
        self._shown[name] = part.material, file, [part]
        return name

    def lines(self, folder: str) -> list[str]:
        """The lines of the MTL, whose pictures lie in ``folder`` beside it."""
        out = []
        for name, (kind, file, parts) in self._shown.items():
            table = materials().get(kind, materials()["skin"])
            colour = " ".join(f"{c:.4f}" for c in _colour(table, parts, textured=file is not None))
            out += [f"newmtl {name}", f"Kd {colour}", f"Ns {1000 * (1 - table['roughness']) ** 2:.1f}"]
            out += [f"map_Kd {folder}/{file}"] if file else []
            worn = parts[0].worn
            if worn is not None and worn.alpha != "OPAQUE":
                out += [f"map_d {folder}/{file}"] if file else [f"d {worn.colour[3]:.4f}"]
            out += ["illum 2", ""]
        return out


def _picture_of(part: ExportPart) -> bytes:
    """The picture that a part shows; empty without one."""
    if part.worn is not None:
        return part.worn.texture
    if part.texture is not None:
        return part.texture.picture
    return png_bytes(eye_column(part)) if "texture" in materials().get(part.material, {}) else b""


def _colour(table: dict[str, Any], parts: Sequence[ExportPart], *, textured: bool) -> list[float]:
    """The display colour of parts, sRGB: white under a picture, the mean of what is painted, or that of the table."""
    worn, painted = parts[0].worn, [p.colours for p in parts if p.colours is not None]
    if worn is not None:
        colour = np.array(worn.colour[:3], float)
    elif textured:
        colour = np.ones(3)
    elif painted:
        colour = np.concatenate(painted).mean(axis=0, dtype=float)
    else:
        colour = np.array(table["colour"], float)
    return [float(c) for c in srgb(np.clip(colour, 0.0, 1.0))]
