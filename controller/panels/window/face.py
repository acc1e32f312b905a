"""Draws the face in a window, with the panel docked beside it and points of the face that the mouse can drag."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from controller.base.errors import OMOTE_ERRORS
from controller.base.parameters import PARAMETERS, Parameters
from controller.body.messages import Details, PanelRequest, ToHead
from controller.body.panel_state import PanelState
from controller.face.controls import Controls
from controller.face.devices import Devices
from controller.face.face import FrameLog, HeadValues, qualities
from controller.layers.idle.reflex import LightReflex
from controller.panels.overlay.fit_error import FitErrorView
from controller.panels.overlay.overlay_view import OverlayView
from controller.panels.session.commands import History
from controller.panels.session.next_run import NextRun, carried_to
from controller.panels.window.editing import MouseEditing
from controller.panels.window.head_source import HeadSource
from controller.panels.window.heads import HeadChoice
from controller.panels.window.looks import Looks
from controller.panels.window.panel import Panel, PanelOptions
from controller.panels.window.sculpting import SculptPanel
from controller.panels.window.wall_view import WallView
from controller.stage.stage import FaceSettings, Stage
from controller.vocabulary.controls import ControlsFile
from surface.head import Head
from surface.head.model.parameters import head_angles
from surface.view.docks import PictureArea, Remake
from surface.view.draw.renderer import Renderer
from surface.view.scene.choice import QualityChoice
from surface.view.scene.framing import framing_of
from surface.view.scene.viewpoint import Viewpoint
from surface.view.window import run_window

_TITLE = "omote"


class WindowFace:
    """Draws the head in a window until it is closed.

    head : the head to draw. settings : size, quality and camera. values : returns the head's newest values.
    send : sends the panel's requests to the body. panel_state, options : see :class:`Panel`.
    copy : loads the head again, for dragging points with the mouse; without, none can be dragged.
    controls : what gamepad and keys do. stage : whose look can be changed; without, it stays as it is.
    details : the newest answer of the body to the panel. carried : what was set in the window before this one.
    heads : of a stage that has several, which are shown side by side.

    Attributes
    ----------
    next_run : what the run goes on with: a stage that was dropped on the window, or this one with a saved group.
    """

    def __init__(
        self,
        head: Head,
        settings: FaceSettings,
        values: HeadValues,
        send: Callable[[PanelRequest | ToHead], None],
        panel_state: PanelState | None = None,
        copy: Callable[[], Head] | None = None,
        options: PanelOptions | None = None,
        controls: Collection[ControlsFile] = (),
        *,
        stage: Stage | None = None,
        details: Callable[[], Details | None] | None = None,
        carried: NextRun | None = None,
        heads: Sequence[HeadSource] = (),
    ) -> None:
        choice = HeadChoice(heads, values, panel_state, send)
        ask = choice.send
        self._head, self._settings, self._values = head, settings, values
        framing = framing_of(head, worn=settings.dressed)
        self._viewpoint = Viewpoint(framing.camera(settings.make_camera()), framing)
        self._area = PictureArea()
        newest = lambda: values.full  # noqa: E731
        parameters = PARAMETERS if options is None else options.parameters
        self._panel = Panel(newest, ask, panel_state, options, self._viewpoint, self._area, details=details)
        self._panel.heads = choice
        self._wall = self._make_wall(choice, heads, parameters) if len(heads) > 1 else None
        if details is not None and panel_state is not None:
            self._panel.calibrating.mirror = partial(self._mirror, panel_state)
        self.next_run: NextRun | None = None
        self._overlays: OverlayView | None = None
        self._fit_error: FitErrorView | None = None
        self._mouse, self._looks = None, None  # type: tuple[MouseEditing | None, Looks | None]
        if stage is not None and not settings.kiosk:
            looks = Looks(stage, self._swap, self._panel.jobs)
            self._looks, copy = looks, looks.load_plain
            self._panel.commands.show_light = looks.show_light
            self._panel.add_looks(looks, self._restart)
            self._panel.saving.reopen = partial(self._open_again, stage, options or PanelOptions())
            self._overlays = OverlayView(
                looks.load, newest, self._area, self._panel.jobs, stage.robots, panel_state, parameters
            )
            self._fit_error = FitErrorView(head, self._area, lambda: self._swap(None, self._settings))
            self._panel.view.overlays = self._draw_overlay_choice
            choice.show = partial(self._turn_to, looks)
        if copy is not None and not settings.kiosk:
            self._mouse = MouseEditing(head, copy, newest, self._panel.commands, self._area, parameters)
            self._mouse.can_add = self._looks is not None
            if self._looks is not None:
                self._looks.keep_light = self._mouse.keep_points
            self._panel.sculpt = SculptPanel(self._mouse, self._panel.commands)
            self._panel.saving.editor = self._mouse.find_editor
        self._devices = Devices(Controls(controls, parameters), ask) if controls else None
        self._steady_pupil = settings.make_theme().pupil
        self._reflex = None if stage is None else LightReflex(stage.life.pupil)
        self._log = FrameLog()
        self._ended = False
        self._choice = QualityChoice(settings.fps) if settings.quality == "auto" else None
        if carried is not None and (history := carried_to(carried, parameters)) is not None:
            self._panel.commands.restore(history)

    def run(self, keep_going: Callable[[], bool]) -> None:
        """Show the window until it is closed or ``keep_going()`` is false; raises ViewError when none can be opened."""
        began = stamp = 0

        def source() -> NDArray[np.float64]:
            nonlocal began, stamp
            values = self._values()
            now = time.monotonic_ns()
            self._head.sway.advance(head_angles(values), now / 1e9)
            self._head.live(*self._values.life, self._adapted(now / 1e9))
            if began:
                self._log.add(values, began, now, stamp)  # the frame before has been drawn by now
            began, stamp = now, self._values.stamp_ns
            return values

        kiosk = self._settings.kiosk
        try:
            run_window(
                self._head,
                source,
                size=self._settings.size,
                title=_TITLE,
                gui=None if kiosk and self._devices is None and self._wall is None else self._gui,
                keep_going=lambda: keep_going() and not self._ended,
                camera=self._viewpoint,
                quality=self._choice or self._settings.still_quality,
                theme=self._settings.make_theme(),
                evaluator=self._settings.evaluator,
                kiosk=kiosk,
                monitor=self._settings.monitor,
                docks=() if kiosk else self._panel.docks(),
                area=self._area,
            )
        finally:
            self._panel.playback.close()

    def _adapted(self, now_s: float) -> float:
        """Return how wide the light makes pupils, of how wide it makes them in the end: they ease to another look's."""
        if self._reflex is None:
            return 1.0
        return self._reflex.follow(self._steady_pupil, now_s) / self._steady_pupil

    def _make_wall(self, choice: HeadChoice, heads: Sequence[HeadSource], parameters: Parameters) -> WallView:
        """Show all heads as soon as they are loaded, and one until then."""
        settings, panel = self._settings, self._panel
        quality = "fast" if settings.quality == "auto" else settings.quality
        wall = WallView(heads, parameters, quality, self._area, panel.jobs, panel.problems)
        wall.chosen, wall.choose = lambda: choice.chosen, lambda number: choice.choose(number, panel.commands)
        choice.wall = wall
        wall.switch(True)
        return wall

    def _swap(self, head: Head | None, settings: FaceSettings) -> None:
        """Draw another head, or the same in another look, from the next frame on."""
        shown = head or self._head
        choice = QualityChoice(settings.fps) if settings.quality == "auto" else None
        theme = settings.make_theme()
        if self._fit_error is not None:
            theme = self._fit_error.dress(shown, theme)
        make = partial(Renderer, head=shown, theme=theme, evaluator=settings.evaluator)

        def done(error: Exception | None) -> None:
            if error is not None:
                self._panel.problems.add(error)
                return
            self._settings, self._choice, self._steady_pupil = settings, choice, theme.pupil
            if head is not None:
                self._take_over(head)

        self._area.remake = Remake(make, choice or settings.still_quality, done)

    def _draw_overlay_choice(self) -> None:
        """Draw the check boxes of overlays and of the fit error."""
        if self._overlays is not None:
            self._overlays.draw_checkboxes()
        if self._fit_error is not None:
            self._fit_error.draw_checkboxes()

    def _take_over(self, head: Head) -> None:
        """Use another head for posing, dragging and gaze from now on."""
        self._head = head
        self._values.follow(head.parameters)
        self._viewpoint.reframe(framing_of(head, worn=self._settings.dressed))
        if self._mouse is not None:
            looks = self._looks
            self._mouse.change(head, looks.shown_light if looks else (), same=looks is not None and looks.only_light)
        if self._overlays is not None:
            self._overlays.reload()

    def _mirror(self, state: PanelState, on: bool) -> None:
        """Show the pose measured by the servos, as far as it is known, or the wanted pose."""
        self._values.replaced = state.show_measured if on else None

    def _turn_to(self, looks: Looks, stage: Stage) -> None:
        """Show another head of the stage."""
        if self._overlays is not None:
            self._overlays.robots = stage.robots
        try:
            looks.light = self._panel.commands.now.light
            looks.turn_to(stage, self._panel.commands.now.look)
        except OMOTE_ERRORS as error:
            self._panel.problems.add(error)

    def _restart(self, stage: Path) -> None:
        self.next_run, self._ended = NextRun(stage), True

    def _open_again(self, stage: Stage, options: PanelOptions, history: History, held: Mapping[str, float]) -> None:
        """Open the same stage again with the user's current vocabulary, and keep the settings."""
        files = tuple(dict.fromkeys(each.resolve() for each in (*options.files, options.own_file)))
        self.next_run, self._ended = NextRun(stage.path, files, history, options.parameters.names, held), True

    def _gui(self) -> None:
        from imgui_bundle import imgui  # optional

        if not self._settings.kiosk:
            self._panel()
        elif self._wall is not None:
            self._panel.jobs()
            self._panel.problems.log_all()  # a kiosk has no panel to show them on
        if self._devices is not None:
            self._devices()
        if self._wall is not None and self._wall.shown:
            if not self._settings.kiosk:
                self._wall(imgui)
            return  # points to pull and overlays belong to a head that is shown alone
        if self._mouse is not None:
            self._mouse(self._viewpoint.camera)
        if self._overlays is not None:
            self._overlays(self._viewpoint.camera)
        if self._fit_error is not None:
            self._fit_error()

    def report(self) -> dict[str, object]:
        """Return frames that were drawn; see :meth:`controller.face.face.FrameLog.report`."""
        return {**self._log.report(self._settings, "window"), **qualities(self._choice)}
