"""Draws the face in a window, with the panel over it and points of the face that the mouse can drag.

Ctrl and the mouse drag a point by moving parameters; with Shift it moves control points.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.base.errors import ControllerError
from controller.base.parameters import PARAMETERS, REGIONS, Floats
from controller.body.messages import Hold, Neutral, PanelRequest, Show, StartServos, StopServos
from controller.body.panel_state import PanelState
from controller.face.controls import Controls
from controller.face.devices import Devices
from controller.face.face import FrameLog, HeadValues, qualities
from controller.face.point_editing import PointEditor, Screen
from controller.stage.stage import FaceSettings
from controller.vocabulary.controls import ControlsFile
from controller.vocabulary.vocabulary import Vocabulary
from surface.head import Head
from surface.head.model.parameters import head_angles
from surface.view.scene.camera import Camera
from surface.view.scene.choice import QualityChoice
from surface.view.scene.framing import framed, framing_of
from surface.view.scene.viewpoint import Viewpoint
from surface.view.window import run_window

_TITLE = "omote"
_BUTTONS_A_ROW = 3
_CALM_S = 0.6
_STOP_HEIGHT = 36
_RED, _GREEN = (0.75, 0.1, 0.1, 1.0), (0.1, 0.5, 0.2, 1.0)


class WindowFace:
    """Draws the head in a window until it is closed.

    head : the head to draw. settings : size, quality and camera. values : returns the head's newest values.
    send : sends the panel's requests to the body. panel_state : see :class:`Panel`.
    copy : loads the head again, for dragging points with the mouse; without, none can be dragged.
    controls : what gamepad and keys do.
    """

    def __init__(
        self,
        head: Head,
        settings: FaceSettings,
        values: HeadValues,
        send: Callable[[PanelRequest], None],
        panel_state: PanelState | None = None,
        copy: Callable[[], Head] | None = None,
        controls: Collection[ControlsFile] = (),
    ) -> None:
        self._head, self._settings, self._values = head, settings, values
        self._devices = Devices(Controls(controls, PARAMETERS), send) if controls else None
        self._mouse = None if copy is None or settings.kiosk else MouseEditing(head, copy, lambda: values.full, send)
        self._panel = Panel(lambda: values.full, send, panel_state)
        self._log = FrameLog()
        self._choice = QualityChoice(settings.fps) if settings.quality == "auto" else None

    def run(self, keep_going: Callable[[], bool]) -> None:
        """Show the window until it is closed or ``keep_going()`` is false; raises ViewError when none can be opened."""
        viewpoint = Viewpoint(framed(self._settings.make_camera(), self._head), framing_of(self._head))
        began, stamp = time.monotonic_ns(), 0

        def source() -> NDArray[np.float64]:
            nonlocal began, stamp
            values = self._values()
            now = time.monotonic_ns()
            self._head.sway.advance(head_angles(values), now / 1e9)
            self._log.add(values, began, now, stamp)  # the frame before has been drawn by now
            began, stamp = now, self._values.stamp_ns
            return values

        def gui() -> None:
            if not self._settings.kiosk:
                self._panel()
            if self._devices is not None:
                self._devices()
            if self._mouse is not None:
                self._mouse(viewpoint.camera)

        run_window(
            self._head,
            source,
            size=self._settings.size,
            title=_TITLE,
            gui=None if self._settings.kiosk and self._devices is None else gui,
            keep_going=keep_going,
            camera=viewpoint,
            quality=self._choice or self._settings.still_quality,
            theme=self._settings.make_theme(),
            evaluator=self._settings.evaluator,
            kiosk=self._settings.kiosk,
            monitor=self._settings.monitor,
        )

    def report(self) -> dict[str, object]:
        """Frames that were drawn; see :meth:`controller.face.face.FrameLog.report`."""
        return {**self._log.report(self._settings, "window"), **qualities(self._choice)}


class Panel:
    """Draws the panel once a frame; arguments as for :class:`WindowFace`.

    Without ``panel_state``, neither the layer that holds a parameter nor what the servos show of it is drawn.
    """

    def __init__(
        self, newest: Callable[[], Floats], send: Callable[[PanelRequest], None], panel_state: PanelState | None = None
    ) -> None:
        self._newest, self._send, self._panel_state = newest, send, panel_state
        self._expressions = Vocabulary.load(PARAMETERS).names
        self._held: set[int] = set()
        self._intensity = 1.0

    def __call__(self) -> None:
        """Draw; called by the window between its frames."""
        from imgui_bundle import imgui  # optional

        imgui.set_next_window_pos(imgui.ImVec2(12, 12), imgui.Cond_.first_use_ever)
        imgui.set_next_window_size(imgui.ImVec2(320, 640), imgui.Cond_.first_use_ever)
        if self._panel_state is not None:
            self._panel_state.refresh()
        if imgui.begin("omote")[0]:
            self._stop_or_start(imgui)
            self._top(imgui)
            for region in REGIONS:
                if imgui.collapsing_header(f"{region}{self._away(region)}###{region}"):
                    self._sliders(imgui, PARAMETERS.region(region))
        imgui.end()

    def _stop_or_start(self, imgui: Any) -> None:
        """The button that stops the servos; while they are stopped, who did it and the button that ends that."""
        by = self._panel_state.stopped_by if self._panel_state is not None else ""
        if by:
            imgui.text(f"servos stopped by {by}")
        label, colour, request = ("START servos", _GREEN, StartServos()) if by else ("STOP servos", _RED, StopServos())
        imgui.push_style_color(imgui.Col_.button, imgui.ImVec4(*colour))
        if imgui.button(label, imgui.ImVec2(-1, _STOP_HEIGHT)):
            self._send(request)
        imgui.pop_style_color()

    def _top(self, imgui: Any) -> None:
        imgui.text(f"{imgui.get_io().framerate:.0f} frames/s")
        imgui.same_line()
        if imgui.small_button("release all"):
            self._held.clear()
            self._send(Neutral(_CALM_S))
        _, self._intensity = imgui.slider_float("intensity", self._intensity, 0.0, 1.0)
        gap = imgui.get_style().item_spacing.x
        width = (imgui.get_content_region_avail().x + gap) / _BUTTONS_A_ROW - gap
        for i, name in enumerate(self._expressions):
            if i % _BUTTONS_A_ROW:
                imgui.same_line()
            if imgui.button(name, imgui.ImVec2(width, 0)):
                self._send(Show(name, self._intensity))

    def _away(self, region: str) -> str:
        """How far the servos of a region are from their wanted angles, for its title."""
        away = None if self._panel_state is None else self._panel_state.away_deg(region)
        return "" if away is None else f"   servos {away:.1f} deg away"

    def _holder(self, imgui: Any, index: int) -> None:
        """Which layer holds a parameter, and what the servos show of it."""
        if self._panel_state is None:
            return
        measured = self._panel_state.measured(index)
        shown = "" if measured is None else f"  servos {measured:.2f}"
        imgui.same_line()
        imgui.text_disabled(f"{self._panel_state.holder(index)}{shown}")

    def _sliders(self, imgui: Any, members: NDArray[np.intp]) -> None:
        values = self._newest()
        for index in map(int, members):
            low, high = PARAMETERS.low[index], PARAMETERS.high[index]
            moved, value = imgui.slider_float(PARAMETERS.names[index], float(values[index]), low, high)
            if moved:
                self._held.add(index)
                self._send(Hold(index, float(np.clip(value, low, high))))
            if index in self._held:
                imgui.same_line()
                if imgui.small_button(f"x##{index}"):
                    self._held.discard(index)
                    self._send(Hold(index, None))
            self._holder(imgui, index)


class MouseEditing:
    """Drags points of the face with the mouse; called once a frame. ``send`` : sends the parameters to hold."""

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
