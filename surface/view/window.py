"""Window that shows a head: imgui-bundle's runner owns window and panels, moderngl draws into its context."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from surface.base.errors import ViewError
from surface.base.extras import importing
from surface.view.docks import LINE, Dock, PictureArea, Remake, add_docks, find_area, show_docks, text_scale
from surface.view.draw.alternating import Alternating
from surface.view.draw.placing import Box, Placing
from surface.view.draw.renderer import Renderer
from surface.view.draw.target import read_pixels
from surface.view.fullscreen import desktop_scale, glfw_window, opened_size
from surface.view.live import LiveDrawing
from surface.view.scene.camera import Camera
from surface.view.scene.choice import LEVELS, QualityChoice
from surface.view.scene.framing import framing_of
from surface.view.scene.parts import ViewHead
from surface.view.scene.theme import Theme, find_theme
from surface.view.scene.viewpoint import Viewpoint

if TYPE_CHECKING:
    import moderngl

_MINIMISED_S = 0.02
_SIZES = (
    "window_padding", "frame_padding", "item_spacing", "item_inner_spacing", "cell_padding", "indent_spacing",
    "scrollbar_size", "grab_min_size", "frame_rounding", "tab_rounding", "separator_text_padding",
)  # fmt: skip
"""Of ImGui's style, what grows with the text."""
_LEAST_TAB = 20.0  # width of a tab at least, points
HEADLESS_HINT = "add --headless, or start it under: xvfb-run -a"


@dataclass(frozen=True)
class WindowReport:
    """Statistics of a window: frames drawn, and the seconds from its first frame to its last."""

    frames: int
    seconds: float

    @property
    def rate_hz(self) -> float:
        """Frames per second."""
        return (self.frames - 1) / self.seconds if self.seconds > 0.0 else 0.0


def run_window(
    head: ViewHead,
    source: Callable[[], np.ndarray],
    *,
    size: tuple[int, int] = (1280, 720),
    title: str = "omote",
    gui: Callable[[], None] | None = None,
    seconds: float | None = None,
    keep_going: Callable[[], bool] | None = None,
    camera: Camera | Viewpoint | None = None,
    quality: str | QualityChoice = "full",
    theme: str | Theme = "skin",
    evaluator: str = "auto",
    kiosk: bool = False,
    monitor: int = 0,
    docks: Sequence[Dock] = (),
    area: PictureArea | None = None,
) -> WindowReport:
    """Show the head until the window is closed.

    Drag rotates the head, right drag moves it, the wheel zooms, 1 to 5 choose a preset view, 0 resets it.

    source : called once per frame, gives values (P,) in `head.parameters` order.
    gui : draws ImGui panels, once per frame.
    camera : the camera at first; a viewpoint can be changed by the caller later.
    seconds : close automatically after this long.
    keep_going : called once per frame, also while the window is minimised; the window closes when it returns False.
    quality, theme, evaluator : see :class:`surface.view.draw.renderer.Renderer`; a choice takes the quality that holds
        its rate.
    kiosk : cover a whole monitor, hide the cursor, ignore mouse and keys but for Esc, which closes the window.
    monitor : which one, from 0.
    docks : panels beside the picture, which takes what they leave; none in a kiosk.
    area : called once per frame with where the picture is.

    Raises ViewError: no display, or no OpenGL. MissingPackage: imgui-bundle is not installed. Exceptions of `source`
    and `gui` are raised again after the window is closed.
    """
    if not has_display():  # the window library would end the process instead
        raise ViewError("there is no display to open a window on (DISPLAY is not set)", hint=HEADLESS_HINT)
    with importing("the window", "imgui_bundle"):
        from imgui_bundle import hello_imgui, imgui  # optional: the extra view
    framing = framing_of(head, worn=find_theme(theme).dressed)
    viewpoint = camera if isinstance(camera, Viewpoint) else Viewpoint(camera, framing)
    make = partial(Renderer, head=head, theme=theme, evaluator=evaluator)
    window = _Window(imgui, source, viewpoint, make, quality)
    window.gui, window.seconds, window.keep_going, window.kiosk = gui, seconds, keep_going, kiosk
    params = window.params = _parameters(hello_imgui, window, size, title)
    window.area = area or PictureArea()
    if kiosk:
        _cover_monitor(hello_imgui, params, monitor)
    elif docks:
        window.add_docks(hello_imgui, docks, size)
    try:
        _run(hello_imgui.manual_render, params)
    except Exception as error:
        raise window.failure or _no_window(error) from error
    if window.failure is not None:
        raise window.failure
    if window.frames == 0:
        raise ViewError("the window closed before it drew anything", hint=HEADLESS_HINT)
    return WindowReport(window.frames, window.last - window.first)


