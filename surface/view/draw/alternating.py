"""Draws a live picture in whichever quality holds a wanted rate, and dissolves from one to the other."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Protocol

import numpy as np

from surface.view.draw.programs import build, set_uniforms
from surface.view.draw.renderer import Rectangles, Renderer
from surface.view.draw.target import Target
from surface.view.scene.bounds import Bands, corners
from surface.view.scene.camera import Camera
from surface.view.scene.choice import QualityChoice

if TYPE_CHECKING:
    import moderngl


class Drawing(Protocol):
    """What draws a head in one quality."""

    renderer: Renderer

    @property
    def target(self) -> Target: ...
    def draw(self, values: np.ndarray, camera: Camera | None = None) -> None: ...


class Alternating:
    """Several drawings of one head, of which the choice says which are drawn.

    drawings : by quality, in one context. choice : decides. now_s : the time, s; replaced in tests.
    """

    def __init__(
        self,
        drawings: Mapping[str, Drawing],
        choice: QualityChoice,
        *,
        now_s: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._drawings, self.choice, self._now_s = drawings, choice, now_s
        self._dissolve: Dissolve | None = None
        for drawing in drawings.values():
            drawing.renderer.resend = True

    def draw(self, values: np.ndarray, camera: Camera | None = None) -> None:
        """Pose the head with ``values`` (P,) and draw the next frame."""
        began_s = self._now_s()
        for quality in self.choice.begin(values, began_s):
            self._drawings[quality].draw(values, camera)
        self.choice.end(self._now_s() - began_s)

    @property
    def shown(self) -> Drawing:
        """The drawing that is seen, or that the picture dissolves into."""
        return self._drawings[self.choice.level]

    def picture(self) -> moderngl.Framebuffer:
        """The whole picture last drawn; waits for it."""
        targets = [self._drawings[quality].target for quality in self.choice.drawn]
        for target in targets:
            target.complete()
        if len(targets) == 1:
            return targets[0].picture
        ctx = self.shown.renderer.ctx
        if self._dissolve is None or self._dissolve.picture.size != targets[0].size:
            self.release()
            self._dissolve = Dissolve(ctx, targets[0].size)
        return self._dissolve.mix(targets[0], targets[1], self.choice.share)

    def release(self) -> None:
        """Release what dissolves; the drawings are their owner's."""
        if self._dissolve is not None:
            self._dissolve.release()
            self._dissolve = None


class Dissolve:
    """Mixes the pictures of two targets of one size (width, height) into ``picture``."""

    def __init__(self, ctx: moderngl.Context, size: tuple[int, int]) -> None:
        self._ctx, self.picture = ctx, ctx.framebuffer([ctx.texture(size, 4)])
        self._program = build(ctx, ("background.vert",), ("dissolve.frag",))
        self._whole = Rectangles(ctx, self._program)

    def mix(self, before: Target, after: Target, share: float) -> moderngl.Framebuffer:
        """The picture with ``share`` 0..1 of the second; both are complete."""
        set_uniforms(self._program, {"before": 1, "after": 2, "share": share})
        self.picture.scissor = 0, 0, *self.picture.size
        self.picture.use()
        self._ctx.enable_only(self._ctx.NOTHING)
        for unit, target in enumerate((before, after), start=1):
            target.texture.use(unit)
        self._whole.render(corners(Bands.whole(self.picture.size).boxes(), self.picture.size))
        return self.picture

    def release(self) -> None:
        """Release the graphics memory."""
        self._whole.release()
        self._program.release()
        self.picture.color_attachments[0].release()
        self.picture.release()
