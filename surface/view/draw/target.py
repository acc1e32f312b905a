"""Render target: multisampled or smoothed, redrawing only the part of the picture that the head covers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from surface.view.draw.programs import build, set_uniforms
from surface.view.draw.renderer import Rectangles, Renderer
from surface.view.scene.bounds import Bands, corners
from surface.view.scene.camera import Camera
from surface.view.scene.theme import Theme

if TYPE_CHECKING:
    import moderngl

#: Pixels to each side that smooth.frag follows an edge.
_REACH = 10


class _Pass:
    """A fragment shader run over rectangles of a texture, into a framebuffer."""

    def __init__(
        self, ctx: moderngl.Context, shader: str, source: moderngl.Texture, into: moderngl.Framebuffer
    ) -> None:
        self._source, self.into = source, into
        self._program = build(ctx, ("background.vert",), (shader,))
        set_uniforms(self._program, {"picture": 1, "reach": _REACH})
        self._rectangles = Rectangles(ctx, self._program)

    def run(self, boxes: np.ndarray, size: tuple[int, int]) -> None:
        """Draw what lies within `boxes` (k, 4) of a picture of `size`, whatever the framebuffer's is."""
        if size != self.into.size:
            boxes = enlarged(boxes, size, self.into.size)
        self.into.scissor = 0, 0, *self.into.size
        self.into.use()
        self._source.use(1)
        self._rectangles.render(corners(boxes, self.into.size))

    def release(self) -> None:
        """Release what was made."""
        self._rectangles.release()
        self._program.release()


def _passes(ctx: moderngl.Context, raw: moderngl.Texture, picture: moderngl.Framebuffer) -> list[_Pass]:
    """What makes a picture of its pixels as they were drawn: smoothing, and enlarging where they are fewer."""
    if raw.size == picture.size:
        return [_Pass(ctx, "smooth.frag", raw, picture)]
    smoothed = ctx.texture(raw.size, 4)
    smoothed.repeat_x = smoothed.repeat_y = False
    first = _Pass(ctx, "smooth.frag", raw, ctx.framebuffer([smoothed]))
    return [first, _Pass(ctx, "enlarge.frag", smoothed, picture)]


class Target:
    """A picture in memory that a renderer is drawn into.

    With `samples` > 1 the head is drawn multisampled and resolved; with 1 it is drawn once per pixel and its edges are
    smoothed. The background does not move, so after the first frame only the bands of rows where the head is and where
    it was are drawn again: a software renderer's time goes to pixels.

    :meth:`paint` begins a picture, :meth:`complete` ends it. Between the two a software renderer fills its
    pixels on other threads, so the caller's other work belongs there.

    size : (width, height), pixels.
    samples : per pixel; capped at what the driver offers.
    scale : the head is drawn at this share of the size, up to 1, and enlarged; 1 where `samples` > 1.

    picture : the framebuffer that holds the picture; texture : its pixels.
    """

    def __init__(self, ctx: moderngl.Context, size: tuple[int, int], samples: int = 4, scale: float = 1.0) -> None:
        self._ctx, self.size = ctx, size
        self.samples = max(min(samples, ctx.max_samples), 1)
        single = self.samples == 1
        self.scale = scale if single else 1.0
        inner = max(1, round(size[0] * self.scale)), max(1, round(size[1] * self.scale))
        self.texture = ctx.texture(size, 4)
        self.picture = ctx.framebuffer([self.texture])
        raw, many = (ctx.texture(inner, 4), 0) if single else (None, self.samples)
        self._passes = [] if raw is None else _passes(ctx, raw, self.picture)
        colour = raw or ctx.renderbuffer(inner, 4, samples=many)
        self._drawn = ctx.framebuffer([colour], ctx.depth_renderbuffer(inner, samples=many))
        self._flush = ctx.framebuffer([ctx.renderbuffer((1, 1), 4)])
        self._last: Bands | None = None
        self._pending: Bands | None = None
        self._backdrop: tuple[object, object] | None = None
        self._shown: tuple[Renderer, int, Theme, Camera] | None = None

    def paint(self, renderer: Renderer, camera: Camera) -> None:
        """Begin to draw the renderer's head as it was last uploaded; :meth:`complete` ends it.

        A picture equal to the last one is not drawn again: a face at rest costs nothing.
        """
        shown = (renderer, renderer.revision, renderer.theme, camera)
        if shown == self._shown:
            return
        self.complete()
        self._shown = shown
        inner = self._drawn.size
        region = renderer.region(camera, inner)
        backdrop = (renderer.theme.background_top, renderer.theme.background_bottom)
        dirty = Bands.whole(inner)
        if self._last is not None and backdrop == self._backdrop:
            dirty = region.joined(self._last)
        self._last, self._backdrop = region, backdrop
        if not len(dirty.boxes()):
            return
        renderer.draw(camera, self._drawn, dirty)
        self._pending = dirty
        self._flush.clear()  # drawing elsewhere makes a software renderer's threads start on what was drawn

    def complete(self) -> None:
        """Resolve or smooth what was last painted into `picture`, waiting for it."""
        bands, self._pending = self._pending, None
        if bands is None:
            return
        if not self._passes:
            self.picture.scissor = bands.box()
            self._ctx.copy_framebuffer(self.picture, self._drawn)
            return
        boxes = bands.boxes()
        self._ctx.enable_only(self._ctx.NOTHING)
        for each in self._passes:
            each.run(boxes, self._drawn.size)

    def read(self) -> np.ndarray:
        """The picture, (height, width, 3) uint8, top row first."""
        self.complete()
        return read_pixels(self.picture)

    def release(self) -> None:
        """Release the buffers."""
        for each in self._passes:
            each.release()
        between = [each.into for each in self._passes[:-1]]
        for frame in (self._drawn, self.picture, self._flush, *between):
            for attachment in (*frame.color_attachments, frame.depth_attachment):
                if attachment is not None:
                    attachment.release()
            frame.release()


def read_pixels(picture: moderngl.Framebuffer) -> np.ndarray:
    """The pixels of a framebuffer, (height, width, 3) uint8, top row first."""
    width, height = picture.size
    raw = picture.read(components=3, alignment=1)
    return np.flipud(np.frombuffer(raw, np.uint8).reshape(height, width, 3)).copy()


def enlarged(boxes: np.ndarray, inner: tuple[int, int], size: tuple[int, int]) -> np.ndarray:
    """`boxes` (k, 4) of a picture of size `inner` in a picture of `size`, with the pixels their edges affect."""
    scale = np.divide(size, inner)
    low, high = (boxes[:, :2] - 1) * scale, (boxes[:, 2:] + 1) * scale
    return np.hstack([np.maximum(np.floor(low), 0), np.minimum(np.floor(high) + 1, size)]).astype(np.int64)