def _cover_monitor(hello_imgui: Any, params: Any, monitor: int) -> None:
    """Let the window cover a whole monitor; ``monitor`` : from 0."""
    geometry = params.app_window_params.window_geometry
    geometry.full_screen_mode = hello_imgui.FullScreenMode.full_screen_desktop_resolution
    geometry.monitor_idx = monitor


def _run(runner: Any, params: Any) -> None:
    """Draw frames until the window is to close.

    imgui-bundle's own `run` first searches the source of its caller, which takes 0.1 s.
    """
    runner.setup_from_runner_params(params)
    try:
        while not params.app_shall_exit:
            runner.render()
    finally:
        runner.tear_down()


def has_display() -> bool:
    """Whether this session has a display to open a window on."""
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _no_window(error: Exception) -> ViewError:
    """The error for a runner that failed; its own message names only its source line."""
    display = os.environ.get("WAYLAND_DISPLAY") or os.environ.get("DISPLAY", "")
    return ViewError(f"no window on display {display!r}: {str(error).splitlines()[0]}", hint=HEADLESS_HINT)


class _Window:
    """The runner's callbacks; keeps the first exception, since none may leave a callback."""

    params: Any

    def __init__(
        self,
        imgui: Any,
        source: Callable[[], np.ndarray],
        viewpoint: Viewpoint,
        make_renderer: Callable[..., Renderer],
        quality: str | QualityChoice,
    ) -> None:
        self._imgui, self._source, self._viewpoint = imgui, source, viewpoint
        self._make_renderer, self._quality = make_renderer, quality
        self.kiosk, self.docks = False, list[Dock]()
        self.area = PictureArea()
        self.gui: Callable[[], None] | None = None
        self.seconds: float | None = None
        self.keep_going: Callable[[], bool] | None = None
        self.frames, self.first, self.last, self._began = 0, 0.0, 0.0, 0.0
        self.failure: BaseException | None = None
        self._ctx: moderngl.Context | None = None
        self._drawings: dict[str, LiveDrawing] = {}
        self._alternating: Alternating | None = None
        self._placing: Placing | None = None
        self._scaled, self._sizes = 0.0, dict[str, Any]()

    def as_callback(self, action: Callable[[], None]) -> Callable[[], None]:
        """`action` as a callback: an exception is kept and closes the window."""

        def call() -> None:
            if self.failure is not None:
                return
            try:
                action()
            except BaseException as error:  # noqa: BLE001 - C++ is the caller; re-raised by run_window
                self.failure = error
                self.close()

        return call

    def add_docks(self, hello_imgui: Any, docks: Sequence[Dock], size: tuple[int, int]) -> None:
        """Put panels beside the picture, for a window that was asked for in ``size`` points."""
        self.docks = [replace(dock, draw=self.as_callback(dock.draw)) for dock in docks]
        desktop = desktop_scale()
        opened = opened_size(size, desktop)
        add_docks(
            hello_imgui, self.params, self.docks, opened, LINE * desktop * text_scale(opened, desktop, self.docks)
        )

    def close(self) -> None:
        """Make the runner stop after this frame."""
        self.params.app_shall_exit = True

    def start(self) -> None:
        """Attach moderngl to the window's context."""
        import moderngl  # optional

        try:
            ctx = moderngl.create_context(require=310)
        except Exception as error:
            why = f"the window has no OpenGL 3.1: {error}"
            raise ViewError(why, hint="set LIBGL_ALWAYS_SOFTWARE=1 to draw in software") from error
        ctx.clear_errors()
        self._make(ctx, self._make_renderer, self._quality)
        self._ctx = ctx
        self._accept_files()

    def _make(self, ctx: moderngl.Context, make: Callable[..., Renderer], quality: str | QualityChoice) -> None:
        """Make what draws the head."""
        choice = quality if isinstance(quality, QualityChoice) else None
        names = LEVELS if choice is not None else (str(quality),)
        self._drawings = {name: LiveDrawing(make(ctx, quality=name)) for name in names}
        self._alternating = Alternating(self._drawings, choice) if choice is not None else None

    def _remake(self, ctx: moderngl.Context, wanted: Remake) -> None:
        """Draw another head or look; the picture stays as it was where that fails."""
        before = (self._alternating, *self._drawings.values())
        self.area.remake = None
        try:
            self._make(ctx, wanted.make, wanted.quality)
        except Exception as error:  # noqa: BLE001  the caller reports it
            wanted.done(error)
            return
        for thing in before:
            if thing is not None:
                thing.release()
        wanted.done(None)

    def _accept_files(self) -> None:
        """Hand files that are dropped on the window to the caller."""
        if self.area.dropped is None:
            return
        window, glfw = glfw_window()
        if window is not None:
            glfw.set_drop_callback(window, lambda _, names: self.drop(names))

    def drop(self, names: Sequence[str]) -> None:
        """Files were dropped on the window."""
        if self.area.dropped is not None:
            self.as_callback(partial(self.area.dropped, [Path(name) for name in names]))()

    def background(self) -> None:
        """One frame of the head, under the panels."""
        if self._ctx is None:
            return
        self._find_area()
        ctx, box = self._ctx, self._box()
        # The runner's own drawing changes OpenGL's state without moderngl: begin from what is bound.
        screen = ctx.detect_framebuffer()
        if min(box[2:]) < 1:
            return
        if self.area.remake is not None:
            self._remake(ctx, self.area.remake)
        picture = self._picture(box[2:])
        if self.area.wanted is not None:
            take, self.area.wanted = self.area.wanted, None
            take(read_pixels(picture))
        self._copy(screen, picture, box)
        screen.use()
        ctx.enable_only(ctx.NOTHING)
        self.last = time.perf_counter()
        self.first = self.first if self.frames else self.last
        self.frames += 1

    def _copy(self, screen: moderngl.Framebuffer, picture: moderngl.Framebuffer, box: Box) -> None:
        """Copy the picture to its place in the window."""
        assert self._ctx is not None
        if box[:2] != (0, 0):
            self._placing = self._placing or Placing(self._ctx)
            self._placing.copy(screen, picture, box)
            screen.viewport = screen.scissor = (0, 0, *self._pixels())
            return
        picture.scissor = box
        screen.viewport = screen.scissor = box
        self._ctx.copy_framebuffer(screen, picture)

    def _box(self) -> Box:
        """Where the picture is in the window's framebuffer, pixels: left, bottom, width, height."""
        io, area = self._imgui.get_io(), self.area
        scale = io.display_framebuffer_scale
        left, width, height = round(area.left * scale.x), round(area.width * scale.x), round(area.height * scale.y)
        return left, self._pixels()[1] - round(area.top * scale.y) - height, width, height

    def _find_area(self) -> None:
        """Where the panels leave room for the picture: all of the window without any."""
        io = self._imgui.get_io()
        area = self.area
        area.left, area.top, area.width, area.height = 0.0, 0.0, io.display_size.x, io.display_size.y
        if self.docks:
            find_area(self._imgui, self.params.docking_params, area)

    def _picture(self, size: tuple[int, int]) -> moderngl.Framebuffer:
        """The next picture of `size`."""
        for each in self._drawings.values():
            each.size = size
        values, camera = self._source(), self._viewpoint.camera
        if self.area.instead is not None and self._ctx is not None:
            picture = self.area.instead.draw(self._ctx, size)
            if picture is not None:
                return picture
        if self._alternating is not None:
            self._alternating.draw(values, camera)
            return self._alternating.picture()
        (drawing,) = self._drawings.values()
        drawing.draw(values, camera)
        return drawing.target.picture

    def _scale(self, style: Any) -> None:
        """Let text, and all distances between and within widgets, grow with the window."""
        size = self._imgui.get_io().display_size
        scale = text_scale((size.x, size.y), style.font_scale_dpi, self.docks)
        if scale == self._scaled:
            return
        # from sizes as they were made: those of 4K, made smaller again, would be rounded ones
        self._sizes = self._sizes or {name: _copied(getattr(style, name)) for name in _SIZES}
        for name, size in self._sizes.items():
            setattr(
                style, name, size * scale if isinstance(size, float) else type(size)(size.x * scale, size.y * scale)
            )
        style.tab_min_width_shrink = _LEAST_TAB * scale  # in a small window titles are cut, and none is away
        style.window_menu_button_position = self._imgui.Dir.none  # its room is that of a title
        style.font_scale_main = self._scaled = scale

    def panels(self) -> None:
        """Mouse, keys and the caller's panels."""
        if self.docks:
            show_docks(self.params, shown=not self.area.bare)
            self._scale(self._imgui.get_style())
        if self.kiosk:
            self._imgui.set_mouse_cursor(self._imgui.MouseCursor_.none)
            if self._imgui.is_key_pressed(self._imgui.Key.escape, repeat=False):
                self.close()
        else:
            self._steer()
        if self.gui is not None:
            self.gui()

    def _steer(self) -> None:
        """Apply this frame's mouse and keys to the camera, unless a panel uses them."""
        imgui, viewpoint = self._imgui, self._viewpoint
        io = imgui.get_io()
        if not io.want_capture_mouse and self.area.instead is None:
            moved = io.mouse_delta
            if imgui.is_mouse_down(imgui.MouseButton_.left):
                viewpoint.turn(moved.x, moved.y)
            elif imgui.is_mouse_down(imgui.MouseButton_.right):
                viewpoint.shift(moved.x, moved.y, int(self.area.height))
            if io.mouse_wheel:
                viewpoint.zoom(io.mouse_wheel)
        if not io.want_text_input and self.area.instead is None:
            for digit in range(6):
                if imgui.is_key_pressed(getattr(imgui.Key, f"_{digit}"), repeat=False):
                    viewpoint.press(str(digit))

    def check(self) -> None:
        """Before every frame, drawn or not: close the window if its time is over."""
        now = time.perf_counter()
        self._began = self._began or now
        over = self.seconds is not None and now - (self.first if self.frames else self._began) >= self.seconds
        if over or (self.keep_going is not None and not self.keep_going()):
            self.close()
        elif min(self._pixels()) < 1:
            time.sleep(_MINIMISED_S)  # nothing is drawn, so nothing waits for the screen

    def stop(self) -> None:
        """Release the graphics memory, while the context still exists."""
        for thing in (self.area.instead, self._placing, self._alternating, *self._drawings.values()):
            if thing is not None:
                thing.release()
        self._ctx, self._placing, self._alternating, self._drawings = None, None, None, {}
        self.area.instead = None

    def _pixels(self) -> tuple[int, int]:
        """Size of the window's framebuffer, pixels."""
        io = self._imgui.get_io()
        scale = io.display_framebuffer_scale
        return round(io.display_size.x * scale.x), round(io.display_size.y * scale.y)


