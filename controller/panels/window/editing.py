"""Points of the face that the mouse drags, and where it makes the face look.

Ctrl and the mouse drag a point by moving parameters; with Shift it moves control points. Alt and the mouse turn the
gaze.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from controller.base.parameters import PARAMETERS, Floats, Parameters
from controller.face.point_editing import PointEditor, Screen
from controller.panels.session.commands import Commands
from surface.head import Head
from surface.view.docks import PictureArea
from surface.view.scene.camera import Camera

_WHITE, _PIN = 0xFFFFFFFF, 0xFF3C78E6


class MouseEditing:
    """Drags points of the face with the mouse; called once a frame.

    area : where the picture is. copy : loads the same head again. newest : the newest parameters (P,).
    parameters : of the stage; those of the base vocabulary without.
    """

    def __init__(
        self, head: Head, copy: Callable[[], Head], newest: Callable[[], Floats], commands: Commands, area: PictureArea,
        parameters: Parameters | None = None,
    ) -> None:  # fmt: skip
        self._parameters = parameters or PARAMETERS
        self._newest, self._commands, self._area, self._copy = newest, commands, area, copy
        self._symmetric, self._pinning = False, False
        self._grabs, self._pixel = 0, (0.0, 0.0)
        commands.show_moves = self._show_moves
        self.change(head)

    def change(self, head: Head) -> None:
        """Drag points of another head from now on; control points stay moved where it has as many."""
        self.editor = PointEditor(head, self._copy, self._parameters)
        self._eyes = head.data.eyes.mean(axis=0)
        if self._commands.now.moves is not None:
            self._show_moves(self._commands.now.moves)

    def find_editor(self) -> PointEditor:
        """What drags the points of the head that is shown now."""
        return self.editor

    def _show_moves(self, moves: Floats | None) -> None:
        fits = moves is not None and moves.shape == self.editor.moves.shape
        self.editor.set_moves(moves if fits else None)

    def __call__(self, camera: Camera) -> None:
        """Handle this frame's mouse and keys."""
        from imgui_bundle import imgui  # optional

        io, area = imgui.get_io(), self._area
        screen = Screen(camera, (max(area.width, 1.0), max(area.height, 1.0)))
        pixel = (io.mouse_pos.x - area.left, io.mouse_pos.y - area.top)
        outside = imgui.is_window_hovered(imgui.HoveredFlags_.any_window)
        self._drag(imgui, io, pixel, screen, outside)
        self._draw_pins(imgui, screen)
        if io.key_alt and imgui.is_mouse_down(imgui.MouseButton_.left) and not outside:
            self.look(pixel, camera, screen)
        if self.editor.dragging or io.key_ctrl or io.key_alt:
            imgui.set_next_frame_want_capture_mouse(True)  # the mouse must not turn the head meanwhile

    def look(self, pixel: tuple[float, float], camera: Camera, screen: Screen) -> None:
        """Make the face look at what is under a pixel, half-way between its eyes and the camera."""
        towards = np.asarray(camera.eye, np.float64)
        point = screen.place(pixel, self._eyes + 0.5 * (towards - self._eyes)) - self._eyes
        self._commands.look((float(point[0]), float(point[1]), float(point[2])), "gaze")

    def _drag(self, imgui: Any, io: Any, pixel: tuple[float, float], screen: Screen, outside: bool) -> None:
        editor = self.editor
        if io.key_ctrl:
            editor.prepare()
        if io.key_ctrl and imgui.is_mouse_clicked(imgui.MouseButton_.left) and not outside:
            editor.take(pixel, screen, self._newest(), sculpt=io.key_shift, tied=self._symmetric)
            self._grabs += 1
        if not editor.dragging:
            return
        if not editor.ready:
            imgui.set_tooltip("preparing to drag points")
        down = imgui.is_mouse_down(imgui.MouseButton_.left)
        self._pixel = pixel if down else self._pixel  # a mouse let go while points get ready has gone on since
        moved = editor.drag(self._pixel, screen, self._newest())
        if moved:
            self._commands.hold(moved, ("drag", self._grabs))
        imgui.get_foreground_draw_list().add_circle(io.mouse_pos, 6.0, _WHITE)
        if not down and editor.settled:
            self._release()

    def _release(self) -> None:
        before = self._commands.now.moves
        if self._pinning:
            self.editor.pin(self._face_wanted())
        self.editor.release()
        moves = self.editor.moves
        if moves is not before and (before is not None or moves.any()):
            self._commands.move(moves)

    def _face_wanted(self) -> Floats:
        """(P,) the face with what is held by hand, which it may still be on its way to."""
        values = self._newest().copy()
        for index, value in self._commands.now.held.items():
            values[index] = value
        return values

    def _draw_pins(self, imgui: Any, screen: Screen) -> None:
        draw, area = imgui.get_foreground_draw_list(), self._area
        for x, y in self.editor.pin_pixels(screen, self._newest()):
            at = imgui.ImVec2(area.left + x, area.top + y)
            draw.add_circle_filled(at, 4.0, _PIN)
            draw.add_circle(at, 4.0, _WHITE)

    def draw_panel(self) -> None:
        """The part of the panel about dragging, and about control points that were moved."""
        from imgui_bundle import imgui  # optional

        imgui.text_wrapped("Ctrl and drag a point of the face: sliders follow. With Shift: the skin itself.")
        _, self._symmetric = imgui.checkbox("move both sides", self._symmetric)
        _, self._pinning = imgui.checkbox("pin points where they are let go", self._pinning)
        if self.editor.pinned and imgui.button(f"unpin all {self.editor.pinned}"):
            self.editor.unpin()
        if not self.editor.sculpted:
            return
        if imgui.button("smooth it out"):
            self._commands.move(None)
        imgui.text_disabled("save it as a group or corrective: tab Faces")
