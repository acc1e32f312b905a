"""Draws overlays, such as control points and the quad tree, on the picture, and the check boxes that enable them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from controller.base.parameters import PARAMETERS, Floats, Parameters
from controller.face.face import head_indices
from controller.face.overlays import KINDS, PART, Kind, Marks, Overlays
from controller.face.skin_model import Screen
from controller.panels.session.jobs import Jobs
from controller.robot.anchors import anchor_places
from surface.view.docks import PictureArea
from surface.view.scene.camera import Camera

if TYPE_CHECKING:
    from controller.body.panel_state import PanelState
    from controller.robot.settings import RobotSettings
    from surface.head import Head

_FAMILY_COLOURS = np.array([
    [0.75, 0.75, 0.75], [0.95, 0.45, 0.2], [0.3, 0.65, 0.95], [0.45, 0.85, 0.4], [0.95, 0.85, 0.3], [0.75, 0.5, 0.95],
    [0.3, 0.85, 0.8], [0.95, 0.5, 0.7], [0.6, 0.75, 0.2],
])  # fmt: skip
"""Colours (k, 3) of families, the control points of one group; used again from the first on if there are more."""


class OverlayView:
    """Draws the enabled overlays; if none is enabled, nothing is computed.

    load : loads a copy of the head, in a background job. newest : returns the newest parameter values (P,).
    area : of the window that the picture fills. robots : whose anchors are shown. state : knows the measured servos.
    parameters : of the stage, the configuration that is shown; default: those of the base vocabulary.
    """

    def __init__(
        self, load: Callable[[], Head], newest: Callable[[], Floats], area: PictureArea, jobs: Jobs,
        robots: Sequence[RobotSettings] = (), state: PanelState | None = None, parameters: Parameters | None = None,
    ) -> None:  # fmt: skip
        self._parameters = parameters or PARAMETERS
        self._load, self._newest, self._area, self._jobs = load, newest, area, jobs
        self.robots, self._state = robots, state
        self.on: set[Kind] = set()
        self._overlays: Overlays | None = None
        self._order = np.zeros(0, np.intp)
        self._loading = False

    def draw_checkboxes(self) -> None:
        """Draw the check boxes."""
        from imgui_bundle import imgui  # optional

        for kind in KINDS:
            changed, on = imgui.checkbox(f"{kind}##overlay", kind in self.on)
            if changed:
                self.switch(kind, on=on)
        if "influence" in self.on:
            imgui.text_disabled("Shift and click: another control point")

    def switch(self, kind: Kind, *, on: bool) -> None:
        """Enable or disable one; the first starts to load a copy of the head."""
        (self.on.add if on else self.on.discard)(kind)
        if on and self._overlays is None and not self._loading:
            self._loading = True
            self._jobs.start("preparing overlays", lambda _: self._load_overlays(), self._set_overlays)

    def reload(self) -> None:
        """Drop the copy of the head, since another head is shown; load that if an overlay is enabled."""
        self._overlays, self._loading = None, False
        for kind in tuple(self.on):
            self.switch(kind, on=True)

    def _load_overlays(self) -> Overlays:
        head = self._load()
        anchors = [place for robot in self.robots for place in anchor_places(robot, head, PART)]
        self._order = head_indices(self._parameters, head.parameters)
        return Overlays(head, anchors)

    def _set_overlays(self, overlays: Overlays) -> None:
        self._overlays, self._loading = overlays, False

    def __call__(self, camera: Camera) -> None:
        """Draw the enabled overlays; called once per frame."""
        if not self.on or self._overlays is None:
            return
        from imgui_bundle import imgui  # optional

        area, overlays = self._area, self._overlays
        overlays.pose(self._to_head_order(self._newest()), self._measured())
        screen = Screen(camera, (max(area.width, 1.0), max(area.height, 1.0)))
        self._choose_point(imgui, screen)
        draw = imgui.get_background_draw_list()
        draw.push_clip_rect(
            imgui.ImVec2(area.left, area.top), imgui.ImVec2(area.left + area.width, area.top + area.height)
        )
        for kind in KINDS:
            if kind in self.on:
                self._draw(imgui, draw, screen, overlays.marks(kind))
        draw.pop_clip_rect()

    def _to_head_order(self, values: Floats) -> Floats:
        """Return the head's parameters (h,) from the stage's; 0, the appended one, for parameters the stage lacks."""
        return np.append(values, 0.0)[self._order]

    def _measured(self) -> Floats | None:
        """Return the head's parameters (h,) as the servos measure them, as wanted where none measures; None if
        disabled or without servos.
        """
        if "measured" not in self.on or self._state is None:
            return None
        shown = self._newest().copy()
        for i in range(len(shown)):
            known = self._state.measured(i)
            shown[i] = shown[i] if known is None else known
        return self._to_head_order(shown)

    def _choose_point(self, imgui: Any, screen: Screen) -> None:
        io = imgui.get_io()
        clicked = io.key_shift and not io.key_ctrl and imgui.is_mouse_clicked(imgui.MouseButton_.left)
        if "influence" in self.on and clicked and self._overlays is not None:
            pixel = (io.mouse_pos.x - self._area.left, io.mouse_pos.y - self._area.top)
            self._overlays.choose(nearest(self._overlays.marks("control points").points, pixel, screen))

    def _draw(self, imgui: Any, draw: Any, screen: Screen, marks: Marks) -> None:
        left, top, vec = self._area.left, self._area.top, imgui.ImVec2
        if len(marks.points):
            shown = screen.project(marks.points)[:, :2] + [left, top]
            for i, (x, y) in enumerate(shown.tolist()):
                colour = self._colour(imgui, int(marks.families[i]), float(marks.shades[i]))
                draw.add_rect_filled(vec(x - 1.5, y - 1.5), vec(x + 1.5, y + 1.5), colour)
            for i, words in marks.labels.items():
                draw.add_text(vec(shown[i, 0] + 5, shown[i, 1] - 5), self._colour(imgui, 0, 1.0), words)
        if len(marks.lines):
            ends = screen.project(marks.lines.reshape(-1, 3))[:, :2].reshape(-1, 4) + np.array([left, top, left, top])
            for (x0, y0, x1, y1), shade in zip(ends.tolist(), marks.shades.tolist(), strict=True):
                draw.add_line(vec(x0, y0), vec(x1, y1), self._colour(imgui, 1, shade))

    def _colour(self, imgui: Any, family: int, shade: float) -> int:
        red, green, blue = _FAMILY_COLOURS[family % len(_FAMILY_COLOURS)].tolist()
        return int(imgui.color_convert_float4_to_u32(imgui.ImVec4(red, green, blue, 0.25 + 0.75 * shade)))


def nearest(points: Floats, pixel: tuple[float, float], screen: Screen) -> Floats:
    """Return the point (3,) of ``points (m, 3)`` that is drawn nearest to a pixel.

    Of those within 4 pixels of the nearest distance it is the one in front.
    """
    shown = screen.project(points)
    distance = np.hypot(shown[:, 0] - pixel[0], shown[:, 1] - pixel[1])
    close = np.flatnonzero(distance <= distance.min() + 4.0)
    found: Floats = points[close[np.argmin(shown[close, 2])]]
    return found
