"""OpenGL buffers of a head part, and the upload of the vertices that a pose changed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

if TYPE_CHECKING:
    import moderngl

    from surface.head.model.data import Contact

#: Above this share of a part, one whole write into new storage is faster than many small ones.
_WHOLE = 0.5
_VERTEX_BYTES = 12


class ViewPart(Protocol):
    """Interface of a head part that can be drawn; the parts of `surface.head` have it.

    `vertices` and `normals` (m, 3) float32 are current and updated in place, `triangles` (t, 3) int32,
    `uv` (m, 2) float32, `changed` the vertex ranges [start, stop) the last pose touched, `attributes`
    static (m, k) float32 arrays by name.
    """

    name: str
    material: str

    @property
    def triangles(self) -> np.ndarray: ...
    @property
    def uv(self) -> np.ndarray: ...
    @property
    def vertices(self) -> np.ndarray: ...
    @property
    def normals(self) -> np.ndarray: ...
    @property
    def changed(self) -> Sequence[tuple[int, int]]: ...
    @property
    def attributes(self) -> Mapping[str, np.ndarray]: ...


class ViewHead(Protocol):
    """Interface of a head that can be drawn; `contacts` of lids and lips tell which part is the face."""

    @property
    def parameters(self) -> tuple[str, ...]: ...
    @property
    def parts(self) -> Sequence[ViewPart]: ...
    @property
    def contacts(self) -> Sequence[Contact]: ...
    def pose(self, values: np.ndarray) -> None: ...


class DynamicBuffers:
    """Vertex buffers of positions and normals that change with the pose; ``content`` : entries of a vertex array."""

    def __init__(self, ctx: moderngl.Context, count: int) -> None:
        self.positions, self.normals = (ctx.buffer(reserve=count * _VERTEX_BYTES, dynamic=True) for _ in range(2))
        self.content = [(self.positions, "3f", "position"), (self.normals, "3f", "normal")]

    def upload(self, vertices: np.ndarray, normals: np.ndarray, ranges: Sequence[tuple[int, int]]) -> int:
        """Send the ranges [start, stop) of `vertices` and `normals` (m, 3); returns how many vertices were sent."""
        touched = sum(stop - start for start, stop in ranges)
        if touched > _WHOLE * len(vertices):
            ranges = [(0, len(vertices))]
        for buffer, rows in ((self.positions, vertices), (self.normals, normals)):
            if touched > _WHOLE * len(vertices):
                buffer.orphan()
            for start, stop in ranges:
                buffer.write(np.ascontiguousarray(rows[start:stop], np.float32), offset=start * _VERTEX_BYTES)
        return touched


class PartBuffers:
    """Vertex and index buffers of one part, bound to one program.

    Parameters
    ----------
    program : its material's program, with inputs `position`, `normal` and any of `static`.
    static : per-vertex data that never changes, by shader input name: (m, k) float32, or uint8 read as 0..1.
    on_gpu : positions and normals lie in one buffer, `feedback`, which a shader fills.

    Attributes
    ----------
    triangles : (t, 3) that are drawn.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        part: ViewPart,
        program: moderngl.Program,
        static: Mapping[str, np.ndarray],
        *,
        on_gpu: bool = False,
    ) -> None:
        self.part, self.triangles, count = part, part.triangles, len(part.vertices)
        index = ctx.buffer(np.ascontiguousarray(self.triangles, np.int32).tobytes())
        content: list[tuple[Any, ...]] = []
        for name, data in static.items():
            buffer = ctx.buffer(np.ascontiguousarray(data).tobytes())
            content.append((buffer, f"{data.shape[1]}{'f1' if data.dtype == np.uint8 else 'f'}", name))
        self._dynamic = None if on_gpu else DynamicBuffers(ctx, count)
        if self._dynamic is None:
            self.feedback = ctx.buffer(reserve=2 * count * _VERTEX_BYTES, dynamic=True)
            normal = ("3f 3f", "position", "normal") if "normal" in program else ("3f 12x", "position")
            content.append((self.feedback, *normal))
        else:
            content += self._dynamic.content
        self._buffers = [index, *(entry[0] for entry in content)]
        used = [entry for entry in content if entry[2] in program]
        self._array = ctx.vertex_array(program, used, index_buffer=index, index_element_size=4)
        self.upload([(0, count)])

    def upload(self, ranges: Sequence[tuple[int, int]] | None = None) -> int:
        """Send the vertex ranges [start, stop) given, or those that the last pose changed; returns how many vertices
        were sent."""
        if self._dynamic is None:
            return 0
        part = self.part
        return self._dynamic.upload(part.vertices, part.normals, part.changed if ranges is None else ranges)

    def outline(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Positions now (m, 3) and the triangles drawn of them (t, 3), or None where only OpenGL has positions."""
        return None if self._dynamic is None else (self.part.vertices, self.triangles)

    def draw(self, first: int = 0, count: int = -1) -> None:
        """Draw `count` triangles (all without it) from number `first` with the part's program."""
        self._array.render(vertices=3 * count if count >= 0 else -1, first=3 * first)

    def release(self) -> None:
        """Release the graphics memory."""
        self._array.release()
        for buffer in self._buffers:
            buffer.release()
