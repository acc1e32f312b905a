"""Where a picture is drawn: samples or smoothing, and only the part of the screen that the head touches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from surface.view.camera import Camera
from surface.view.programs import build, put
from surface.view.renderer import Region, Renderer
from surface.view.theme import Theme

if TYPE_CHECKING:
    import moderngl


class Target:
    """A picture in memory that a renderer is drawn into.

    With `samples` > 1 the head is drawn multisampled and brought together; with 1 it is drawn once per
    pixel and its edges are smoothed. The background stands still, so after the first frame only the
    rectangle around the head, where it is and where it was, is drawn again: on a software renderer
    pixels are what costs.

    Parameters
    ----------
    size : (width, height), pixels.
    samples : per pixel; capped at what the driver offers.
    """

    def __init__(self, ctx: moderngl.Context, size: tuple[int, int], samples: int = 4) -> None:
        self._ctx, self.size = ctx, size
        samples = min(samples, ctx.max_samples)
        self.samples = samples if samples > 1 else 1
        self._texture = ctx.texture(size, 4)
        self.picture = ctx.framebuffer([self._texture])
        many = self.samples if self.samples > 1 else 0
        self._raw = None if many else _raw_texture(ctx, size)
        self._colour = ctx.renderbuffer(size, 4, samples=many) if self._raw is None else self._raw
        self._depth = ctx.depth_renderbuffer(size, samples=many)
        self._drawn = ctx.framebuffer([self._colour], self._depth)
        self._smooth = None if many else build(ctx, ("background.vert",), ("smooth.frag",))
        self._smoother = None if self._smooth is None else ctx.vertex_array(self._smooth, [])
        self._last: Region | None = None
        self._backdrop: tuple[object, object] | None = None
        self._shown: tuple[Renderer, int, Theme, Camera] | None = None

    def paint(self, renderer: Renderer, camera: Camera) -> None:
        """Draw the renderer's head as it was last uploaded; `picture` then holds it.

        A picture that would come out as it is already is left alone: a face at rest costs nothing.
        """
        shown = (renderer, renderer.revision, renderer.theme, camera)
        if shown == self._shown:
            return
        self._shown = shown
        whole = (0, 0, *self.size)
        region = renderer.region(camera, self.size)
        theme = renderer.theme
        backdrop = (theme.background_top, theme.background_bottom)
        dirty = whole if self._last is None or backdrop != self._backdrop else union(region, self._last)
        self._last, self._backdrop = region, backdrop
        if dirty[2] <= 0 or dirty[3] <= 0:
            return
        renderer.draw(camera, self._drawn, dirty)
        self._bring_together(dirty)

    def _bring_together(self, region: Region) -> None:
        """Samples or raw pixels of `region` to the picture."""
        self.picture.scissor = region
        if self._raw is None or self._smooth is None or self._smoother is None:
            self._ctx.copy_framebuffer(self.picture, self._drawn)
            return
        self.picture.use()
        self._ctx.enable_only(self._ctx.NOTHING)
        self._raw.use(1)
        put(self._smooth, {"picture": 1, "pixel": (1.0 / self.size[0], 1.0 / self.size[1])})
        self._smoother.render(vertices=3)

    def read(self) -> np.ndarray:
        """The picture, (height, width, 3) uint8, top row first."""
        width, height = self.size
        raw = self.picture.read(components=3, alignment=1)
        return np.flipud(np.frombuffer(raw, np.uint8).reshape(height, width, 3)).copy()

    def release(self) -> None:
        """Give the buffers back."""
        if self._smooth is not None and self._smoother is not None:
            self._smoother.release()
            self._smooth.release()
        for thing in (self._drawn, self.picture, self._colour, self._depth, self._texture):
            thing.release()


def _raw_texture(ctx: moderngl.Context, size: tuple[int, int]) -> moderngl.Texture:
    """A texture read pixel by pixel, its edge pixels standing for what lies outside."""
    texture = ctx.texture(size, 4)
    texture.filter = (ctx.NEAREST, ctx.NEAREST)
    texture.repeat_x = texture.repeat_y = False
    return texture


def union(a: Region, b: Region) -> Region:
    """Smallest rectangle (x, y, width, height) round both; an empty one adds nothing."""
    if a[2] <= 0 or a[3] <= 0:
        return b
    if b[2] <= 0 or b[3] <= 0:
        return a
    x, y = min(a[0], b[0]), min(a[1], b[1])
    right, top = max(a[0] + a[2], b[0] + b[2]), max(a[1] + a[3], b[1] + b[3])
    return x, y, right - x, top - y
