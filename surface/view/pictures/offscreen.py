"""Pictures without a window: an EGL context, a render target, numpy arrays out."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from surface.base.errors import ViewError
from surface.base.extras import importing
from surface.view.draw.alternating import Alternating
from surface.view.draw.fences import FrameFence
from surface.view.draw.renderer import Renderer
from surface.view.draw.target import Target, read_pixels
from surface.view.scene.camera import Camera
from surface.view.scene.choice import QualityChoice
from surface.view.scene.framing import framed
from surface.view.scene.parts import ViewHead
from surface.view.scene.sampling import AdaptiveSampling, is_software
from surface.view.scene.theme import Theme

if TYPE_CHECKING:
    import moderngl

NO_OPENGL_HINT = "apt-get install libegl1 libgl1 libgl1-mesa-dri"


def open_context() -> moderngl.Context:
    """A new context: EGL first (no display needed), then the platform's.

    Raises MissingPackage: moderngl is not installed. ViewError: there is no OpenGL 3.1.
    """
    with importing("a picture", "moderngl"):
        import moderngl  # optional: the extra view
    reasons = []
    for settings in ({"backend": "egl"}, {}):
        try:
            ctx = moderngl.create_context(standalone=True, require=310, **settings)  # type: ignore[arg-type]
        except Exception as error:  # noqa: BLE001 - glcontext raises bare Exception for every cause
            reasons.append(str(error).strip())
            continue
        ctx.clear_errors()
        return ctx
    raise ViewError(f"no OpenGL 3.1 without a window: {'; '.join(reasons)}", hint=NO_OPENGL_HINT)


class Offscreen:
    """A head drawn without a display; use as a context manager.

    head : anything with the parts of `surface.view.scene.parts.ViewHead`.
    size : (width, height), pixels.
    samples : per pixel; None = 4 for quality "full" and 1 with smoothed edges for "fast". After the first :meth:`draw`
        the picture is live, and "full" too falls back to 1 where 4 take too long; "fast" on a software renderer is then
        drawn at a share of its size (:data:`surface.view.scene.sampling.SCALE`) and enlarged.
    quality, theme, evaluator : see :class:`surface.view.draw.renderer.Renderer`.
    ctx : the context to draw in, which stays its owner's; None opens one.

    Raises ViewError: no OpenGL, or a size that no driver draws.
    """

    def __init__(
        self,
        head: ViewHead,
        size: tuple[int, int] = (1280, 720),
        samples: int | None = None,
        quality: str = "full",
        theme: str | Theme = "skin",
        evaluator: str = "auto",
        *,
        ctx: moderngl.Context | None = None,
    ) -> None:
        self.head, self._closed, self._owner = head, False, ctx is None
        self.ctx = ctx or open_context()
        limit = min(self.ctx.info["GL_MAX_VIEWPORT_DIMS"])
        if not all(1 <= length <= limit for length in size):
            if self._owner:
                self.ctx.release()
            raise ViewError(f"cannot draw {size[0]}x{size[1]} pixels", hint=f"choose a size from 1 to {limit}")
        self.renderer = Renderer(self.ctx, head, quality=quality, theme=theme, evaluator=evaluator)
        self._front = framed(Camera.front(), head, worn=self.renderer.theme.dressed)
        software = is_software(self.ctx)
        self._sampling = AdaptiveSampling(quality, samples, software=software)
        self._fence = None if software else FrameFence(self.ctx)
        self._settings = self._sampling.settings
        self.target = Target(self.ctx, size, *self._settings)

    def go_live(self) -> None:
        """Prepare for moving pictures, which the first :meth:`draw` would do otherwise."""
        self._sampling.start_live()
        self._make_current()
        self._apply_sampling()

    def draw(self, values: np.ndarray, camera: Camera | None = None) -> None:
        """Pose the head with `values` (P,) and draw it, without reading the picture back.

        A software renderer fills the last frame while the head is posed for this one, and is waited for then. On a
        graphics processor the frame before is waited for when this one has been given to it, so that it always has
        work, and there are never more than two frames in flight. :meth:`read` and :meth:`finish` wait for this one.
        """
        self._sampling.start_live()
        self._frame(values, camera)

    def render(self, values: np.ndarray, camera: Camera | None = None) -> np.ndarray:
        """Pose the head, draw it and return the picture as (height, width, 3) uint8, top row first."""
        self._frame(values, camera)
        return self.read()

    def render_present(self, camera: Camera | None = None, values: np.ndarray | None = None) -> np.ndarray:
        """As :meth:`render`, but of the head as it is, which somebody else has posed. The renderer's evaluator must be
        "cpu", and it must not draw fewer triangles. `values` : the parameters (P,) that it is posed by, which say how
        dark the floors of its wrinkles are; those of the last :meth:`render` without them."""
        self._make_current()
        if values is not None:
            self.renderer.take(values)
        self.renderer.update()
        self.target.paint(self.renderer, camera or self._front)
        return self.read()

    def _make_current(self) -> None:
        """Make the context current; another may have been since."""
        self.ctx.__enter__()  # type: ignore[no-untyped-call]  # moderngl has no types here

    def _frame(self, values: np.ndarray, camera: Camera | None) -> None:
        """Pose and draw."""
        self.renderer.pose(values)
        started = time.perf_counter()
        self._make_current()
        self.target.complete()
        if self._fence is None and not self._sampling.simplified:  # there, smoothing has just waited for everything
            self.ctx.finish()
        self._apply_sampling()
        self.renderer.update()
        self.target.paint(self.renderer, camera or self._front)
        if self._fence is not None:
            self._fence.end_frame()
        if self._sampling.live:
            self._sampling.add_frame(time.perf_counter() - started)

    def _apply_sampling(self) -> None:
        """Simplify the drawing, and replace the target by one with other samples, where the sampling says so."""
        if self._sampling.simplified:
            self.renderer.hurry()
        if self._settings != self._sampling.settings:
            self._settings, old = self._sampling.settings, self.target
            self.target = Target(
                self.ctx, old.size, *self._settings
            )  # before its framebuffer, still bound, is released
            old.release()

    def read(self) -> np.ndarray:
        """The picture last drawn, (height, width, 3) uint8, top row first."""
        self._make_current()
        return self.target.read()

    def finish(self) -> None:
        """Wait until the last frame is drawn."""
        self._make_current()
        self.target.complete()
        self.ctx.finish()

    def close(self) -> None:
        """Release everything; safe to call twice."""
        if self._closed:
            return
        self._closed = True
        self._make_current()
        self.renderer.release()
        self.target.release()
        if self._fence is not None:
            self._fence.release()
        if self._owner:
            self.ctx.release()

    def __enter__(self) -> Offscreen:
        return self

    def __exit__(self, *error: Any) -> None:
        self.close()


class AdaptiveOffscreen:
    """A head drawn live without a display in whichever quality holds ``rate_hz``, frames/s; a context manager.

    choice : which quality is drawn, and how long each was. now_s : the time, s; replaced in tests.
    Other arguments and errors as for :class:`Offscreen`.
    """

    def __init__(
        self,
        head: ViewHead,
        size: tuple[int, int] = (1280, 720),
        *,
        rate_hz: float,
        theme: str | Theme = "skin",
        evaluator: str = "auto",
        now_s: Callable[[], float] = time.perf_counter,
    ) -> None:
        full = Offscreen(head, size, quality="full", theme=theme, evaluator=evaluator)
        fast = Offscreen(head, size, quality="fast", theme=theme, evaluator=evaluator, ctx=full.ctx)
        self._full, self._fast, self.ctx, self.choice = full, fast, full.ctx, QualityChoice(rate_hz)
        self._alternating = Alternating({"full": full, "fast": fast}, self.choice, now_s=now_s)

    @property
    def renderer(self) -> Renderer:
        """The renderer whose picture is seen."""
        return self._alternating.shown.renderer

    def go_live(self) -> None:
        """Prepare for moving pictures, which the first :meth:`draw` would do otherwise."""
        self._full.go_live()
        self._fast.go_live()

    def draw(self, values: np.ndarray, camera: Camera | None = None) -> None:
        """As :meth:`Offscreen.draw`."""
        self._alternating.draw(values, camera)

    def read(self) -> np.ndarray:
        """The picture last drawn, (height, width, 3) uint8, top row first."""
        self._full._make_current()
        return read_pixels(self._alternating.picture())

    def close(self) -> None:
        """Release everything; safe to call twice."""
        self._alternating.release()
        self._fast.close()
        self._full.close()

    def __enter__(self) -> AdaptiveOffscreen:
        return self

    def __exit__(self, *error: Any) -> None:
        self.close()
