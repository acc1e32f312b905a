"""Reader of the colours of Wavefront MTL files beside an OBJ.

Nothing in them refuses a mesh: what is damaged is left out.

Read are ``newmtl``, ``Kd`` (linear RGB, as Blender writes it), ``d`` and ``Tr`` (opacity), and ``map_Kd``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from surface.base.errors import FitError
from surface.readers.meshdata import OTHER_PICTURE, Material, kind_of_picture, read_bytes

MAX_SHOWN = 80  # letters of a name in a message, the last ones


def read_mtl(folder: Path, names: str) -> dict[str, Material]:
    """Return materials by name, of the file or files that a line ``mtllib`` names; none where they cannot be read."""
    out: dict[str, dict[str, Any]] = {}
    one = _lines(folder, names)
    for text in one if one is not None else [t for n in names.split() for t in _lines(folder, n) or []]:
        word, _, rest = text.strip().partition(" ")
        if word == "newmtl":
            out[rest.strip()] = {}
        elif out:
            _take(list(out.values())[-1], word.lower(), rest.strip())
    return {name: _material(folder, name, row) for name, row in out.items()}


def picture_beside(folder: Path, name: str) -> tuple[bytes | None, str]:
    """Return a PNG, JPEG or WebP file in the folder, and its MIME type; None and "" where there is none of that
    name.
    """
    data = _data(folder, name)
    mime = kind_of_picture(data or b"")
    return (data, mime) if mime else (None, "")


def _path_beside(folder: Path, name: str) -> Path | None:
    """Return the path of a file in the folder or below it; None for any other."""
    relative = Path(name.replace("\\", "/"))
    inside = name and "\0" not in name and not relative.is_absolute() and ".." not in relative.parts
    return folder / relative if inside else None


def _data(folder: Path, name: str) -> bytes | None:
    path = _path_beside(folder, name)
    try:
        return read_bytes(path) if path is not None and path.is_file() else None
    except (FitError, OSError, ValueError):
        return None


def _lines(folder: Path, name: str) -> list[str] | None:
    data = _data(folder, name.strip())
    return None if data is None else data.decode("utf-8", "replace").splitlines()


def _take(row: dict[str, Any], word: str, rest: str) -> None:
    """Note what one line says of a material."""
    if word == "map_kd":
        row["texture"] = rest
    elif word in ("kd", "d", "tr"):
        try:
            numbers = [min(max(float(x), 0.0), 1.0) for x in rest.split()]
        except ValueError:
            return
        if word == "kd" and len(numbers) >= 3:
            row["colour"] = numbers[:3]
        elif word != "kd" and numbers:
            row["alpha"] = numbers[0] if word == "d" else 1.0 - numbers[0]


def _material(folder: Path, name: str, row: dict[str, Any]) -> Material:
    """Return a material; a texture replaces the colour, which many programs write as grey beside it."""
    named = row.get("texture", "")
    data = _data(folder, named) or _data(folder, (named.split() or [""])[-1])
    mime = kind_of_picture(data or b"")
    r, g, b = (1.0, 1.0, 1.0) if mime else row.get("colour", (1.0, 1.0, 1.0))
    alpha, lost = (
        row.get("alpha", 1.0),
        f"{OTHER_PICTURE} beside the mesh: {named[-MAX_SHOWN:]}" * bool(named and not mime),
    )
    return Material(
        name, (r, g, b, alpha), data if mime else None, mime, "BLEND" if alpha < 1.0 else "OPAQUE", lost=lost
    )  # fmt: skip
