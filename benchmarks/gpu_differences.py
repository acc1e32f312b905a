"""Eq. (2) on the graphics processor: sums are kept in textures, and moved control points add their differences.

A point is drawn for each entry of a moved control point, at the texel of the vertex that it reaches, and blending adds
it. This is slower than to work out every sum, as omote does (:class:`surface.view.draw.vertex_sums.VertexSums`);
``benchmarks/gpu_update.py`` measures both.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from surface.view.draw.programs import assemble, set_uniforms
from surface.view.draw.vertex_sums import DEFINES, WIDTH, list_texture, padded, set_turn, vertex_rows

MOST_DIFFERENCES = 64
"""Updates by differences until everything is summed again, so that rounding errors do not accumulate."""
KEPT = ("sum_value", "sum_u", "sum_v")
MOST_EXACT = 2**24
"""Whole numbers up to here are exact as 32-bit floats, which entries and vertices are counted in."""

_TEXEL = """
// The middle of a texel of a texture that is used like a list, as a place to draw a point at.
uniform int lines;

vec4 texel(int i) {
    vec2 middle = vec2(i % WIDTH, i / WIDTH) + 0.5;
    return vec4(2.0 * middle / vec2(WIDTH, lines) - 1.0, 0.0, 1.0);
}
"""
_SUM = """
// Eq. (1) on the graphics processor: all sums of a vertex, to be kept.
flat out vec3 value;
flat out vec3 along_u;
flat out vec3 along_v;

void main() {
    sum(value, along_u, along_v);
    gl_Position = texel(gl_VertexID);
}
"""
_DIFFERENCE = """
// Eq. (2) on the graphics processor: what one moved control point adds to the sums of one vertex.
uniform sampler2D moved;        // two texels a point: displacement, mm; entries of points before, first entry
uniform sampler2D entries;      // by point: factors for position, derivative in u and in v; number of the vertex
uniform int moved_count;

flat out vec3 value;
flat out vec3 along_u;
flat out vec3 along_v;

vec4 row(int i) {
    return texelFetch(moved, ivec2(i % WIDTH, i / WIDTH), 0);
}

void main() {
    int low = 0;
    int high = moved_count;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (int(row(2 * middle + 1).x + 0.5) <= gl_VertexID) {
            low = middle;
        } else {
            high = middle;
        }
    }
    vec3 delta = row(2 * low).xyz;
    vec2 own = row(2 * low + 1).xy;
    int i = int(own.y + 0.5) + gl_VertexID - int(own.x + 0.5);
    vec4 w = texelFetch(entries, ivec2(i % WIDTH, i / WIDTH), 0);
    value = w.x * delta;
    along_u = w.y * delta;
    along_v = w.z * delta;
    gl_Position = texel(int(w.w + 0.5));
}
"""
_INTO = """#version 140
// Three sums of a vertex, each in its texture.
flat in vec3 value;
flat in vec3 along_u;
flat in vec3 along_v;

out vec4 sum_value;
out vec4 sum_u;
out vec4 sum_v;

void main() {
    sum_value = vec4(value, 0.0);
    sum_u = vec4(along_u, 0.0);
    sum_v = vec4(along_v, 0.0);
}
"""
_KEPT = """
// A vertex and its normal from the sums that are kept.
uniform sampler2D sum_value;
uniform sampler2D sum_u;
uniform sampler2D sum_v;

