"""Draws the accessories of a head: meshes with textures that turn with it, on the graphics processor itself.

Their vertices are uploaded once. Solid ones, and what is solid of those that blend, come before the head's parts, which
they hide; the rest is blended over the finished picture.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from surface.base.arrays import Floats
from surface.base.errors import ViewError
from surface.base.extras import require
from surface.base.pictures import decoded
from surface.head.model.accessories import ALPHA, Accessory
from surface.head.posing.dressing import WornMesh
from surface.head.posing.part import Turn
from surface.view.draw.programs import build, set_uniforms
from surface.view.draw.vertex_sums import set_turn

if TYPE_CHECKING:
    import moderngl

log = logging.getLogger(__name__)
HINT = "fit the head again, or leave it out: omote fit --without NAME"
SOLID, CLEAR = "accessory_solid", "accessory"
PROGRAMS: dict[str, dict[str, int | str]] = {SOLID: {"SOLID": 1}, CLEAR: {}}
"""Programs by name, and their macros: of solid accessories, and of those that are clear in places."""
_ALPHA_TO_COVERAGE = 0x809E  # GL_SAMPLE_ALPHA_TO_COVERAGE, which moderngl does not name
_SOFT = {"hair": 1.0}
#: How strong a highlight is and how sharp, by kind.
_GLOSS = {"hair": (0.045, 9.0), "hat": (0.02, 12.0), "glasses": (0.28, 90.0), "jewellery": (0.6, 120.0)}
_MASK, _BLEND = ALPHA.index("MASK"), ALPHA.index("BLEND")
_REST = _BLEND + 1  # of what blends: all that is not nearly solid
_UNIT = 3
_WHITE = b"\xff\xff\xff\xff"


@dataclass(frozen=True)
class _Drawn:
    """Buffers of one accessory."""

    mesh: WornMesh
    program: moderngl.Program
    array: moderngl.VertexArray
    texture: moderngl.Texture
    buffers: tuple[moderngl.Buffer, ...]
    two_sided: bool


def accessory_programs(ctx: moderngl.Context, quality: str) -> dict[str, moderngl.Program]:
    """The programs of accessories by name, of solid ones and of others; "fast" lights them per vertex."""
    shared = ("light.glsl", "accessory.glsl")
    vertex, fragment = (*shared, "rotate.glsl", "accessory.vert"), (*shared, "accessory.frag")
    lit: dict[str, int | str] = {} if quality == "full" else {"PER_VERTEX": 1}
    return {name: build(ctx, vertex, fragment, defines=lit | more) for name, more in PROGRAMS.items()}


class AccessoryBuffers:
    """Accessories of a head on an OpenGL context.

    programs : those of :func:`accessory_programs`, whose lights and camera its owner sets.
    simplified : textures are not mixed between their sizes, and of triangles only sides are drawn that can be seen, for
        pictures drawn in software.

    What has a texture that cannot be read, or is larger than the driver draws, is drawn in one colour; a warning is
    logged.
    """

    def __init__(
        self, ctx: moderngl.Context, meshes: Sequence[WornMesh], programs: Mapping[str, moderngl.Program], *,
        simplified: bool = False,
    ) -> None:  # fmt: skip
        self._ctx = ctx
        self._drawn = [
            _buffers(ctx, mesh, programs[SOLID if _is_solid(mesh) else CLEAR], outside=simplified)
            for mesh in meshes
            if not (simplified and _is_hidden(mesh))
        ]
        if simplified:
            for one in self._drawn:
                one.texture.filter = (ctx.LINEAR_MIPMAP_NEAREST, ctx.LINEAR)
        self._matrix: Floats = np.eye(3)

    def outlines(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Positions now (m, 3) and triangles (t, 3) of each."""
        return [(one.mesh.turned(self._matrix)[0], one.mesh.accessory.triangles) for one in self._drawn]

    def turn(self, matrix: Floats) -> None:
        """Turn them with the head, by a rotation (3, 3)."""
        self._matrix = np.asarray(matrix, np.float64)

    def draw_solid(self, *, multisampled: bool) -> None:
        """Draw what is solid, into depth, too."""
        for one in self._drawn:
            self._draw(one, ALPHA.index(one.mesh.accessory.alpha), multisampled=multisampled)

    def draw_blended(self, target: moderngl.Framebuffer) -> None:
        """Blend what is not solid with the picture in ``target``, which has the background, too."""
        blended = [one for one in self._drawn if one.mesh.accessory.alpha == "BLEND"]
        if not blended:
            return
        target.depth_mask = False
        target.use()  # again: it applies the mask
        for one in blended:
            self._draw(one, _REST, multisampled=False)
        target.depth_mask = True
        target.use()

    def _draw(self, one: _Drawn, alpha: int, *, multisampled: bool) -> None:
        ctx, accessory = self._ctx, one.mesh.accessory
        covering = alpha == _MASK and multisampled
        set_turn(one.program, Turn(self._matrix, one.mesh.pivot))
        set_uniforms(one.program, {
            "picture": _UNIT, "tint": accessory.colour, "cutoff": accessory.cutoff, "alpha": alpha,
            "multisampled": int(covering), "soft": _SOFT.get(accessory.kind, 0.0), "gloss": _GLOSS[accessory.kind],
        })  # fmt: skip
        one.texture.use(_UNIT)
        culled = 0 if one.two_sided else ctx.CULL_FACE
        ctx.enable_only(ctx.DEPTH_TEST | culled | (ctx.BLEND if alpha == _REST else 0))
        if covering:
            ctx.enable_direct(_ALPHA_TO_COVERAGE)
        one.array.render()
        if covering:
            ctx.disable_direct(_ALPHA_TO_COVERAGE)

    def release(self) -> None:
        """Release the graphics memory."""
        for one in self._drawn:
            one.array.release()
            one.texture.release()
            for buffer in one.buffers:
                buffer.release()


