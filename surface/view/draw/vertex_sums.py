"""Sums of vertices over control points, Eq. (1), on the graphics processor.

Weights lie in a texture of floats, uploaded once; textures are used like buffer textures, but without their limit of
65,536 texels in OpenGL 3.1. One pass with transform feedback writes positions and normals into the buffers that are
drawn. ``benchmarks/gpu_update.py`` compares it with the differences of Eq. (2), which are slower there.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from surface.base.arrays import Floats32
from surface.view.draw.programs import build, set_uniforms

if TYPE_CHECKING:
    import moderngl

    from surface.head.posing.influence import Influence
    from surface.head.posing.part import Turn

WIDTH = 1024
"""Texels in a line of a texture."""
SAMPLERS = 2
"""Textures that a vertex shader has to read at once."""
DEFINES = {"WIDTH": WIDTH}


class VertexSums:
    """Works out every sum when control points have moved.

    sums : of all vertices of a head.
    """

    def __init__(self, ctx: moderngl.Context, sums: Influence) -> None:
        entries = np.column_stack([sums.weights, sums.ids]).astype(np.float32)
        self._weights = list_texture(ctx, len(entries))
        self._weights.write(padded(entries, self._weights.height).tobytes())
        self._points = list_texture(ctx, sums.points)
        self._packed = padded(np.zeros((sums.points, 4), np.float32), self._points.height)
        # A context without a window has no framebuffer of its own, and without one transform feedback does nothing.
        self._frame = ctx.framebuffer([ctx.renderbuffer((1, 1), 4)])
        shaders, outputs = ("sum.glsl", "rotate.glsl", "turn.glsl", "place.vert"), ("out_position", "out_normal")
        self._program = build(ctx, shaders, (), outputs=outputs, defines=DEFINES)
        set_uniforms(self._program, {"points": 0, "weights": 1})
        self._attributes = ctx.buffer(vertex_rows(sums).tobytes())
        content = self._attributes, "1i 1i 1f", "first", "count", "share"
        self._array = ctx.vertex_array(self._program, [content])

    def update(self, points: Floats32, turn: Turn) -> None:
        """Take control points (n, 3) and the rotation of the head; needed before :meth:`write`."""
        self._packed[: len(points), :3] = points
        self._points.write(self._packed.tobytes())
        set_turn(self._program, turn)
        self._frame.use()
        self._points.use(0)
        self._weights.use(1)

    def write(self, buffer: moderngl.Buffer, first: int, last: int) -> None:
        """Write positions and normals of a range of vertices, six floats each, to a buffer."""
        self._array.transform(buffer, vertices=last - first, first=first)

    def release(self) -> None:
        """Release the graphics memory."""
        frame = *self._frame.color_attachments, self._frame
        for thing in (self._array, *frame, self._attributes, self._points, self._weights, self._program):
            thing.release()


def set_turn(program: moderngl.Program, turn: Turn) -> None:
    """Set the rotation of the head."""
    angle = float(np.linalg.norm(turn.vector))
    axis = turn.vector / max(angle, 1e-12)
    set_uniforms(program, {"axis": axis, "angle": angle, "pivot": turn.pivot})


def list_texture(ctx: moderngl.Context, count: int) -> moderngl.Texture:
    """A texture with room for `count` rows of four floats, :data:`WIDTH` a line."""
    texture = ctx.texture((WIDTH, max(1, -(-count // WIDTH))), 4, dtype="f4")
    texture.filter = (ctx.NEAREST, ctx.NEAREST)
    return texture


def padded(rows: Floats32, lines: int) -> Floats32:
    """`rows` (k, 4) float32 padded with zeros to whole lines of a texture."""
    return np.pad(rows, ((0, lines * WIDTH - len(rows)), (0, 0)))


def vertex_rows(sums: Influence) -> np.ndarray:
    """Attributes of all vertices: first entry, number of entries, share of the head's rotation."""
    rows = np.zeros(len(sums.share), [("first", "i4"), ("count", "i4"), ("share", "f4")])
    rows["first"], rows["count"], rows["share"] = sums.start[:-1], np.diff(sums.start), sums.share
    return rows
