"""surface.view.window"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import moderngl
import numpy as np
import pytest
from ball_head import BallHead, values

from surface.base.errors import MissingPackage, ViewError
from surface.view import Offscreen, run_window
from surface.view.draw.renderer import Renderer
from surface.view.draw.target import Target
from surface.view.pictures.offscreen import open_context
from surface.view.scene.camera import Camera
from surface.view.scene.viewpoint import Viewpoint
from surface.view.window import WindowReport, _Window

CHILD = """
import json, sys
sys.path[:0] = [{root!r}, {here!r}]
from ball_head import BallHead, values
from surface.base.errors import ViewError
from surface.view import Offscreen, run_window
calls = dict(source=0, gui=0)
def source():
    calls["source"] += 1
    if {fail!r} and calls["source"] > 3:
        raise KeyError("the source broke")
    return values(jawOpen=calls["source"] % 10 / 10)
def gui():
    from imgui_bundle import imgui
    calls["gui"] += 1
    imgui.begin("panel"); imgui.text("hello"); imgui.end()
try:
    report = run_window(BallHead(), source, size=(320, 240), gui=gui, quality={quality!r}, **{options})
except (KeyError, ViewError) as error:
    print(json.dumps([type(error).__name__, str(error)]))
    sys.exit(7)
from imgui_bundle import hello_imgui
import numpy as np
np.save({out!r}, hello_imgui.final_app_window_screenshot())
print(json.dumps(dict(frames=report.frames, rate=report.rate_hz, **calls)))
"""


@pytest.fixture(scope="module")
def display() -> Iterator[str]:
    """A display of our own (Xvfb)."""
    program = shutil.which("Xvfb")
    if program is None:
        pytest.skip("needs Xvfb (apt-get install xvfb)")
    reader, writer = os.pipe()
    command = [program, "-displayfd", str(writer), "-screen", "0", "640x480x24", "-nolisten", "tcp"]
    server = subprocess.Popen(command, pass_fds=[writer], stderr=subprocess.DEVNULL)
    os.close(writer)
    with os.fdopen(reader) as stream:
        number = stream.readline().strip()
    if not number:
        server.wait()
        pytest.skip("Xvfb did not start")
    yield f":{number}"
    server.terminate()
    server.wait()


def child(root: Path, folder: Path, display: str, quality: str = "fast", fail: bool = False, **options: object):
    script = CHILD.format(
        root=str(root),
        here=str(root / "tests" / "surface"),
        out=str(folder / "shot.npy"),
        quality=quality,
        fail=fail,
        options=repr(options),
    )
    settings = {"DISPLAY": display, "LIBGL_ALWAYS_SOFTWARE": "1", "WAYLAND_DISPLAY": ""}
    return subprocess.run(
        [sys.executable, "-c", script],
        env=os.environ | settings,
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=60,
    )


@pytest.mark.slow
@pytest.mark.parametrize("quality", ["full", "fast"])
def test_the_window_draws_head_and_panel_and_closes(root: Path, tmp_path: Path, display: str, quality: str) -> None:
    done = child(root, tmp_path, display, quality, seconds=0.6)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout.splitlines()[-1])
    assert told["frames"] >= 2
    assert told["source"] == told["frames"]
    assert told["gui"] >= told["frames"] - 1
    picture = np.load(tmp_path / "shot.npy")[..., :3].astype(int)
    middle = picture[90:120, 130:190].reshape(-1, 3).mean(axis=0)
    assert middle[0] > middle[2] + 10
    assert [entry.name for entry in tmp_path.iterdir()] == ["shot.npy"], "the window leaves no files behind"


@pytest.mark.slow
def test_what_the_source_raises_comes_through(root: Path, tmp_path: Path, display: str) -> None:
    done = child(root, tmp_path, display, fail=True, seconds=20)
    assert done.returncode == 7, done.stderr
    assert json.loads(done.stdout.splitlines()[-1]) == ["KeyError", "'the source broke'"]


@pytest.mark.slow
def test_a_display_that_is_not_there(root: Path, tmp_path: Path) -> None:
    done = child(root, tmp_path, ":9876", seconds=1)
    assert done.returncode == 7, done.stderr
    kind, message = json.loads(done.stdout.splitlines()[-1])
    assert kind == "ViewError"
    assert ":9876" in message


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="these systems always have a display")
def test_no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(ViewError, match="no display") as caught:
        run_window(BallHead(), lambda: values())
    assert "--headless" in caught.value.hint


def test_without_imgui_bundle(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setitem(sys.modules, "imgui_bundle", None)
    with pytest.raises(MissingPackage, match="imgui-bundle"):
        run_window(BallHead(), lambda: values())


@pytest.mark.slow
def test_a_kiosk_covers_the_screen(root: Path, tmp_path: Path, display: str) -> None:
    done = child(root, tmp_path, display, seconds=0.4, kiosk=True)
    assert done.returncode == 0, done.stderr
    assert np.load(tmp_path / "shot.npy").shape[:2] == (480, 640)


class Minimised:
    """What imgui reports of a minimised window."""

    def get_io(self) -> SimpleNamespace:
        size = SimpleNamespace(x=0.0, y=0.0)
        return SimpleNamespace(display_size=size, display_framebuffer_scale=size)


def test_a_minimised_window_still_asks_and_rests(monkeypatch: pytest.MonkeyPatch) -> None:
    window = _Window(Minimised(), lambda: values(), Viewpoint(), Renderer, "fast")
    window.params = SimpleNamespace(app_shall_exit=False)
    slept: list[float] = []
    monkeypatch.setattr("surface.view.window.time.sleep", slept.append)
    answers = iter([True, True, False])
    window.keep_going = lambda: next(answers)
    closed = []
    for _ in range(3):
        window.check()
        closed.append(window.params.app_shall_exit)
    assert len(slept) == 2
    assert min(slept) >= 0.01
    assert closed == [False, False, True]


def test_report_rate() -> None:
    assert WindowReport(61, 2.0).rate_hz == pytest.approx(30.0)
    assert WindowReport(1, 0.0).rate_hz == 0.0


class Hands:
    """What imgui reports of mouse and keys in one frame."""

    MouseButton_ = SimpleNamespace(left=0, right=1)
    MouseCursor_ = SimpleNamespace(none=-1)
    Key = SimpleNamespace(escape="esc", **{f"_{digit}": str(digit) for digit in range(10)})

    def __init__(self, *keys: str, button: int | None = None, wheel: float = 0.0, captured: bool = False) -> None:
        self.keys, self.button, self.cursor = keys, button, 0
        self.io = SimpleNamespace(
            mouse_delta=SimpleNamespace(x=10.0, y=4.0), mouse_wheel=wheel, want_capture_mouse=captured,
            want_text_input=captured, display_size=SimpleNamespace(x=320.0, y=240.0),
        )  # fmt: skip

    def get_io(self) -> SimpleNamespace:
        return self.io

    def is_mouse_down(self, button: int) -> bool:
        return button == self.button

    def is_key_pressed(self, key: str, *, repeat: bool) -> bool:
        return key in self.keys and not repeat

    def set_mouse_cursor(self, cursor: int) -> None:
        self.cursor = cursor


def steered(hands: Hands, *, kiosk: bool = False, instead: Any = None) -> tuple[Camera, bool]:
    """The camera after a frame, and whether the window closes."""
    viewpoint = Viewpoint()
    window = _Window(hands, lambda: values(), viewpoint, Renderer, "fast")
    window.params, window.kiosk = SimpleNamespace(app_shall_exit=False), kiosk
    window.area.height, window.area.instead = 240.0, instead
    window.panels()
    return viewpoint.camera, window.params.app_shall_exit


def test_mouse_and_keys_move_the_camera_unless_a_panel_has_them() -> None:
    wanted = {name: Viewpoint() for name in ("turn", "shift", "zoom", "press")}
    wanted["turn"].turn(10.0, 4.0)
    wanted["shift"].shift(10.0, 4.0, 240)
    wanted["zoom"].zoom(2.0)
    wanted["press"].press("5")
    moved = {"turn": {"button": 0}, "shift": {"button": 1}, "zoom": {"wheel": 2.0}}
    for name, options in moved.items():
        assert steered(Hands(**options)) == (wanted[name].camera, False)
        assert steered(Hands(**options, captured=True)) == (Viewpoint().camera, False)
        assert steered(Hands(**options), instead=object()) == (Viewpoint().camera, False)  # no head would show it
    assert steered(Hands("5")) == (wanted["press"].camera, False)
    assert steered(Hands("5"), instead=object()) == (Camera.front(), False)
    assert steered(Hands("5", captured=True)) == steered(Hands("6")) == steered(Hands("esc")) == (Camera.front(), False)


def test_a_kiosk_hears_escape_alone() -> None:
    hands = Hands("5", button=0, wheel=1.0)
    assert steered(hands, kiosk=True) == (Camera.front(), False) and hands.cursor == -1
    assert steered(Hands("esc"), kiosk=True) == (Camera.front(), True)


def test_a_window_closes_after_its_seconds() -> None:
    window = _Window(Hands(), lambda: values(), Viewpoint(), Renderer, "fast")
    window._imgui.io.display_framebuffer_scale = SimpleNamespace(x=2.0, y=1.5)
    assert window._pixels() == (640, 360)
    for seconds, closed in ((None, False), (1000.0, False), (0.0, True)):
        window.params, window.seconds = SimpleNamespace(app_shall_exit=False), seconds
        window.check()
        assert window.params.app_shall_exit == closed


def test_the_first_exception_is_kept_and_nothing_is_called_after_it() -> None:
    window = _Window(Hands(), lambda: values(), Viewpoint(), Renderer, "fast")
    window.params = SimpleNamespace(app_shall_exit=False)
    called: list[int] = []
    window.as_callback(lambda: called.append(1))()
    window.as_callback(lambda: called.append(1 // 0))()
    window.as_callback(lambda: called.append(2))()
    assert called == [1] and isinstance(window.failure, ZeroDivisionError) and window.params.app_shall_exit


def test_a_windows_options_are_given_by_name() -> None:
    with pytest.raises(TypeError, match="positional"):
        run_window(BallHead(), lambda: values(), (320, 240))  # type: ignore[misc]


class Opened:
    """A window's callbacks over a context without a window, its framebuffer (320 x 240) and what it asked for."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, quality: str) -> None:
        self.ctx, self.asked, self.posed, self.hurried = open_context(), [], 0, 0
        monkeypatch.setattr("moderngl.create_context", self.create)
        self.hands = Hands()
        self.hands.io.display_framebuffer_scale = SimpleNamespace(x=1.0, y=1.0)
        make = partial(Renderer, head=BallHead())
        self.window = _Window(self.hands, self.source, Viewpoint(), make, quality)
        self.window.params = SimpleNamespace(app_shall_exit=False)
        self.frame = self.ctx.framebuffer([self.ctx.renderbuffer((400, 300), 4)])

    def create(self, **settings: object) -> moderngl.Context:
        self.asked.append(settings)
        return self.ctx

    def source(self) -> np.ndarray:
        self.posed += 1
        return values(jawOpen=0.5)

    def draw(self, width: float = 320.0, height: float = 240.0) -> np.ndarray:
        self.hands.io.display_size = SimpleNamespace(x=width, y=height)
        self.frame.scissor = None
        self.frame.use()
        self.frame.clear(1.0, 0.0, 1.0)
        self.window.background()
        return np.flipud(np.frombuffer(self.frame.read(), np.uint8).reshape(300, 400, 3)).astype(int)


