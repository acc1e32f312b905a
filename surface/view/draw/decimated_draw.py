"""Drawing a head in a hurry: one set of buffers for all parts of a program, one draw for all that are told the same."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from surface.head import Head
from surface.head.posing.decimated_head import DecimatedHead, DecimatedPart
from surface.view.draw import materials
from surface.view.scene.openings import Openings
from surface.view.scene.parts import Moving, ViewPart, static_buffers

if TYPE_CHECKING:
    import moderngl

Ranges = Sequence[tuple[int, int]]


class DecimatedEvaluator:
    """The head's own engine for what is drawn of it, see :class:`surface.head.posing.decimated_head.DecimatedHead`.

    Parameters
    ----------
    head : its parts have decimated triangles.
    level : "full" or "fast". openings : whose vertices are read, too. reason : why it was chosen.
    """

    name = "cpu"

    def __init__(self, head: Head, level: str, openings: Openings, reason: str) -> None:
        parts = sorted(head.parts, key=lambda part: materials.order(part.material))
        self.reason, self.decimated = reason, DecimatedHead(head, parts, level, openings.read_vertices())
        self._of = {decimated.part.name: decimated for decimated in self.decimated.parts}
        self._rows: dict[tuple[str, int], tuple[np.ndarray, np.ndarray]] = {}

    def pose(self, values: np.ndarray) -> None:
        self.decimated.pose(values)

    def positions(self, part: ViewPart, ids: np.ndarray) -> np.ndarray:
        key = part.name, id(ids)
        if key not in self._rows:
            self._rows[key] = ids, self._of[part.name].rows(ids)
        positions: np.ndarray = self.decimated.vertices[self._rows[key][1]]
        return positions

    def rotation(self) -> np.ndarray:
        return self.decimated.turn

    def update(self, drawn: Sequence[Any]) -> int:
        return sum(one.upload() for one in drawn)

    def release(self) -> None:
        pass


class DecimatedBuffers:
    """Buffers of all parts that one program draws, one after the other.

    Parameters
    ----------
    parts : neighbours in the decimated head. static : per-vertex data of a part that never changes, by shader input.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        decimated: DecimatedHead,
        parts: Sequence[DecimatedPart],
        program: moderngl.Program,
        static: Callable[[DecimatedPart], Mapping[str, np.ndarray]],
    ) -> None:
        self._parts, self._rows = parts, slice(parts[0].first, parts[-1].last)
        self._decimated, self.triangles = (
            decimated,
            np.vstack([p.triangles + (p.first - parts[0].first) for p in parts]),
        )
        each = [{name: data[p.kept] for name, data in static(p).items()} for p in parts]
        together = {name: np.concatenate([data[name] for data in each]) for name in each[0]}
        self._static, content = static_buffers(ctx, together)
        self._moving = Moving(ctx, self._rows.stop - self._rows.start)
        self._index = ctx.buffer(np.ascontiguousarray(self.triangles, np.int32).tobytes())
        kept = [entry for entry in (*content, *self._moving.content) if entry[2] in program]
        self.array = ctx.vertex_array(program, kept, index_buffer=self._index, index_element_size=4)
        self.upload(whole=True)

    @property
    def vertices(self) -> np.ndarray:
        """Positions now, (m, 3) float32."""
        return self._decimated.vertices[self._rows]

    def upload(self, *, whole: bool = False) -> int:
        """Send what the last pose changed; returns how many vertices were sent."""
        first = self._rows.start
        ranges = [(p.first - first + a, p.first - first + b) for p in self._parts for a, b in p.changed]
        if whole:
            ranges = [(0, self._rows.stop - first)]
        return self._moving.upload(self.vertices, self._decimated.normals[self._rows], ranges)

    def release(self) -> None:
        """Give the buffers back."""
        self.array.release()
        self._moving.release()
        for buffer in (self._index, *self._static):
            buffer.release()


class DecimatedDrawn:
    """Some of the buffers' parts, drawn at once: they stand together and are told the same.

    Attributes
    ----------
    part : one of them. triangles : (t, 3) that are drawn, of the buffers' vertices.
    """

    def __init__(self, buffers: DecimatedBuffers, parts: Sequence[DecimatedPart], first: int, *, owner: bool) -> None:
        self._buffers, self._owner = buffers, owner
        self.part, count = parts[0].part, sum(len(p.triangles) for p in parts)
        self._first, self.triangles = first, buffers.triangles[first : first + count]

    def upload(self) -> int:
        """Send what the last pose changed, of all parts in the buffers."""
        return self._buffers.upload() if self._owner else 0

    def outline(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions now (m, 3) and the triangles drawn of them (t, 3)."""
        return self._buffers.vertices, self.triangles

    def draw(self) -> None:
        """Draw the triangles with the buffers' program."""
        self._buffers.array.render(vertices=self.triangles.size, first=3 * self._first)

    def release(self) -> None:
        """Give the buffers back."""
        if self._owner:
            self._buffers.release()


def decimated_drawn(
    ctx: moderngl.Context,
    decimated: DecimatedHead,
    programs: Mapping[str, moderngl.Program],
    static: Callable[[ViewPart], Mapping[str, np.ndarray]],
) -> list[DecimatedDrawn]:
    """All of a decimated head, in the order in which it is drawn."""
    drawn = []
    for name, group in groupby(decimated.parts, lambda p: materials.of(p.part.material).program):
        parts = list(group)
        buffers, first = DecimatedBuffers(ctx, decimated, parts, programs[name], lambda p: static(p.part)), 0
        for _, alike in groupby(parts, lambda p: materials.told(p.part)):
            own = list(alike)
            drawn.append(DecimatedDrawn(buffers, own, first, owner=own[0] is parts[0]))
            first += sum(len(p.triangles) for p in own)
    return drawn
