"""Fewer triangles for pictures in a hurry: a software renderer spends more on small triangles than on pixels.

Done once when a head is made and kept in its file; see :mod:`surface.head.posing.baked`.
"""

from __future__ import annotations

from collections import deque
from pathlib import Path

import numpy as np

from surface.head import Head, load_data
from surface.head.posing.baked import write_decimated
from surface.head.posing.part import HeadPart
from surface.mesh.collapse import Collapse
from surface.view.draw.materials import attribute, of, strip_uv

#: How far triangles of quality "fast" may be off, mm (root mean square), by material; those of "full" by this share.
ERROR_MM = {"skin": 0.5, "brow": 0.56, "lash": 0.42, "teeth": 0.2, "gums": 0.5, "mouth": 0.84, "eye": 0.35}
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
_PATCH = 341


def decimate_head(folder: str | Path) -> Path:
    """Find the decimated triangles of the head in `folder` and keep them beside it; returns the file written.

    Raises
    ------
    HeadFileError : the head cannot be read.
    """
    head = Head(load_data(folder), str(folder))  # without what stands beside it and is made for another, perhaps
    return write_decimated(folder, head.parts, decimated_triangles(head))


def decimated_triangles(head: Head) -> dict[str, np.ndarray]:
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
        collapse = Collapse(np.hstack([*places[part.name], _looks(part)]), part.triangles, _locked(part, head))
        for level, share in SHARES.items():
            found[f"{part.name}/{level}"] = gathered(collapse.run(share * ERROR_MM.get(part.material, _OTHER_MM)))
    return found


def _locked(part: HeadPart, head: Head) -> np.ndarray:
    """Vertices that stay, (m,): where parts meet, all of them."""
    locked = np.zeros(len(part.vertices), bool)
    for zipper in head.zippers:
        if zipper.first is part:
            locked[[*zipper.low, *zipper.high]] = True
        if zipper.second is part:
            locked[zipper.ids] = True
    return locked


def gathered(triangles: np.ndarray) -> np.ndarray:
    """The same triangles (k, 3), in patches of :data:`_PATCH` that hang together.

    Mesa's software renderer draws so many at a time, and works out a vertex anew for each patch that has it.
    """
    corners, around = triangles.tolist(), _around(triangles)
    left, order, rim = dict.fromkeys(range(len(corners))), [], deque[int]()
    while left:
        start = next((t for v in rim for t in around[v] if t in left), next(iter(left)))
        rim = deque(v for v in rim if any(t in left for t in around[v]))
        order += _patch(start, corners, around, left, rim)
    return triangles[order]


def _around(triangles: np.ndarray) -> dict[int, list[int]]:
    """Triangles by vertex."""
    around: dict[int, list[int]] = {}
    for t, row in enumerate(triangles.tolist()):
        for v in row:
            around.setdefault(v, []).append(t)
    return around


def _patch(
    start: int, corners: list[list[int]], around: dict[int, list[int]], left: dict[int, None], rim: deque[int]
) -> list[int]:
    """Triangles round one, nearest first, taken from those that are ``left``; vertices on their rim go to ``rim``."""
    waiting, seen, order = deque(corners[start]), set(corners[start]), list[int]()
    while waiting and len(order) < _PATCH:
        for t in [t for t in around[waiting.popleft()] if t in left][: _PATCH - len(order)]:
            del left[t]
            order.append(t)
            fresh = [v for v in corners[t] if v not in seen]
            seen.update(fresh)
            waiting.extend(fresh)
    rim.extend(waiting)
    return order


def _looks(part: HeadPart) -> np.ndarray:
    """What else a vertex carries, (m, k), as mm."""
    if of(part.material).blended:
        return _STRIP_MM * strip_uv(part)
    if part.material != "skin":
        return np.zeros((len(part.vertices), 0))
    looks: np.ndarray = _COLOUR_MM * np.sqrt(attribute(part, "albedo", (0.5, 0.5, 0.5))[:, :3])
    return looks