def _is_solid(mesh: WornMesh) -> bool:
    return mesh.accessory.alpha == "OPAQUE"


def _is_hidden(mesh: WornMesh) -> bool:
    """Whether nothing of it can be seen."""
    outside = mesh.accessory.outside
    return outside is not None and not len(outside)


def _buffers(ctx: moderngl.Context, mesh: WornMesh, program: moderngl.Program, *, outside: bool) -> _Drawn:
    """Buffers of an accessory; ``outside`` : only of the sides that can be seen, where these are known."""
    accessory = mesh.accessory
    sides = accessory.outside if outside else None
    triangles = accessory.triangles if sides is None else sides
    rows = np.hstack(
        [accessory.vertices, accessory.normals, accessory.uv, mesh.share[:, None], accessory.shade[:, None]]
    )
    vertices = ctx.buffer(np.ascontiguousarray(rows, np.float32).tobytes())
    index = ctx.buffer(np.ascontiguousarray(triangles, np.int32).tobytes())
    content: Any = [(vertices, "3f 3f 2f 1f 1f", "position", "normal", "uv", "share", "shade")]
    array = ctx.vertex_array(program, content, index_buffer=index, index_element_size=4)
    two_sided = accessory.two_sided and sides is None
    return _Drawn(mesh, program, array, _texture(ctx, accessory), (vertices, index), two_sided)


def _texture(ctx: moderngl.Context, accessory: Accessory) -> moderngl.Texture:
    """The texture with smaller versions of it; one white texel where there is none that can be drawn."""
    size, pixels = (1, 1), _WHITE
    if accessory.texture:
        try:
            size, pixels = decoded_picture(accessory, ctx.info["GL_MAX_TEXTURE_SIZE"])
        except ViewError as error:
            _warn_once(f"{error}: it is drawn in one colour; {error.hint}")
    texture = ctx.texture(size, 4, pixels)
    texture.build_mipmaps()
    texture.filter = (ctx.LINEAR_MIPMAP_LINEAR, ctx.LINEAR)
    texture.repeat_x = texture.repeat_y = accessory.repeats
    return texture


@lru_cache(64)
def _warn_once(text: str) -> None:
    log.warning(text)  # a head is drawn again and again, in several windows


def decoded_picture(accessory: Accessory, most: int) -> tuple[tuple[int, int], bytes]:
    """Width, height and RGBA bytes of a texture, top row first.

    Raises ViewError: it is damaged, or has more than ``most`` pixels in a side, or too many in all.
    """
    require("accessories", "PIL")
    try:
        image = decoded(accessory.texture)
    except ValueError as error:
        raise ViewError(f"{accessory.name}: its texture cannot be read ({error})", hint=HINT) from error
    if max(image.size) > most:
        raise ViewError(f"{accessory.name}: its texture has {max(image.size)} pixels, {most} are the most here",
                        hint="fit the head again with a smaller texture")  # fmt: skip
    return image.size, image.convert("RGBA").tobytes()
