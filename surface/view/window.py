"""The head in a window: imgui-bundle's runner owns window and panel, moderngl draws into its context."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from surface.base.errors import ViewError
from surface.view.draw.renderer import Renderer
from surface.view.draw.target import Target
from surface.view.scene.camera import Camera
from surface.view.scene.pace import Pace, is_software
from surface.view.scene.parts import ViewHead
from surface.view.scene.theme import Theme
from surface.view.scene.viewpoint import Viewpoint

if TYPE_CHECKING:
    import moderngl

_MINIMISED_S = 0.02
HEADLESS_HINT = "add --headless, or start it under: xvfb-run -a"


@dataclass(frozen=True)
class WindowReport:
    """What a window did: frames drawn, and the seconds from its first frame to its last."""

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
    quality: str = "full",
    theme: str | Theme = "skin",
    evaluator: str = "auto",
    kiosk: bool = False,
    monitor: int = 0,
) -> WindowReport:
    """Show the head until the window is closed.

    Drag turns the head, right drag moves it, the wheel zooms, 1 to 5 choose a preset view, 0 goes back.

    Parameters
    ----------
    source : called once per frame, gives values (P,) in `head.parameters` order.
    gui : draws ImGui panels, once per frame.
    camera : where the picture is taken from at first; a viewpoint stays in the caller's hands.
    seconds : close by itself after this long.
    keep_going : asked once per frame, also while the window is minimised; it closes when told False.
    quality, theme, evaluator : see :class:`surface.view.draw.renderer.Renderer`.
    kiosk : cover a whole monitor, hide the cursor, let mouse and keys alone but for Esc, which ends it.
    monitor : which one, from 0.

    Raises
    ------
    ViewError : no display, no OpenGL, or imgui-bundle is missing. What `source` or `gui` raise comes
        through after the window is closed.
    """
    _require_display()
    runner = _imgui()
    viewpoint = camera if isinstance(camera, Viewpoint) else Viewpoint(camera)
    window = _Window(head, source, viewpoint, quality, theme, evaluator)
    window.gui, window.seconds, window.keep_going, window.kiosk = gui, seconds, keep_going, kiosk
    params = _parameters(runner, window, size, title)
    if kiosk:
        _cover(runner, params, monitor)
    return _show(runner, window, params)


def has_display() -> bool:
    """Whether this session has a display to open a window on."""
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _require_display() -> None:
    """ViewError without a display: the window library would end the process instead."""
    if not has_display():
        raise ViewError("there is no display to open a window on (DISPLAY is not set)", hint=HEADLESS_HINT)


def _show(runner: Any, window: _Window, params: Any) -> WindowReport:
    """Hand over to the runner until the window closes."""
    try:
        runner.run(params)
    except Exception as error:
        raise window.failure or _no_window(error) from error
    if window.failure is not None:
        raise window.failure
    if window.frames == 0:
        raise ViewError("the window closed before it drew anything", hint=HEADLESS_HINT)
    return WindowReport(window.frames, window.last - window.first)


def _no_window(error: Exception) -> ViewError:
    """Why the runner gave up; its own words name only its source line."""
    display = os.environ.get("WAYLAND_DISPLAY") or os.environ.get("DISPLAY", "")
    return ViewError(f"no window on display {display!r}: {str(error).splitlines()[0]}", hint=HEADLESS_HINT)


def _imgui() -> Any:
    """The runner module of imgui-bundle."""
    try:
        from imgui_bundle import hello_imgui  # optional
    except ImportError as error:
        raise ViewError(
            f"the window needs imgui-bundle ({error})", hint="pip install '.[view]' in the checkout"
        ) from error
    return hello_imgui


class _Window:
    """What the runner's callbacks do; keeps the first failure, since none may leave a callback."""

    def __init__(
        self,
        head: ViewHead,
        source: Callable[[], np.ndarray],
        viewpoint: Viewpoint,
        quality: str,
        theme: str | Theme,
        evaluator: str,
    ) -> None:
        self.head, self.source = head, source
        self.viewpoint, self.quality, self.theme, self.evaluator = viewpoint, quality, theme, evaluator
        self.kiosk = False
        self.gui: Callable[[], None] | None = None
        self.seconds: float | None = None
        self.keep_going: Callable[[], bool] | None = None
        self.frames, self.first, self.last, self._began = 0, 0.0, 0.0, 0.0
        self.failure: BaseException | None = None
        self._ctx: moderngl.Context | None = None
        self._renderer: Renderer | None = None
        self._target: Target | None = None
        self._made_for: tuple[object, ...] = ()
        self._pace = Pace(quality)

    def guarded(self, action: Callable[[], None]) -> Callable[[], None]:
        """`action` as a callback: what it raises is kept and closes the window."""

        def call() -> None:
            if self.failure is not None:
                return
            try:
                action()
            except BaseException as error:  # noqa: BLE001 - C++ is the caller; re-raised by run_window
                self.failure = error
                self.close()

        return call

    @staticmethod
    def close() -> None:
        """Ask the runner to stop after this frame."""
        from imgui_bundle import hello_imgui

        hello_imgui.get_runner_params().app_shall_exit = True

    def start(self) -> None:
        """Attach moderngl to the window's context."""
        import moderngl  # optional

        try:
            self._ctx = moderngl.create_context(require=310)
        except Exception as error:
            raise ViewError(
                f"the window has no OpenGL 3.1: {error}", hint="set LIBGL_ALWAYS_SOFTWARE=1 to draw in software"
            ) from error
        self._ctx.clear_errors()
        self._pace = Pace(self.quality, software=is_software(self._ctx))
        self._pace.begin_live()
        self._renderer = Renderer(
            self._ctx, self.head, quality=self.quality, theme=self.theme, evaluator=self.evaluator
        )
        if self._pace.hurried:
            self._renderer.hurry()

    def background(self) -> None:
        """One frame of the head, under the panels."""
        if self._ctx is None or self._renderer is None:
            return
        # The runner's own drawing changes OpenGL's state behind moderngl's back: begin from what is there.
        screen = self._ctx.detect_framebuffer()
        size = _pixels()
        if size[0] < 1 or size[1] < 1:
            return
        self._renderer.pose(self.source())
        started = time.perf_counter()
        target = self._fitting(self._ctx, size)
        self._renderer.update()
        target.paint(self._renderer, self.viewpoint.camera)
        target.complete()
        target.picture.scissor = (0, 0, *size)
        screen.viewport = screen.scissor = (0, 0, *size)
        self._ctx.copy_framebuffer(screen, target.picture)
        screen.use()
        self._ctx.enable_only(self._ctx.NOTHING)
        self._pace.note(time.perf_counter() - started)
        self._count()

    def panels(self) -> None:
        """Mouse, keys and the caller's panels."""
        if self.kiosk:
            self._rest_hands()
        else:
            _steer(self.viewpoint)
        if self.gui is not None:
            self.gui()

    def ask(self) -> None:
        """Before every frame, drawn or not: whether to go on."""
        now = time.perf_counter()
        self._began = self._began or now
        over = self.seconds is not None and now - (self.first if self.frames else self._began) >= self.seconds
        if over or (self.keep_going is not None and not self.keep_going()):
            self.close()
        elif min(_pixels()) < 1:
            time.sleep(_MINIMISED_S)  # nothing to draw, and nobody to wait for the screen

    def _rest_hands(self) -> None:
        """No cursor in a kiosk, and one key."""
        from imgui_bundle import imgui

        imgui.set_mouse_cursor(imgui.MouseCursor_.none)
        if imgui.is_key_pressed(imgui.Key.escape, repeat=False):
            self.close()

    def stop(self) -> None:
        """Give back what was drawn with, while the context still lives."""
        if self._target is not None:
            self._target.release()
        if self._renderer is not None:
            self._renderer.release()
        self._target = self._renderer = None

    def _fitting(self, ctx: moderngl.Context, size: tuple[int, int]) -> Target:
        """The target, made anew when the window changed its size or the pace its samples."""
        wanted = (*size, *self._pace.wanted)
        if self._target is None or self._made_for != wanted:
            old = self._target
            self._target, self._made_for = Target(ctx, size, *self._pace.wanted), wanted
            if old is not None:
                old.release()
        return self._target

    def _count(self) -> None:
        """Note the frame."""
        self.last = time.perf_counter()
        self.first = self.first if self.frames else self.last
        self.frames += 1