def _parameters(runner: Any, window: _Window, size: tuple[int, int], title: str) -> Any:
    """The runner's settings: OpenGL 3.1, no files written, our callbacks."""
    params = runner.RunnerParams()
    params.app_window_params.window_title = title
    params.app_window_params.window_geometry.size = size
    params.ini_disable = True
    params.imgui_window_params.default_imgui_window_type = runner.DefaultImGuiWindowType.no_default_window
    params.fps_idling.enable_idling = False
    params.renderer_backend_type = runner.RendererBackendType.open_gl3
    options = runner.OpenGlOptions()
    options.anti_aliasing_samples = 0
    if sys.platform != "darwin":  # macOS offers nothing below its own 3.3 core
        options.major_version, options.minor_version = 3, 1
        options.glsl_version = "#version 140"
        options.use_core_profile = False
        options.use_forward_compat = False
    params.renderer_backend_options.open_gl_options = options
    callbacks = params.callbacks
    callbacks.post_init = window.as_callback(window.start)
    callbacks.pre_new_frame = window.as_callback(window.check)
    callbacks.custom_background = window.as_callback(window.background)
    callbacks.show_gui = window.as_callback(window.panels)
    callbacks.before_exit = window.stop
    return params


def _copied(size: Any) -> Any:
    """A number, or a vector of ImGui's own."""
    return float(size) if isinstance(size, int | float) else type(size)(size.x, size.y)
