"""Fewer triangles for pictures in a hurry: a software renderer spends more on small triangles than on pixels.

Done once when a head is made and kept in its file; see :mod:`surface.head.lean`.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from surface.collapse import Collapse
from surface.head.part import border_edges
from surface.view import materials
from surface.view.materials import attribute, strip_uv

if TYPE_CHECKING:
    from surface.head import Head
    from surface.head.part import HeadPart

#: How far triangles of quality "fast" may be off, mm (root mean square), by material; those of "full" by this share.
ERROR_MM = {"skin": 0.5, "brow": 0.56, "lash": 0.42, "teeth": 0.5, "gums": 0.7, "mouth": 0.84, "eye": 0.35}
_OTHER_MM = 0.56
SHARES = {"full": 0.36, "fast": 1.0}
#: Poses whose shapes are kept, beside the face at rest.
_KEPT: tuple[dict[str, float], ...] = (
    {},
    {"eyeBlinkLeft": 1, "eyeBlinkRight": 1, "mouthSmileLeft": 1, "mouthSmileRight": 1, "browInnerUp": 1},
    {"jawOpen": 1, "browDownLeft": 1, "browDownRight": 1, "noseSneerLeft": 1, "noseSneerRight": 1},
    {"mouthPucker": 1, "browOuterUpLeft": 1, "browOuterUpRight": 1, "eyeWideLeft": 1, "eyeWideRight": 1},
    {"mouthRollLower": 1, "mouthRollUpper": 1, "cheekPuff": 1, "eyeSquintLeft": 1, "eyeSquintRight": 1},
)
#: A change of colour from black to white counts as so many mm, a normal turned by a radian, and one strip of hair.
_COLOUR_MM, _NORMAL_MM, _STRIP_MM = 4.0, 2.0, 1.5


def lean_head(folder: str | Path) -> Path:
    """Find the lean triangles of the head in `folder` and keep them beside it; returns the file written.

    Raises
    ------
    HeadFileError : the head cannot be read.
    """
    from surface.head import Head
    from surface.head.lean import lean_path, write_lean

    lean_path(folder).unlink(missing_ok=True)  # a damaged one would be refused
    head = Head.load(folder)
    return write_lean(folder, head.parts, lean_triangles(head))


def lean_triangles(head: Head) -> dict[str, np.ndarray]:
    """Fewer triangles (k, 3), by "PART/LEVEL"."""
    places: dict[str, list[np.ndarray]] = {part.name: [] for part in head.parts}
    for shapes in _KEPT:
        head.pose(head.values(shapes))
        for part in (p for p in head.parts if p.follows == "skin" or not shapes):
            places[part.name].append(part.vertices.copy())
            if part.material == "skin":  # its finest wrinkles show by their shading alone
                places[part.name].append(_NORMAL_MM * part.normals)
    head.pose(np.zeros(len(head.parameters)))
    found = {}
    for part in head.parts:
        collapse = Collapse(np.hstack([*places[part.name], _looks(part)]), part.triangles, _locked(part))
        for level, share in SHARES.items():
            found[f"{part.name}/{level}"] = collapse.run(share * ERROR_MM.get(part.material, _OTHER_MM))
    return found


def _locked(part: HeadPart) -> np.ndarray:
    """Vertices that stay, (m,): where parts meet, all of them."""
    locked = np.zeros(len(part.vertices), bool)
    if not materials.of(part.material).blended:
        locked[np.unique(border_edges(part.triangles))] = True
    return locked


def _looks(part: HeadPart) -> np.ndarray:
    """What else a vertex carries, (m, k), as mm."""
    if materials.of(part.material).blended:
        return _STRIP_MM * strip_uv(part)
    if part.material != "skin":
        return np.zeros((len(part.vertices), 0))
    return _COLOUR_MM * np.sqrt(attribute(part, "albedo", (0.5, 0.5, 0.5))[:, :3])