def _pixels() -> tuple[int, int]:
    """Size of the window's framebuffer, pixels."""
    from imgui_bundle import imgui

    io = imgui.get_io()
    scale = io.display_framebuffer_scale
    return round(io.display_size.x * scale.x), round(io.display_size.y * scale.y)


def _steer(viewpoint: Viewpoint) -> None:
    """Apply this frame's mouse and keys to the camera, where no panel wants them."""
    from imgui_bundle import imgui

    io = imgui.get_io()
    if not io.want_capture_mouse:
        moved = io.mouse_delta
        if imgui.is_mouse_down(imgui.MouseButton_.left):
            viewpoint.turn(moved.x, moved.y)
        elif imgui.is_mouse_down(imgui.MouseButton_.right):
            viewpoint.shift(moved.x, moved.y, int(io.display_size.y))
        if io.mouse_wheel:
            viewpoint.zoom(io.mouse_wheel)
    if not io.want_text_input:
        for digit in range(6):
            if imgui.is_key_pressed(getattr(imgui.Key, f"_{digit}"), repeat=False):
                viewpoint.press(str(digit))


def _cover(runner: Any, params: Any, monitor: int) -> None:
    """Let the window cover a monitor."""
    geometry = params.app_window_params.window_geometry
    geometry.full_screen_mode = runner.FullScreenMode.full_screen_desktop_resolution
    geometry.monitor_idx = monitor


def _parameters(runner: Any, window: _Window, size: tuple[int, int], title: str) -> Any:
    """The runner's settings: OpenGL, no files left behind, our callbacks."""
    params = runner.RunnerParams()
    params.app_window_params.window_title = title
    params.app_window_params.window_geometry.size = size
    params.ini_disable = True
    params.imgui_window_params.default_imgui_window_type = runner.DefaultImGuiWindowType.no_default_window
    params.fps_idling.enable_idling = False
    _choose_opengl(runner, params)
    callbacks = params.callbacks
    callbacks.post_init = window.guarded(window.start)
    callbacks.pre_new_frame = window.guarded(window.ask)
    callbacks.custom_background = window.guarded(window.background)
    callbacks.show_gui = window.guarded(window.panels)
    callbacks.before_exit = window.stop
    return params


def _choose_opengl(runner: Any, params: Any) -> None:
    """OpenGL 3.1 as the floor; macOS offers nothing below its own 3.3 core."""
    params.renderer_backend_type = runner.RendererBackendType.open_gl3
    options = runner.OpenGlOptions()
    options.anti_aliasing_samples = 0
    if sys.platform != "darwin":
        options.major_version, options.minor_version = 3, 1
        options.glsl_version = "#version 140"
        options.use_core_profile = False
        options.use_forward_compat = False
    params.renderer_backend_options.open_gl_options = options
