"""Waiting for a graphics processor one frame late, so that it draws a frame while the next one is prepared."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import moderngl


class FrameFence:
    """Waits until the frame before the present one is drawn.

    moderngl has no fences; but the result of a query is known only when everything that was given to the graphics
    processor before it is done (OpenGL 3.1 specification, 2.14).
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self._nothing = ctx.framebuffer([ctx.renderbuffer((1, 1), 4)])
        self._new, self._old = ctx.query(samples=True), ctx.query(samples=True)
        self._begun = False

    def end_frame(self) -> None:
        """Mark the end of what the graphics processor was given, and wait for the mark of the call before."""
        with self._new:
            self._nothing.clear()
        if self._begun:
            _ = self._old.samples
        self._begun = True
        self._new, self._old = self._old, self._new

    def release(self) -> None:
        """Release the buffers."""
        for attachment in self._nothing.color_attachments:
            attachment.release()
        self._nothing.release()
