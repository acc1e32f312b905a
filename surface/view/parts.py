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


class PartBuffers:
    """Vertex and index buffers of one part, bound to one program.

    Parameters
    ----------
    part : the head part.
    program : its material's program, with inputs `position`, `normal` and any of `static`.
    static : per-vertex data that never changes, by shader input name: (m, k) float32, or uint8 read as 0..1.
    interleaved : positions and normals lie in one buffer, `moving`, which somebody else fills.
    lean : (k, 3) triangles to draw instead of the part's own; vertices that none of them has are left out.

    Attributes
    ----------
    triangles : (k, 3) that are drawn, of the rows that :meth:`picked` keeps.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        part: ViewPart,
        program: moderngl.Program,
        static: Mapping[str, np.ndarray],
        *,
        interleaved: bool = False,
        lean: np.ndarray | None = None,
    ) -> None:
        self.part = part
        self._pick(lean)
        count = len(self.picked(part.vertices))
        self._index = ctx.buffer(np.ascontiguousarray(self.triangles, np.int32).tobytes())
        self._static: list[moderngl.Buffer] = []
        content: list[tuple[Any, ...]] = []
        for name, data in static.items():
            kind = "f1" if data.dtype == np.uint8 else "f"
            self._static.append(ctx.buffer(np.ascontiguousarray(self.picked(data)).tobytes()))
            content.append((self._static[-1], f"{data.shape[1]}{kind}", name))
        if interleaved:
            self.moving = ctx.buffer(reserve=2 * count * _VERTEX_BYTES, dynamic=True)
            normal = ("3f 3f", "position", "normal") if "normal" in program else ("3f 12x", "position")
            content.append((self.moving, *normal))
            self._static.append(self.moving)
        else:
            self._position = ctx.buffer(reserve=count * _VERTEX_BYTES, dynamic=True)
            self._normal = ctx.buffer(reserve=count * _VERTEX_BYTES, dynamic=True)
            self._static += [self._position, self._normal]
            content += [(self._position, "3f", "position"), (self._normal, "3f", "normal")]
        kept = [entry for entry in content if entry[2] in program]
        self._array = ctx.vertex_array(program, kept, index_buffer=self._index, index_element_size=4)
        if not interleaved:
            self.upload([(0, len(part.vertices))])

    def _pick(self, lean: np.ndarray | None) -> None:
        """Choose the triangles to draw and, of the part's vertices, those that they have."""
        self.triangles = self.part.triangles
        self._kept: np.ndarray | None = None
        if lean is not None:
            self._kept, at = np.unique(lean, return_inverse=True)
            self.triangles = at.reshape(-1, 3).astype(np.int32)

    def picked(self, rows: np.ndarray) -> np.ndarray:
        """Of ``rows`` (m, ...), one a vertex of the part, those that are drawn."""
        return rows if self._kept is None else rows.take(self._kept, axis=0)

    def upload(self, ranges: Sequence[tuple[int, int]]) -> int:
        """Send the vertex ranges [start, stop) that changed; returns how many vertices were sent."""
        if not ranges:
            return 0
        vertices, normals = self.picked(self.part.vertices), self.picked(self.part.normals)
        if self._kept is not None:
            ranges = np.searchsorted(self._kept, np.reshape(ranges, (-1, 2))).tolist()
        touched = sum(stop - start for start, stop in ranges)
        if touched > _WHOLE * len(vertices):
            self._position.orphan()
            self._normal.orphan()
            ranges = [(0, len(vertices))]
        for start, stop in ranges:
            self._position.write(_contiguous(vertices[start:stop]), offset=start * _VERTEX_BYTES)
            self._normal.write(_contiguous(normals[start:stop]), offset=start * _VERTEX_BYTES)
        return touched

    def draw(self) -> None:
        """Draw the triangles with the part's program."""
        self._array.render()

    def release(self) -> None:
        """Give the buffers back."""
        self._array.release()
        for buffer in (self._index, *self._static):
            buffer.release()


def _contiguous(block: np.ndarray) -> np.ndarray:
    """`block` (k, 3) as C-contiguous float32, copied only when it is not."""
    return np.ascontiguousarray(block, np.float32)
