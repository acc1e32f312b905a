"""Drawing of a head's decimated triangles: one set of buffers for all parts of a program, one draw call for all parts
with the same uniforms."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from surface.head import Head
from surface.head.posing.decimated_head import DecimatedHead, DecimatedPart
from surface.view.draw import materials
from surface.view.draw.evaluator import Evaluator
from surface.view.scene.openings import Openings
from surface.view.scene.parts import PartBuffers, ViewPart

if TYPE_CHECKING:
    import moderngl


class DecimatedEvaluator(Evaluator):
    """Evaluates only the vertices that are drawn, see :class:`surface.head.posing.decimated_head.DecimatedHead`.

    head : its parts have decimated triangles.
    level : "full" or "fast". openings : whose vertices are evaluated, too. reason : why it was chosen.
    """

    def __init__(self, head: Head, level: str, openings: Openings, reason: str) -> None:
        parts = sorted(head.parts, key=lambda part: materials.material_of(part.material).order)
        self.reason, self.decimated = reason, DecimatedHead(head, parts, level, openings.read_vertices())
        self._parts = {decimated.part.name: decimated for decimated in self.decimated.parts}
        self._rows: dict[tuple[str, int], tuple[np.ndarray, np.ndarray]] = {}

    def pose(self, values: np.ndarray) -> None:
        self.decimated.pose(values)

    def positions(self, part: ViewPart, ids: np.ndarray) -> np.ndarray:
        key = part.name, id(ids)
        if key not in self._rows:
            self._rows[key] = ids, self._parts[part.name].rows(ids)  # keeps ids, so that their id stays theirs
        positions: np.ndarray = self.decimated.vertices[self._rows[key][1]]
        return positions

    def rotation(self) -> np.ndarray:
        return self.decimated.turn

    @property
    def lips_closed(self) -> bool:
        return self.decimated.lips_closed


class JoinedParts:
    """Neighbouring parts of a decimated head that one program draws, as one part.

    triangles : (t, 3) int32 of the joined vertices.
    """

    uv, attributes = np.zeros((0, 2), np.float32), dict[str, np.ndarray]()  # their static data is given apart

    def __init__(self, decimated: DecimatedHead, parts: Sequence[DecimatedPart]) -> None:
        self._decimated, self._parts = decimated, parts
        self.name, self.material = parts[0].part.name, parts[0].part.material
        self._first, self._rows = parts[0].first, slice(parts[0].first, parts[-1].last)
        self.triangles: np.ndarray = np.vstack([p.triangles + (p.first - self._first) for p in parts])

    @property
    def vertices(self) -> np.ndarray:
        """Positions now, (m, 3) float32."""
        return self._decimated.vertices[self._rows]

    @property
    def normals(self) -> np.ndarray:
        """Normals now, (m, 3) float32."""
        return self._decimated.normals[self._rows]

    @property
    def changed(self) -> list[tuple[int, int]]:
        """Ranges [start, stop) of vertices that the last pose changed."""
        return [(p.first - self._first + a, p.first - self._first + b) for p in self._parts for a, b in p.changed]


class DrawCall:
    """Consecutive parts in shared buffers with the same uniforms, drawn at once.

    Parameters
    ----------
    first : number of their first triangle in the buffers. owner : whether it uploads and releases the buffers.

    Attributes
    ----------
    part : one of them. triangles : (t, 3) that are drawn, of the buffers' vertices.
    """

    def __init__(self, buffers: PartBuffers, parts: Sequence[DecimatedPart], first: int, *, owner: bool) -> None:
        self._buffers, self._first, self._owner = buffers, first, owner
        self.part: ViewPart = parts[0].part
        self.triangles = buffers.triangles[first : first + sum(len(p.triangles) for p in parts)]

    def upload(self) -> int:
        """Send what the last pose changed, of all parts in the buffers; returns how many vertices were sent."""
        return self._buffers.upload() if self._owner else 0

    def outline(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions now (m, 3) and the triangles drawn of them (t, 3)."""
        return self._buffers.part.vertices, self.triangles

    def draw(self) -> None:
        """Draw the triangles with the buffers' program."""
        self._buffers.draw(self._first, len(self.triangles))

    def release(self) -> None:
        """Release the buffers."""
        if self._owner:
            self._buffers.release()


def draw_calls(
    ctx: moderngl.Context,
    decimated: DecimatedHead,
    programs: Mapping[str, moderngl.Program],
    static: Callable[[ViewPart], Mapping[str, np.ndarray]],
) -> list[DrawCall]:
    """Draw calls of a decimated head, in the order in which it is drawn; ``static`` as in :class:`PartBuffers`."""
    calls = []
    for name, group in groupby(decimated.parts, lambda p: materials.material_of(p.part.material).program):
        parts = list(group)
        if not any(len(p.triangles) for p in parts):  # clothes hide them
            continue
        rows = [{key: data[p.kept] for key, data in static(p.part).items()} for p in parts]
        joined = {key: np.concatenate([each[key] for each in rows]) for key in rows[0]}
        buffers = PartBuffers(ctx, JoinedParts(decimated, parts), programs[name], joined)
        first, owner = 0, True
        for _, alike in groupby(parts, lambda p: materials.uniforms_key(p.part)):
            calls.append(DrawCall(buffers, list(alike), first, owner=owner))
            owner = False  # the first may have no triangles: clothes hide them
            first += len(calls[-1].triangles)
    return calls
