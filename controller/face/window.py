"""Draws the face in a window, with the panel over it and points of the face that the mouse can drag.

Ctrl and the mouse drag a point by moving parameters; with Shift it moves control points.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.base.errors import ControllerError
from controller.base.parameters import PARAMETERS, Floats
from controller.body.messages import Hold, PanelRequest
from controller.body.panel_state import PanelState
from controller.face.face import FrameLog, HeadValues
from controller.face.panel import Panel
from controller.face.point_editing import PointEditor, Screen
from controller.stage.stage import FaceSettings
from surface.head import Head
from surface.view.scene.camera import Camera
from surface.view.scene.viewpoint import Viewpoint
from surface.view.window import run_window

_TITLE = "omote"


class WindowFace:
    """Draws the head in a window until it is closed.

    Parameters
    ----------
    head : the head to draw. settings : size, quality and camera. values : returns the head's newest values.
    send : sends the panel's requests to the body. panel_state : see :class:`controller.face.panel.Panel`.
    copy : loads the head again, for dragging points with the mouse; without, none can be dragged.
    """

    def __init__(
        self,
        head: Head,
        settings: FaceSettings,
        values: HeadValues,
        send: Callable[[PanelRequest], None],
        panel_state: PanelState | None = None,
        copy: Callable[[], Head] | None = None,
    ) -> None:
        self._head, self._settings, self._values = head, settings, values
        self._mouse = None if copy is None or settings.kiosk else MouseEditing(head, copy, lambda: values.full, send)
        self._panel = Panel(PARAMETERS, lambda: values.full, send, panel_state)
        self._log = FrameLog()

    def run(self, keep_going: Callable[[], bool]) -> None:
        """Show the window until it is closed or ``keep_going()`` is false; raises ViewError when none can be opened."""
        viewpoint = Viewpoint(self._settings.make_camera())
        began = time.monotonic_ns()

        def source() -> NDArray[np.float64]:
            nonlocal began
            values = self._values()
            now = time.monotonic_ns()
            self._log.add(values, began, now)
            began = now
            return values

        def gui() -> None:
            self._panel()
            if self._mouse is not None:
                self._mouse(viewpoint.camera)

        run_window(
            self._head,
            source,
            size=self._settings.size,
            title=_TITLE,
            gui=None if self._settings.kiosk else gui,
            keep_going=keep_going,
            camera=viewpoint,
            quality=self._settings.quality,
            theme=self._settings.make_theme(),
            evaluator=self._settings.evaluator,
            kiosk=self._settings.kiosk,
            monitor=self._settings.monitor,
        )

    def report(self) -> dict[str, object]:
        """Frames that were drawn; see :meth:`controller.face.face.FrameLog.report`."""
        return self._log.report(self._settings, "window")


class MouseEditing:
    """Drags points of the face with the mouse; called once a frame, between the window's own panels.

    Parameters
    ----------
    head, copy : see :class:`controller.face.point_editing.PointEditor`.
    newest : returns the newest parameters, (p,) float64. send : sends the parameters to hold.
    """

    def __init__(
        self, head: Head, copy: Callable[[], Head], newest: Callable[[], Floats], send: Callable[[Hold], None]
    ) -> None:
        self.editor = PointEditor(head, copy, PARAMETERS)
        self._newest, self._send = newest, send
        self._name, self._message = "mine", ""

    def __call__(self, camera: Camera) -> None:
        """Handle this frame's mouse and keys."""
        from imgui_bundle import imgui  # optional

        io = imgui.get_io()
        self._drag(imgui, io, Screen(camera, (max(io.display_size.x, 1.0), max(io.display_size.y, 1.0))))
        if self.editor.dragging or io.key_ctrl:
            self.editor.prepare()
            imgui.set_next_frame_want_capture_mouse(True)  # the mouse must not turn the head meanwhile
            if not self.editor.ready:
                imgui.set_tooltip("preparing to drag points")
        if self.editor.sculpted:
            self._panel(imgui)

    def _drag(self, imgui: Any, io: Any, screen: Screen) -> None:
        pixel, editor = (io.mouse_pos.x, io.mouse_pos.y), self.editor
        over_panel = imgui.is_window_hovered(imgui.HoveredFlags_.any_window)
        if io.key_ctrl and imgui.is_mouse_clicked(imgui.MouseButton_.left) and not over_panel:
            editor.take(pixel, screen, self._newest(), sculpt=io.key_shift)
        if not editor.dragging:
            return
        if not imgui.is_mouse_down(imgui.MouseButton_.left):
            editor.release()
            return
        for index, value in editor.drag(pixel, screen, self._newest()).items():
            self._send(Hold(index, value))
        imgui.get_foreground_draw_list().add_circle(imgui.ImVec2(*pixel), 6.0, 0xFFFFFFFF)

    def _panel(self, imgui: Any) -> None:
        """Buttons that save or undo the moved control points."""
        if imgui.begin("reshaped", None, imgui.WindowFlags_.always_auto_resize)[0]:
            _, self._name = imgui.input_text("name", self._name)
            if imgui.button("save group"):
                self._save()
            imgui.same_line()
            if imgui.button("undo"):
                self.editor.undo()
            if self._message:
                imgui.text(self._message)
        imgui.end()

    def _save(self) -> None:
        path = Path(f"{self._name or 'mine'}.json").absolute()
        try:
            self.editor.save(path, self._name or "mine")
            self._message = f"wrote {path}"
        except ControllerError as error:
            self._message = str(error)
