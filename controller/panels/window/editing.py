"""Points of the face that the mouse drags, lines that it draws on the skin, and where it makes the face look.

Ctrl and the mouse use the chosen tool: they drag a point by moving parameters or control points, add control points,
draw a wrinkle, or take added points out. With Shift they always move control points. Alt and the mouse turn the gaze.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal, get_args

import numpy as np

from controller.base.parameters import PARAMETERS, Floats, Parameters
from controller.face.point_editing import PointEditor
from controller.face.skin_model import Screen, SkinModels
from controller.panels.session.commands import Commands
from surface.head import Head
from surface.head.model.light import LightPoints
from surface.view.docks import PictureArea
from surface.view.scene.camera import Camera

_WHITE, _PIN, _ADDED = 0xFFFFFFFF, 0xFF3C78E6, 0xFF50D2F0
_MIN_PICKS = 3  # of a line
Tool = Literal["pull the face", "pull the skin", "wrinkle", "add points", "remove points"]
TOOLS: tuple[Tool, ...] = get_args(Tool)


@dataclass
class Brush:
    """What Ctrl and the mouse do.

    tool : one of :data:`TOOLS`. symmetric : on both sides of the face. pinning : points stay where they are let go.
    falloff_mm : how far from the mouse the skin is pulled along. depth_mm, width_mm : of a wrinkle.
    reach_mm : how far from its middle an added point moves the skin.
    """

    tool: Tool = "pull the face"
    symmetric: bool = False
    pinning: bool = False
    falloff_mm: float = 22.0
    depth_mm: float = 1.2
    width_mm: float = 3.0
    reach_mm: float = 8.0


class MouseEditing:
    """Drags points of the face with the mouse; called once per frame.

    area : where the picture is. copy : loads the same head again, without the control points that were added here.
    newest : the newest parameters (P,).
    parameters : of the stage; those of the base vocabulary without.

    Attributes
    ----------
    brush : what Ctrl and the mouse do. message : what the last use of a tool came to, where that is not seen.
    can_add : whether control points can be added here.
    """

    def __init__(
        self, head: Head, copy: Callable[[], Head], newest: Callable[[], Floats], commands: Commands, area: PictureArea,
        parameters: Parameters | None = None,
    ) -> None:  # fmt: skip
        self._parameters = parameters or PARAMETERS
        self._newest, self._commands, self._area, self._copy = newest, commands, area, copy
        self.brush, self.message = Brush(), ""
        self.can_add = False
        self._stroke: list[tuple[float, float]] = []
        self._grabs, self._pixel = 0, (0.0, 0.0)
        commands.show_moves = self._show_moves
        self.change(head)

    def change(self, head: Head, light: Sequence[LightPoints] = (), *, same: bool = False) -> None:
        """Drag points of another head from now on; control points stay moved where it has as many.

        light : the control points that the user has added to it. same : only these differ from the head before.
        """
        if not same:
            self._models = SkinModels(self._copy, self._parameters)
        self.editor = PointEditor(head, self._models, light)
        self._stroke = []
        self._eyes = head.data.eyes.mean(axis=0)
        if light or self.brush.tool != TOOLS[0]:
            self.editor.prepare()
        if self._commands.now.moves is not None:
            self._show_moves(self._commands.now.moves)

    def keep_points(self) -> None:
        """Let those control points be the added ones that the shown head has."""
        now, editor = self._commands.now, self.editor
        moves = editor.convert_moves(now.moves, now.light)
        self._commands.change(replace(now, light=editor.light, moves=moves))

    def find_editor(self) -> PointEditor:
        """Return what drags the points of the head that is shown now."""
        return self.editor

    def _show_moves(self, moves: Floats | None) -> None:
        self.editor.set_moves(self.editor.convert_moves(moves, self._commands.now.light))

    def __call__(self, camera: Camera) -> None:
        """Handle this frame's mouse and keys."""
        from imgui_bundle import imgui  # optional

        io, area = imgui.get_io(), self._area
        screen = Screen(camera, (max(area.width, 1.0), max(area.height, 1.0)))
        pixel = (io.mouse_pos.x - area.left, io.mouse_pos.y - area.top)
        outside = imgui.is_window_hovered(imgui.HoveredFlags_.any_window)
        self._use(imgui, io, pixel, screen, outside)
        self._draw_pins(imgui, screen)
        if io.key_alt and imgui.is_mouse_down(imgui.MouseButton_.left) and not outside:
            self.look(pixel, camera, screen)
        if self.editor.dragging or self._stroke or io.key_ctrl or io.key_alt:
            imgui.set_next_frame_want_capture_mouse(True)  # the mouse must not turn the head meanwhile

    def look(self, pixel: tuple[float, float], camera: Camera, screen: Screen) -> None:
        """Make the face look at what is under a pixel, half-way between its eyes and the camera."""
        towards = np.asarray(camera.eye, np.float64)
        point = screen.place(pixel, self._eyes + 0.5 * (towards - self._eyes)) - self._eyes
        self._commands.set_gaze((float(point[0]), float(point[1]), float(point[2])), "gaze")

    def _use(self, imgui: Any, io: Any, pixel: tuple[float, float], screen: Screen, outside: bool) -> None:
        """Use the tool where Ctrl and the mouse are pressed, and continue an action that has begun."""
        tool, editor = self.brush.tool, self.editor
        sculpt = io.key_shift or tool == "pull the skin"
        if io.key_ctrl:
            editor.prepare()
        clicked = io.key_ctrl and imgui.is_mouse_clicked(imgui.MouseButton_.left) and not outside
        if tool == "wrinkle" and not io.key_shift:
            self._draw_line(imgui, pixel, screen, clicked)
        elif tool == "remove points" and clicked and not io.key_shift:
            self._remove(pixel, screen)
        elif clicked and tool == "add points" and not io.key_shift:
            self._add(pixel, screen)
        elif clicked:
            brush, values = self.brush, self._newest()
            editor.take(
                pixel, screen, values, sculpt=sculpt, tied=brush.symmetric, falloff_mm=brush.falloff_mm
            )  # fmt: skip
            self._grabs += 1
        self._drag(imgui, io, pixel, screen)

    def _add(self, pixel: tuple[float, float], screen: Screen) -> None:
        """Take an added point under the mouse, or add one where there is none."""
        editor, brush, values = self.editor, self.brush, self._newest()
        if editor.take_light(pixel, screen, values, tied=brush.symmetric) is not None or not self._may_add():
            return
        light = editor.point_at(pixel, screen, values, brush.reach_mm, tied=brush.symmetric)
        if light is None:
            self.message = "no skin there: click on the face"
            return
        self._commands.add_points(light, np.zeros((len(light), 3)), editor.own)
        self.message = "added: the skin is as it was. Ctrl and drag the point"

    def _remove(self, pixel: tuple[float, float], screen: Screen) -> None:
        found = self.editor.light_at(pixel, screen, self._newest())
        if found is None:
            self.message = "no added point there: only points that were added can be taken out"
        elif self._may_add():
            self._commands.remove_point(found)
            self.message = ""

    def _draw_line(self, imgui: Any, pixel: tuple[float, float], screen: Screen, clicked: bool) -> None:
        """Follow the mouse over the skin; let go, the line is a wrinkle."""
        if clicked and self._may_add():
            self._stroke = [pixel]
        if not self._stroke:
            return
        if imgui.is_mouse_down(imgui.MouseButton_.left):
            if np.hypot(pixel[0] - self._stroke[-1][0], pixel[1] - self._stroke[-1][1]) >= 1.0:
                self._stroke.append(pixel)
            draw, left, top = imgui.get_background_draw_list(), self._area.left, self._area.top
            points = [imgui.ImVec2(left + x, top + y) for x, y in self._stroke]
            for one, two in pairwise(points):
                draw.add_line(one, two, _WHITE, 2.0)
            return
        stroke, self._stroke = self._stroke, []
        self._wrinkle(stroke, screen)

    def _wrinkle(self, stroke: Sequence[tuple[float, float]], screen: Screen) -> None:
        brush, values = self.brush, self._newest()
        made = None
        if len(stroke) >= _MIN_PICKS:
            made = self.editor.wrinkle(
                stroke, screen, values, brush.depth_mm, brush.width_mm, tied=brush.symmetric
            )  # fmt: skip
        if made is None:
            self.message = "too short for a wrinkle: draw a longer line on the face"
            return
        self._commands.add_points(*made, self.editor.own)
        self.message = ""

    def _may_add(self) -> bool:
        """Whether points can be added or removed now; ``message`` says why not."""
        if not self.can_add:
            self.message = "points cannot be added here: open a stage with omote edit"
        elif not self.editor.ready:
            self.message = "preparing the face: try again in a moment"
        elif self.editor.light != self._commands.now.light:
            self.message = "the last change is on its way: try again in a moment"
        else:
            return True
        return False

    def _drag(self, imgui: Any, io: Any, pixel: tuple[float, float], screen: Screen) -> None:
        editor = self.editor
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
        if self.brush.pinning:
            self.editor.pin(self._face_wanted())
        self.editor.release()
        moves = self.editor.moves
        if moves is not before and (before is not None or moves.any()):
            self._commands.set_moves(moves)

    def _face_wanted(self) -> Floats:
        """Return (P,): the face with what is held by hand, which it may still be on its way to."""
        values = self._newest().copy()
        for index, value in self._commands.now.held.items():
            values[index] = value
        return values

    def _draw_pins(self, imgui: Any, screen: Screen) -> None:
        draw, area = imgui.get_background_draw_list(), self._area
        for x, y in self.editor.pin_pixels(screen, self._newest()):
            at = imgui.ImVec2(area.left + x, area.top + y)
            draw.add_circle_filled(at, 4.0, _PIN)
            draw.add_circle(at, 4.0, _WHITE)
        if self.brush.tool not in ("add points", "remove points"):
            return
        for x, y in self.editor.light_pixels(screen, self._newest()):
            draw.add_circle_filled(imgui.ImVec2(area.left + x, area.top + y), 3.0, _ADDED)