void main() {
    ivec2 at = ivec2(gl_VertexID % WIDTH, gl_VertexID / WIDTH);
    finish(texelFetch(sum_value, at, 0).xyz, texelFetch(sum_u, at, 0).xyz, texelFetch(sum_v, at, 0).xyz);
}
"""


class KeptSums:
    """The same vertices as :class:`~surface.view.draw.vertex_sums.VertexSums` writes.

    sums : as there. share : of all entries: where more change, everything is summed.
    last : "whole" or "difference": how the last update was made.

    Raises ValueError: more entries or vertices than 32-bit floats count.
    """

    def __init__(self, ctx: Any, sums: Any, share: float = 0.5) -> None:
        if max(len(sums.ids), len(sums.share)) >= MOST_EXACT:
            raise ValueError(f"{len(sums.ids)} entries are more than {MOST_EXACT}")
        self._ctx, self._largest, self.last, self._since = ctx, share, "", MOST_DIFFERENCES
        order = np.argsort(sums.ids, kind="stable")
        vertex = np.repeat(np.arange(len(sums.share)), np.diff(sums.start))
        self._entries = _filled(ctx, np.column_stack([sums.weights, vertex])[order])
        self._weights = _filled(ctx, np.column_stack([sums.weights, sums.ids]))
        self._counts = np.bincount(sums.ids, minlength=sums.points)
        self._first = np.cumsum(self._counts) - self._counts
        self._moved, self._points = list_texture(ctx, 2 * sums.points), list_texture(ctx, sums.points)
        self._packed = padded(np.zeros((sums.points, 4), np.float32), self._points.height)
        self._textures = [list_texture(ctx, len(sums.share)) for _ in KEPT]
        self._screen = ctx.framebuffer(self._textures)
        self._frame = ctx.framebuffer([ctx.renderbuffer((1, 1), 4)])
        self._make_programs(ctx.buffer(vertex_rows(sums).tobytes()))

    def _make_programs(self, attributes: Any) -> None:
        ctx, targets = self._ctx, {name: k for k, name in enumerate(KEPT)}
        whole, add = (
            ctx.program(vertex_shader=text, fragment_shader=_INTO, fragment_outputs=targets)
            for text in (assemble(("sum.glsl",), DEFINES) + _TEXEL + _SUM, assemble((), DEFINES) + _TEXEL + _DIFFERENCE)
        )
        finish = ctx.program(
            vertex_shader=assemble(
                (
                    "rotate.glsl",
                    "turn.glsl",
                ),
                DEFINES,
            )
            + _KEPT,
            varyings=("out_position", "out_normal"),
        )
        ctx.clear_errors()  # moderngl queries every program for features that OpenGL 3.1 does not have
        lines = self._textures[0].height
        set_uniforms(whole, {"lines": lines, "points": 0, "weights": 1})
        set_uniforms(add, {"lines": lines, "moved": 0, "entries": 1})
        set_uniforms(finish, targets)
        self._finish, self._add = finish, add
        self._whole_array = ctx.vertex_array(whole, [(attributes, "1i 1i 1x4", "first", "count")], mode=ctx.POINTS)
        self._add_array = ctx.vertex_array(add, [], mode=ctx.POINTS)
        self._array = ctx.vertex_array(finish, [(attributes, "1x4 1x4 1f", "share")])

    def update(self, points: np.ndarray, turn: Any) -> None:
        """Take control points (n, 3) float32 and the rotation of the head; needed before :meth:`write`."""
        moved = np.flatnonzero((points != self._packed[: len(points), :3]).any(axis=1))
        few = self._counts[moved].sum() <= self._largest * self._counts.sum()
        if self._since < MOST_DIFFERENCES and few:
            self._add_differences(moved, points[moved] - self._packed[moved, :3])
            self._packed[: len(points), :3] = points
            self._since, self.last = self._since + 1, "difference"
        else:
            self._packed[: len(points), :3] = points
            self._sum_all()
            self._since, self.last = 0, "whole"
        set_turn(self._finish, turn)
        self._frame.use()
        for k, texture in enumerate(self._textures):
            texture.use(k)

    def _sum_all(self) -> None:
        self._points.write(self._packed.tobytes())
        self._points.use(0)
        self._weights.use(1)
        self._screen.use()
        self._ctx.enable_only(self._ctx.NOTHING)
        self._whole_array.render()

    def _add_differences(self, moved: np.ndarray, change: np.ndarray) -> None:
        """Add what displacements (k, 3) of control points (k,) change."""
        counts = self._counts[moved]
        total = int(counts.sum())
        if not total:
            return
        rows = np.zeros((2 * len(moved), 4), np.float32)
        rows[::2, :3] = change
        rows[1::2, 0], rows[1::2, 1] = np.cumsum(counts) - counts, self._first[moved]
        lines = -(-len(rows) // WIDTH)
        self._moved.write(padded(rows, lines).tobytes(), viewport=(0, 0, WIDTH, lines))
        self._moved.use(0)
        self._entries.use(1)
        set_uniforms(self._add, {"moved_count": len(moved)})
        self._screen.use()
        self._ctx.enable_only(self._ctx.BLEND)
        self._ctx.blend_func = self._ctx.ONE, self._ctx.ONE
        self._add_array.render(vertices=total)
        self._ctx.enable_only(self._ctx.NOTHING)

    def write(self, buffer: Any, first: int, last: int) -> None:
        """Write positions and normals of a range of vertices, six floats each, to a buffer."""
        self._array.transform(buffer, vertices=last - first, first=first)


def _filled(ctx: Any, rows: np.ndarray) -> Any:
    """A texture with rows (k, 4)."""
    texture = list_texture(ctx, len(rows))
    texture.write(padded(rows.astype(np.float32), texture.height).tobytes())
    return texture
