"""The mouse on the face: Ctrl takes a point and moves parameters, Ctrl and Shift move control points."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from controller.base.parameters import PARAMETERS, Floats
from controller.body.messages import Hold
from controller.face.point_editing import PointEditor, Screen
from surface.head import Head
from surface.view.scene.camera import Camera


class MouseEditing:
    """Called once a frame, between the window's own panels.

    Parameters
    ----------
    head, copy : see :class:`controller.face.point_editing.PointEditor`.
    newest : gives the newest parameters, (p,) float64.
    tell : passes on which parameter is to be held.
    """

    def __init__(
        self, head: Head, copy: Callable[[], Head], newest: Callable[[], Floats], tell: Callable[[Hold], None]
    ) -> None:
        self.handles = PointEditor(head, copy, PARAMETERS)
        self._newest, self._tell = newest, tell
        self._name, self._said = "mine", ""

    def __call__(self, camera: Camera) -> None:
        """Take in this frame's mouse and keys."""
        from imgui_bundle import imgui  # optional

        io = imgui.get_io()
        screen = Screen(camera, (max(io.display_size.x, 1.0), max(io.display_size.y, 1.0)))
        self._mouse(imgui, io, screen)
        if self.handles.holding or io.key_ctrl:
            self.handles.prepare()
            imgui.set_next_frame_want_capture_mouse(True)  # the head is not turned meanwhile
            if not self.handles.ready:
                imgui.set_tooltip("getting ready to be taken by hand")
        if self.handles.reshaped:
            self._panel(imgui)

    def _mouse(self, imgui: Any, io: Any, screen: Screen) -> None:
        pixel, handles = (io.mouse_pos.x, io.mouse_pos.y), self.handles
        over_panel = imgui.is_window_hovered(imgui.HoveredFlags_.any_window)
        if io.key_ctrl and imgui.is_mouse_clicked(imgui.MouseButton_.left) and not over_panel:
            handles.take(pixel, screen, self._newest(), reshape=io.key_shift)
        if not handles.holding:
            return
        if not imgui.is_mouse_down(imgui.MouseButton_.left):
            handles.release()
            return
        for index, value in handles.drag(pixel, screen, self._newest()).items():
            self._tell(Hold(index, value))
        imgui.get_foreground_draw_list().add_circle(imgui.ImVec2(*pixel), 6.0, 0xFFFFFFFF)

    def _panel(self, imgui: Any) -> None:
        """Keep or drop what was reshaped."""
        if imgui.begin("reshaped", None, imgui.WindowFlags_.always_auto_resize)[0]:
            _, self._name = imgui.input_text("name", self._name)
            if imgui.button("save group"):
                self._save()
            imgui.same_line()
            if imgui.button("undo"):
                self.handles.undo()
            if self._said:
                imgui.text(self._said)
        imgui.end()

    def _save(self) -> None:
        path = Path(f"{self._name or 'mine'}.json").absolute()
        try:
            self.handles.save(path, self._name or "mine")
            self._said = f"wrote {path}"
        except OSError as error:
            self._said = f"{path}: {error.strerror}"
