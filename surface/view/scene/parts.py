"""A head part on the graphics processor: buffers, and what is uploaded after each pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

if TYPE_CHECKING:
    import moderngl

#: Above this share of a part, one whole write into fresh storage beats many small ones.
_WHOLE = 0.5
_VERTEX_BYTES = 12


class ViewPart(Protocol):
    """What the picture needs of a head part; `surface.head` offers it.

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
    """What the picture needs of a head."""

    @property
    def parameters(self) -> tuple[str, ...]: ...
    @property
    def parts(self) -> Sequence[ViewPart]: ...
    def pose(self, values: np.ndarray) -> None: ...


class Moving:
    """Positions and normals on the graphics processor.

    Attributes
    ----------
    content : what a vertex array needs of them, by shader input.
    """

    def __init__(self, ctx: moderngl.Context, count: int) -> None:
        self.positions, self.normals = (ctx.buffer(reserve=count * _VERTEX_BYTES, dynamic=True) for _ in range(2))
        self.content = [(self.positions, "3f", "position"), (self.normals, "3f", "normal")]

    def upload(self, vertices: np.ndarray, normals: np.ndarray, ranges: Sequence[tuple[int, int]]) -> int:
        """Send the ranges [start, stop) of `vertices` and `normals` (m, 3); returns how many vertices were sent."""
        touched = sum(stop - start for start, stop in ranges)
        if touched > _WHOLE * len(vertices):
            self.positions.orphan()
            self.normals.orphan()
            ranges = [(0, len(vertices))]
        for start, stop in ranges:
            self.positions.write(_contiguous(vertices[start:stop]), offset=start * _VERTEX_BYTES)
            self.normals.write(_contiguous(normals[start:stop]), offset=start * _VERTEX_BYTES)
        return touched

    def release(self) -> None:
        """Give the buffers back."""
        self.positions.release()
        self.normals.release()


class PartBuffers:
    """Vertex and index buffers of one part, bound to one program.

    Parameters
    ----------
    part : the head part.
    program : its material's program, with inputs `position`, `normal` and any of `static`.
    static : per-vertex data that never changes, by shader input name: (m, k) float32, or uint8 read as 0..1.
    interleaved : positions and normals lie in one buffer, `moving`, which somebody else fills.

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
        interleaved: bool = False,
    ) -> None:
        self.part, self.triangles, count = part, part.triangles, len(part.vertices)
        self._index = ctx.buffer(np.ascontiguousarray(self.triangles, np.int32).tobytes())
        self._static, content = static_buffers(ctx, static)
        self._own = None if interleaved else Moving(ctx, count)
        if self._own is None:
            self.moving = ctx.buffer(reserve=2 * count * _VERTEX_BYTES, dynamic=True)
            normal = ("3f 3f", "position", "normal") if "normal" in program else ("3f 12x", "position")
            content.append((self.moving, *normal))
            self._static.append(self.moving)
        else:
            content += self._own.content
        kept = [entry for entry in content if entry[2] in program]
        self._array = ctx.vertex_array(program, kept, index_buffer=self._index, index_element_size=4)
        if not interleaved:
            self.upload([(0, count)])

    def upload(self, ranges: Sequence[tuple[int, int]] | None = None) -> int:
        """Send the vertex ranges [start, stop) that the last pose changed, or those given; returns how many vertices
        were sent."""
        if self._own is None:
            return 0
        return self._own.upload(self.part.vertices, self.part.normals, self.part.changed if ranges is None else ranges)

    def outline(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Positions now (m, 3) and the triangles drawn of them (t, 3), or None where only OpenGL knows."""
        return None if self._own is None else (self.part.vertices, self.triangles)

    def draw(self) -> None:
        """Draw the triangles with the part's program."""
        self._array.render()

    def release(self) -> None:
        """Give the buffers back."""
        self._array.release()
        if self._own is not None:
            self._own.release()
        for buffer in (self._index, *self._static):
            buffer.release()


def static_buffers(
    ctx: moderngl.Context, static: Mapping[str, np.ndarray]
) -> tuple[list[moderngl.Buffer], list[tuple[Any, ...]]]:
    """Buffers of per-vertex data that never changes, (m, k) float32 or uint8 by shader input, and what a vertex array
    needs of them."""
    buffers, content = [], []
    for name, data in static.items():
        buffers.append(ctx.buffer(np.ascontiguousarray(data).tobytes()))
        content.append((buffers[-1], f"{data.shape[1]}{'f1' if data.dtype == np.uint8 else 'f'}", name))
    return buffers, content


def _contiguous(block: np.ndarray) -> np.ndarray:
    """`block` (k, 3) as C-contiguous float32, copied only when it is not."""
    return np.ascontiguousarray(block, np.float32)
