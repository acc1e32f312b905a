"""Puts a picture at its place in a window."""

from __future__ import annotations

from typing import TYPE_CHECKING

from surface.view.draw.programs import build, set_uniforms
from surface.view.draw.renderer import Rectangles
from surface.view.scene.bounds import Bands, corners

if TYPE_CHECKING:
    import moderngl

Box = tuple[int, int, int, int]


class Placing:
    """Copies pictures into a framebuffer, pixel by pixel; OpenGL 3.1 through moderngl copies to its corner only."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._program = build(ctx, ("background.vert",), ("place.frag",))
        self._whole = Rectangles(ctx, self._program)

    def copy(self, screen: moderngl.Framebuffer, picture: moderngl.Framebuffer, box: Box) -> None:
        """Copy ``picture`` to ``box`` (left, bottom, width, height), pixels, of ``screen``, and leave that bound."""
        screen.viewport = screen.scissor = box
        screen.use()
        self._ctx.enable_only(self._ctx.NOTHING)
        set_uniforms(self._program, {"picture": 1})
        texture = picture.color_attachments[0]
        texture.filter = self._ctx.NEAREST, self._ctx.NEAREST  # type: ignore[union-attr]
        texture.use(1)  # type: ignore[union-attr]
        self._whole.render(corners(Bands.whole(box[2:]).boxes(), box[2:]))

    def release(self) -> None:
        """Release the graphics memory."""
        self._whole.release()
        self._program.release()
