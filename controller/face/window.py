"""The face in a window, with the panel over it."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from controller.base.parameters import PARAMETERS
from controller.body.process import BodyProcess
from controller.face.face import FrameLog, HeadValues
from controller.face.mouse import MouseEditing
from controller.face.panel import Panel
from controller.stage.stage import FaceSettings
from surface.head import Head
from surface.view.scene.viewpoint import Viewpoint
from surface.view.window import run_window

_TITLE = "omote"


class WindowFace:
    """Draws the head in a window until it is closed.

    Parameters
    ----------
    head : the head to draw.
    settings : size, quality and camera.
    values : gives the head's newest values.
    body : hears what the panel wants.
    copy : loads the head again, for points that are taken with the mouse; none can be without.
    """

    def __init__(
        self,
        head: Head,
        settings: FaceSettings,
        values: HeadValues,
        body: BodyProcess,
        copy: Callable[[], Head] | None = None,
    ) -> None:
        self._head = head
        self._mouse = (
            None if copy is None or settings.kiosk else MouseEditing(head, copy, lambda: values.full, body.tell)
        )
        self._settings = settings
        self._values = values
        self._panel = Panel(PARAMETERS, lambda: values.full, body.tell, getattr(body, "insight", None))
        self._log = FrameLog()

    def run(self, keep_going: Callable[[], bool]) -> None:
        """Show the window until it is closed or ``keep_going()`` is false.

        Raises
        ------
        ViewError
            when no window can be opened.
        """
        viewpoint = Viewpoint(self._settings.make_camera())
        began = time.monotonic_ns()

        def source() -> NDArray[np.float64]:
            nonlocal began
            values = self._values()
            now = time.monotonic_ns()
            self._log.add(values, began, now)
            began = now
            return values

        run_window(
            self._head,
            source,
            size=self._settings.size,
            title=_TITLE,
            gui=None if self._settings.kiosk else lambda: self._gui(viewpoint),
            keep_going=keep_going,
            camera=viewpoint,
            quality=self._settings.quality,
            theme=self._settings.make_theme(),
            evaluator=self._settings.evaluator,
            kiosk=self._settings.kiosk,
            monitor=self._settings.monitor,
        )

    def _gui(self, viewpoint: Viewpoint) -> None:
        self._panel()
        if self._mouse is not None:
            self._mouse(viewpoint.camera)

    def report(self) -> dict[str, object]:
        """What was drawn; see :meth:`controller.face.face.FrameLog.report`."""
        return self._log.report(self._settings, "window")