@pytest.mark.parametrize("quality", ["full", "fast"])
def test_the_head_is_drawn_into_what_is_bound(gl: None, monkeypatch: pytest.MonkeyPatch, quality: str) -> None:
    with Offscreen(BallHead(), (320, 240), quality=quality) as screen:
        screen.draw(values(jawOpen=0.5))
        wanted = screen.read().astype(int)
    opened = Opened(monkeypatch, quality)
    window = opened.window
    window.background()
    assert (window.frames, opened.posed) == (0, 0), "nothing is drawn before the window has started"
    window.start()
    assert opened.asked == [{"require": 310}]
    picture = opened.draw()
    assert np.abs(picture[60:, :320] - wanted).max() <= 1
    assert (picture[:60] == [255, 0, 255]).all() and (picture[:, 320:] == [255, 0, 255]).all()
    assert window.frames == 1 and window.first == window.last > 0.0
    (drawing,) = window._drawings.values()
    before, first = drawing.target, window.first
    assert (opened.draw() == picture).all() and drawing.target is before
    assert window.frames == opened.posed == 2 and window.first == first < window.last
    window.stop()
    opened.ctx.release()


def test_a_window_that_changes_its_size_gets_another_target_and_releases_the_old_one(
    gl: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened, released = Opened(monkeypatch, "fast"), []
    real = Target.release
    monkeypatch.setattr(Target, "release", lambda target: (released.append(target.size), real(target)))
    opened.window.start()
    opened.draw()
    small = opened.draw(160.0, 120.0)
    drawing = opened.window._drawings["fast"]
    assert released == [(320, 240)] and drawing.target.size == (160, 120)
    assert small[180:, :160].std() > 20 and (small[:180] == [255, 0, 255]).all()
    assert (opened.draw(0.0, 120.0) == [255, 0, 255]).all(), "a minimised window draws nothing"
    assert (opened.window.frames, opened.posed) == (2, 2)
    renderer = drawing.renderer
    ended: list[int] = []
    monkeypatch.setattr(renderer, "release", lambda: ended.append(1))
    opened.window.stop()
    opened.window.stop()
    assert released == [(320, 240), (160, 120)] and ended == [1]
    assert not opened.window._drawings
    opened.ctx.release()


def test_a_window_one_pixel_high_is_drawn(gl: None, monkeypatch: pytest.MonkeyPatch) -> None:
    opened = Opened(monkeypatch, "fast")
    opened.window.start()
    opened.draw(20.0, 1.0)
    assert opened.window.frames == 1
    slept: list[float] = []
    monkeypatch.setattr("surface.view.window.time.sleep", slept.append)
    opened.window.check()
    assert slept == [] and not opened.window.params.app_shall_exit
    opened.window.stop()
    opened.ctx.release()


def test_a_window_without_opengl_says_how_to_draw_in_software(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(**settings: object) -> None:
        raise ValueError("version 2.1")

    monkeypatch.setattr("moderngl.create_context", refuse)
    window = _Window(Hands(), lambda: values(), Viewpoint(), Renderer, "fast")
    with pytest.raises(ViewError, match=r"no OpenGL 3\.1: version 2\.1") as caught:
        window.start()
    assert "LIBGL_ALWAYS_SOFTWARE=1" in caught.value.hint


@pytest.mark.parametrize(("software", "simplified"), [(True, True), (False, False)])
def test_only_in_software_a_window_hurries(
    gl: None, monkeypatch: pytest.MonkeyPatch, software: bool, simplified: bool
) -> None:
    monkeypatch.setattr("surface.view.live.is_software", lambda ctx: software)
    opened = Opened(monkeypatch, "full")
    opened.window.start()
    assert opened.window._drawings["full"].renderer._simplified == simplified
    opened.window.stop()
    opened.ctx.release()


def test_seconds_are_counted_from_the_first_picture_or_the_first_call(monkeypatch: pytest.MonkeyPatch) -> None:
    window = _Window(Hands(), lambda: values(), Viewpoint(), Renderer, "fast")
    window._imgui.io.display_framebuffer_scale = SimpleNamespace(x=1.0, y=1.0)
    window.params, window.seconds = SimpleNamespace(app_shall_exit=False), 5.0
    clock = [100.0]
    monkeypatch.setattr("surface.view.window.time.perf_counter", lambda: clock[0])

    def closes(now: float) -> bool:
        clock[0], window.params.app_shall_exit = now, False
        window.check()
        return bool(window.params.app_shall_exit)

    assert [closes(now) for now in (100.0, 104.9, 105.0)] == [False, False, True]
    window.frames, window.first = 1, 103.0
    assert [closes(now) for now in (107.9, 108.0)] == [False, True]
    window.seconds, asked = None, [True, False]
    window.keep_going = lambda: asked.pop(0)
    assert [closes(999.0), closes(999.0)] == [False, True]


SCALED = """
import json, subprocess, sys
sys.path[:0] = [{root!r}, {here!r}]
subprocess.run(["xrdb", "-merge"], input="Xft.dpi: {dpi}\\n", text=True, check=True)
from ball_head import BallHead, values
from imgui_bundle import imgui
from surface.view import run_window
from surface.view.docks import Dock, PictureArea
told, area, frames = [], PictureArea(), [0]
def panel():
    frames[0] += 1
    told[:] = [imgui.get_font_size(), imgui.get_window_size().x]
run_window(BallHead(), lambda: values(), size={size}, docks=[Dock("a", "left", panel)], area=area,
           keep_going=lambda: frames[0] < 8)
print(json.dumps(told))
"""


@pytest.mark.slow
@pytest.mark.skipif(
    shutil.which("xvfb-run") is None or shutil.which("xrdb") is None,
    reason="needs xvfb-run and xrdb (apt-get install xvfb x11-xserver-utils)",
)
def test_text_and_panels_are_twice_as_large_on_a_desktop_at_200_percent() -> None:
    here = Path(__file__).parents[1]

    def told(dpi: int, size: tuple[int, int] = (800, 450), screen: str = "1600x1200") -> list[float]:
        program = SCALED.format(root=str(here.parents[1]), here=str(here), dpi=dpi, size=size)
        server = f"-screen 0 {screen}x24 -noreset"  # else what xrdb has set is lost with it
        command = ["xvfb-run", "-a", "-s", server, sys.executable, "-c", program]
        environment = os.environ | {"LIBGL_ALWAYS_SOFTWARE": "1"}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=240, check=False)
        assert done.returncode == 0, done.stderr
        found: list[float] = json.loads(done.stdout.splitlines()[-1])
        return found

    plain, doubled = told(96), told(192)
    assert doubled[0] == pytest.approx(2 * plain[0], rel=0.02)
    assert doubled[1] == pytest.approx(2 * plain[1], rel=0.02)
    small = told(192, (800, 600), "800x600")  # no room for twice the window, nor for twice the text in the panel
    assert 1.3 * plain[0] < small[0] < doubled[0] and small[1] > 22.0 * small[0]
