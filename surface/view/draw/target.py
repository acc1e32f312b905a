"""Where a picture is drawn: samples or smoothing, and only the part of the screen that the head touches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from surface.view.draw.programs import build, put
from surface.view.draw.renderer import Rectangles, Renderer
from surface.view.scene.bounds import Bands, corners
from surface.view.scene.camera import Camera
from surface.view.scene.theme import Theme

if TYPE_CHECKING:
    import moderngl


class Target:
    """A picture in memory that a renderer is drawn into.

    With `samples` > 1 the head is drawn multisampled and brought together; with 1 it is drawn once per
    pixel and its edges are smoothed. The background stands still, so after the first frame only the
    bands of rows where the head is and where it was are drawn again: on a software renderer pixels are what
    costs.

    :meth:`paint` begins a picture, :meth:`complete` ends it. Between the two a software renderer fills its
    pixels on other threads, so whoever has something else to do does it there.

    Parameters
    ----------
    size : (width, height), pixels.
    samples : per pixel; capped at what the driver offers.
    scale : the head is drawn at this share of the size, up to 1, and enlarged; 1 where `samples` > 1.
    """

    def __init__(self, ctx: moderngl.Context, size: tuple[int, int], samples: int = 4, scale: float = 1.0) -> None:
        self._ctx, self.size = ctx, size
        samples = min(samples, ctx.max_samples)
        self.samples = samples if samples > 1 else 1
        self.scale = scale if self.samples == 1 else 1.0
        inner = max(1, round(size[0] * self.scale)), max(1, round(size[1] * self.scale))
        self._texture = ctx.texture(size, 4)
        self.picture = ctx.framebuffer([self._texture])
        self._raw = _texture(ctx, inner) if self.samples == 1 else None
        self._drawn = _drawn(ctx, inner, self.samples, self._raw)
        self._kick = ctx.framebuffer([ctx.renderbuffer((1, 1), 4)])
        shader = "smooth.frag" if inner == size else "enlarge.frag"
        self._smooth = None if self._raw is None else Pass(ctx, shader, size, inner)
        self._last: Bands | None = None
        self._pending: Bands | None = None
        self._backdrop: tuple[object, object] | None = None
        self._shown: tuple[Renderer, int, Theme, Camera] | None = None

    def paint(self, renderer: Renderer, camera: Camera) -> None:
        """Begin to draw the renderer's head as it was last uploaded; :meth:`complete` ends it.

        A picture that would come out as it is already is left alone: a face at rest costs nothing.
        """
        shown = (renderer, renderer.revision, renderer.theme, camera)
        if shown == self._shown:
            return
        self.complete()
        self._shown = shown
        inner = self._drawn.size
        region = renderer.region(camera, inner)
        backdrop = (renderer.theme.background_top, renderer.theme.background_bottom)
        whole = self._last is None or backdrop != self._backdrop
        dirty = Bands.whole(inner) if whole else region.joined(self._last or region)
        self._last, self._backdrop = region, backdrop
        if not len(dirty.boxes()):
            return
        renderer.draw(camera, self._drawn, dirty)
        self._pending = dirty
        self._kick.clear()  # drawing elsewhere sets a software renderer's threads to work on what was drawn

    def complete(self) -> None:
        """Bring the samples or raw pixels last painted to `picture`, waiting for them."""
        bands, self._pending = self._pending, None
        if bands is None:
            return
        boxes, inner = bands.boxes(), self._drawn.size
        if self._smooth is None or self._raw is None:
            self.picture.scissor = bands.box()
            self._ctx.copy_framebuffer(self.picture, self._drawn)
            return
        self._smooth.render(self._raw, self.picture, boxes if inner == self.size else enlarged(boxes, inner, self.size))

    def read(self) -> np.ndarray:
        """The picture, (height, width, 3) uint8, top row first."""
        self.complete()
        width, height = self.size
        raw = self.picture.read(components=3, alignment=1)
        return np.flipud(np.frombuffer(raw, np.uint8).reshape(height, width, 3)).copy()

    def release(self) -> None:
        """Give the buffers back."""
        if self._smooth is not None:
            self._smooth.release()
        for frame in (self._drawn, self.picture, self._kick):
            for attachment in (*frame.color_attachments, frame.depth_attachment):
                if attachment is not None:
                    attachment.release()
            frame.release()


class Pass:
    """One fragment shader over rectangles of a picture.

    Parameters
    ----------
    shader : its file; reads the sampler `picture` and, where it has it, the uniform `share`.
    size, inner : (width, height) of what it writes and of what it reads; `share` is the second beside the first.
    """

    def __init__(self, ctx: moderngl.Context, shader: str, size: tuple[int, int], inner: tuple[int, int]) -> None:
        self._ctx, self._size = ctx, size
        self._program = build(ctx, ("background.vert",), (shader,))
        self._array = Rectangles(ctx, self._program)
        put(self._program, {"picture": 1, "share": np.divide(inner, size)})

    def render(self, source: moderngl.Texture, target: moderngl.Framebuffer, boxes: np.ndarray) -> None:
        """Fill `boxes` (k, 4), pixels from left and bottom to right and top, of `target`."""
        target.scissor = 0, 0, *self._size
        target.use()
        self._ctx.enable_only(self._ctx.NOTHING)
        source.use(1)
        self._array.render(corners(boxes, self._size))

    def release(self) -> None:
        """Give the program back."""
        self._array.release()
        self._program.release()


def _drawn(
    ctx: moderngl.Context, size: tuple[int, int], samples: int, raw: moderngl.Texture | None
) -> moderngl.Framebuffer:
    """What the head is drawn into: the texture `raw`, which is smoothed later, or many samples."""
    many = 0 if raw is not None else samples
    colour = raw if raw is not None else ctx.renderbuffer(size, 4, samples=many)
    return ctx.framebuffer([colour], ctx.depth_renderbuffer(size, samples=many))


def _texture(ctx: moderngl.Context, size: tuple[int, int]) -> moderngl.Texture:
    """A texture whose texels are read one by one."""
    texture = ctx.texture(size, 4)
    texture.filter = (ctx.NEAREST, ctx.NEAREST)
    return texture


def enlarged(boxes: np.ndarray, inner: tuple[int, int], size: tuple[int, int]) -> np.ndarray:
    """`boxes` (k, 4) of a picture of size `inner` in a picture of `size`, with the pixels their edges reach."""
    scale = np.divide(size, inner)
    low, high = (boxes[:, :2] - 1) * scale, (boxes[:, 2:] + 1) * scale
    return np.hstack([np.maximum(np.floor(low), 0), np.minimum(np.floor(high) + 1, size)]).astype(np.int64)
