"""Decimation of a head's triangles for live pictures drawn in software, where small triangles cost more than pixels.

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
from surface.mesh.strips import strip_uv
from surface.view.draw.materials import attribute, material_of

#: Greatest root mean square error of triangles of quality "fast", mm, by material; and the share of it that each
#: quality may have.
ERROR_MM = {"skin": 0.5, "brow": 0.56, "lash": 0.42, "teeth": 0.27, "gums": 0.5, "mouth": 0.84, "eye": 0.35}
_OTHER_ERROR_MM = 0.56
SHARES = {"full": 0.36, "fast": 1.0}
#: Poses in which the error is measured.
_POSES: tuple[dict[str, float], ...] = (
    {},
    {"eyeBlinkLeft": 1, "eyeBlinkRight": 1, "mouthSmileLeft": 1, "mouthSmileRight": 1, "browInnerUp": 1},
    {"jawOpen": 1, "browDownLeft": 1, "browDownRight": 1, "noseSneerLeft": 1, "noseSneerRight": 1},
    {"mouthPucker": 1, "browOuterUpLeft": 1, "browOuterUpRight": 1, "eyeWideLeft": 1, "eyeWideRight": 1},
    {"mouthRollLower": 1, "mouthRollUpper": 1, "cheekPuff": 1, "eyeSquintLeft": 1, "eyeSquintRight": 1},
)
#: What counts as an error of so many mm: a colour that turns from black to white, a normal that turns by a radian, a
#: strand that moves across the whole width of its hair card.
_COLOUR_MM, _NORMAL_MM, _STRIP_MM = 4.0, 2.0, 1.5
_BATCH = 341  # size of the batches in which Mesa's software renderer draws triangles


def decimate_head(folder: str | Path) -> Path:
    """Decimate the triangles of the head in `folder` and keep them beside it; returns the file written.

    Raises HeadFileError: the head cannot be read.
    """
    head = Head(load_data(folder), str(folder))  # without the files beside it, which may belong to another head
    return write_decimated(folder, head.parts, decimated_triangles(head))


def decimated_triangles(head: Head) -> dict[str, np.ndarray]:
    """Decimated triangles (k, 3) of every part and level, by "PART/LEVEL"."""
    positions: dict[str, list[np.ndarray]] = {part.name: [] for part in head.parts}
    for weights in _POSES:
        head.pose(head.values(weights))
        for part in (p for p in head.parts if p.follows == "skin" or not weights):
            positions[part.name].append(part.vertices.copy())
            if part.material == "skin":  # its finest wrinkles are visible only by their shading
                positions[part.name].append(_NORMAL_MM * part.normals)
    head.pose(np.zeros(len(head.parameters)))
    out = {}
    for part in head.parts:
        collapse = Collapse(np.hstack([*positions[part.name], _appearance(part)]), part.triangles, _locked(part, head))
        for level, share in SHARES.items():
            out[f"{part.name}/{level}"] = grouped_in_patches(
                collapse.run(share * ERROR_MM.get(part.material, _OTHER_ERROR_MM))
            )
    return out


def _locked(part: HeadPart, head: Head) -> np.ndarray:
    """Vertices that must be kept, (m,) bool: those where parts meet."""
    locked = np.zeros(len(part.vertices), bool)
    for stitch in head.stitches:
        if stitch.first is part:
            locked[[*stitch.low, *stitch.high]] = True
        if stitch.second is part:
            locked[stitch.ids] = True
    return locked


def grouped_in_patches(triangles: np.ndarray) -> np.ndarray:
    """The same triangles (k, 3), ordered in connected patches of :data:`_BATCH`.

    Mesa's software renderer processes a vertex once for each patch that has it, and so again where patches meet.
    """
    corners = triangles.tolist()
    around: dict[int, list[int]] = {}  # triangles by vertex
    for t, row in enumerate(corners):
        for v in row:
            around.setdefault(v, []).append(t)
    remaining, order, rim = dict.fromkeys(range(len(corners))), [], deque[int]()
    while remaining:
        start = next((t for v in rim for t in around[v] if t in remaining), next(iter(remaining)))
        rim = deque(v for v in rim if any(t in remaining for t in around[v]))
        order += _patch(start, corners, around, remaining, rim)
    return triangles[order]


def _patch(
    start: int, corners: list[list[int]], around: dict[int, list[int]], remaining: dict[int, None], rim: deque[int]
) -> list[int]:
    """Triangles reached breadth first from ``start``, which are removed from ``remaining``; vertices at their border
    are added to ``rim``."""
    queue, seen, order = deque(corners[start]), set(corners[start]), list[int]()
    while queue and len(order) < _BATCH:
        for t in [t for t in around[queue.popleft()] if t in remaining][: _BATCH - len(order)]:
            del remaining[t]
            order.append(t)
            new = [v for v in corners[t] if v not in seen]
            seen.update(new)
            queue.extend(new)
    rim.extend(queue)
    return order


def _appearance(part: HeadPart) -> np.ndarray:
    """Colour or texture coordinates of vertices, (m, k), weighted so that differences are errors in mm."""
    if material_of(part.material).blended:
        return _STRIP_MM * strip_uv(part)
    if part.material != "skin":
        return np.zeros((len(part.vertices), 0))
    colours: np.ndarray = _COLOUR_MM * np.sqrt(attribute(part, "albedo", (0.5, 0.5, 0.5))[:, :3])
    return colours
