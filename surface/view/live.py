"""A head that is drawn frame after frame in one quality, in a context whose size changes."""

from __future__ import annotations

import time

import numpy as np

from surface.view.draw.renderer import Renderer
from surface.view.draw.target import Target
from surface.view.scene.camera import Camera
from surface.view.scene.sampling import AdaptiveSampling, is_software


class LiveDrawing:
    """The head in one quality, on a context whose size changes.

    size : (width, height), pixels, of the next frame.
    posed_elsewhere : somebody else poses the head, for :meth:`draw_present`; all its triangles are drawn then. The
        renderer's evaluator must be "cpu".
    """

    target: Target

    def __init__(self, renderer: Renderer, *, posed_elsewhere: bool = False) -> None:
        self.renderer, self.size = renderer, (1, 1)
        self._sampling = AdaptiveSampling(renderer.quality, software=is_software(renderer.ctx))
        self._sampling.start_live()
        if self._sampling.simplified and not posed_elsewhere:
            renderer.hurry()
        self._settings: tuple[object, ...] = ()

    def draw(self, values: np.ndarray, camera: Camera | None = None) -> None:
        """Pose the head with ``values`` (P,) and draw it."""
        self.renderer.pose(values)
        self.draw_present(camera)

    def draw_present(self, camera: Camera | None = None) -> None:
        """Draw the head in its present pose."""
        started, settings = time.perf_counter(), (*self.size, *self._sampling.settings)
        if self._settings != settings:
            old = self.target if self._settings else None
            self.target = Target(self.renderer.ctx, self.size, *self._sampling.settings)
            self._settings = settings
            if old is not None:
                old.release()
        self.renderer.update()
        self.target.paint(self.renderer, camera or Camera.front())
        self.target.complete()
        self._sampling.add_frame(time.perf_counter() - started)

    def release(self) -> None:
        """Release the graphics memory."""
        if self._settings:
            self.target.release()
        self.renderer.release()
