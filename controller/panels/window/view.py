"""Camera, idle motion, gaze, shows, pictures and recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from controller.body.messages import ControlShow, PanelRequest, PlayShow
from controller.panels.session.capture import Capture
from controller.panels.session.commands import Commands
from controller.panels.window.flow import Flow
from surface.view.scene.viewpoint import KEYS, Viewpoint

RED_DOT = (0.9, 0.15, 0.15, 1.0)


class View:
    """Draws them; ``shows`` : names of the shows that the stage can play.

    look : draws what changes the look of the face, where that can be changed. overlays : what chooses overlays.
    """

    def __init__(
        self, commands: Commands, viewpoint: Viewpoint, capture: Capture, shows: Sequence[str],
        send: Callable[[PanelRequest], None],
    ) -> None:  # fmt: skip
        self._commands, self._viewpoint, self._capture, self._send = commands, viewpoint, capture, send
        self._shows, self._show, self._paused = shows, "", False
        self.look: Callable[[], None] | None = None
        self.overlays: Callable[[], None] | None = None

    def __call__(self) -> None:
        """Draw; called once per frame."""
        from imgui_bundle import imgui  # optional

        imgui.separator_text("camera")
        flow = Flow(imgui)
        for key, name in {**KEYS, "0": "reset"}.items():
            if flow.button(name):
                self._viewpoint.press(key)
        if self.look is not None:
            imgui.separator_text("picture")
            self.look()
        imgui.separator_text("idle motion and gaze")
        self._life(imgui)
        if self._shows:
            imgui.separator_text("shows")
            self._draw_shows(imgui)
        imgui.separator_text("pictures and recordings")
        self._captures(imgui)
        if self.overlays is not None:
            imgui.separator_text("over the picture")
            self.overlays()

    def toggle_show(self) -> None:
        """Pause the show that plays, or let it go on; the first one begins where none has begun."""
        if not self._show and self._shows:
            self._play(self._shows[0])
        elif self._show:
            self._paused = not self._paused
            self._send(ControlShow("PAUSE" if self._paused else "PLAY"))

    def stop_show(self) -> None:
        """End the show that plays."""
        if self._show:
            self._send(ControlShow("STOP"))
        self._show, self._paused = "", False

    def _play(self, name: str) -> None:
        self._show, self._paused = name, False
        self._send(PlayShow(name))

    def _life(self, imgui: Any) -> None:
        imgui.set_next_item_width(-imgui.calc_text_size("liveliness").x - imgui.get_font_size())
        moved, amount = imgui.slider_float("liveliness", self._commands.now.life, 0.0, 1.0)
        if moved:
            self._commands.set_life(amount, "life")
        if self._commands.now.gaze is None:
            imgui.text_disabled("Alt and click: look there")
        elif imgui.button("look at nothing"):
            self._commands.set_gaze(None)

    def _draw_shows(self, imgui: Any) -> None:
        flow = Flow(imgui)
        for name in self._shows:
            if flow.button(name):
                self._play(name)
        if self._show:
            if imgui.button("go on" if self._paused else "pause"):
                self.toggle_show()
            imgui.same_line()
            if imgui.button("stop the show"):
                self.stop_show()

    def _captures(self, imgui: Any) -> None:
        capture = self._capture
        flow = Flow(imgui)
        if flow.button("screenshot"):
            capture.take_picture()
        if flow.button("end recording" if capture.recording else "record"):
            capture.toggle()
        if flow.button("end clip" if capture.filming else "clip"):
            capture.toggle_clip()
        if capture.recording or capture.filming:
            doing = f"recording {capture.seconds:.0f} s" if capture.recording else "filming"
            imgui.text_colored(imgui.ImVec4(*RED_DOT), doing)
        if capture.message:
            imgui.text_wrapped(capture.message)
