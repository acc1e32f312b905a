"""surface.view.pictures.offscreen"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ball_head import BallHead, values

from surface.base.errors import MissingPackage, ViewError
from surface.head import Head
from surface.view import Camera, Offscreen
from surface.view.pictures.offscreen import NO_OPENGL_HINT, open_context
from surface.view.scene.sampling import AdaptiveSampling

OLD_OPENGL = """
import sys
sys.path[:0] = [{root!r}, {here!r}]
import numpy as np
from ball_head import BallHead, values
from surface.head import Head
from surface.view import Offscreen
for quality in ("full", "fast"):
    with Offscreen(BallHead(), (160, 120), quality=quality) as screen:
        assert screen.ctx.version_code == 310, screen.ctx.version_code
        np.save({out!r} + quality, screen.render(values(jawOpen=0.6)))
        screen.draw(values(jawOpen=0.3))
        screen.finish()
        assert screen.ctx.error == "GL_NO_ERROR", screen.ctx.error
head = Head.load(sys.path[0] + "/configs/heads/ict")
with Offscreen(head, (160, 120), evaluator="gpu") as screen:
    assert screen.ctx.version_code == 310, screen.ctx.version_code
    np.save({out!r} + "gpu", screen.render(np.full(len(head.parameters), 0.2)))
    assert screen.ctx.error == "GL_NO_ERROR", screen.ctx.error
"""


@pytest.mark.slow
def test_draws_on_opengl_31(gl: None, root: Path, tmp_path: Path) -> None:
    script = OLD_OPENGL.format(root=str(root), here=str(root / "tests" / "surface"), out=f"{tmp_path}/")
    old = {"MESA_GL_VERSION_OVERRIDE": "3.1", "MESA_GLSL_VERSION_OVERRIDE": "140", "LIBGL_ALWAYS_SOFTWARE": "1"}
    done = subprocess.run([sys.executable, "-c", script], env=os.environ | old, capture_output=True, text=True)
    if "version_code" in done.stderr or "AssertionError: 4" in done.stderr:
        pytest.skip("this OpenGL driver is not Mesa: its version cannot be lowered")
    assert done.returncode == 0, done.stderr
    for quality in ("full", "fast"):
        with Offscreen(BallHead(), (160, 120), quality=quality) as screen:
            here = screen.render(values(jawOpen=0.6)).astype(float)
        assert np.abs(np.load(tmp_path / f"{quality}.npy") - here).mean() < 1.0
    head = Head.load(root / "configs" / "heads" / "ict")
    with Offscreen(head, (160, 120), evaluator="cpu") as screen:
        here = screen.render(np.full(len(head.parameters), 0.2)).astype(float)
    assert here.std() > 20
    assert np.abs(np.load(tmp_path / "gpu.npy") - here).mean() < 1.0


def test_no_driver_complaint(gl: None) -> None:
    with Offscreen(BallHead(), (64, 64)) as screen:
        screen.render(values(jawOpen=1))
        assert screen.ctx.error == "GL_NO_ERROR"


def test_draw_then_read_is_render(gl: None) -> None:
    with Offscreen(BallHead(), (64, 64)) as screen:
        screen.draw(values(jawOpen=1), Camera.three_quarter())
        screen.finish()
        drawn = screen.read()
        assert (screen.render(values(jawOpen=1), Camera.three_quarter()) == drawn).all()


@pytest.mark.slow
def test_close_twice_and_again(gl: None) -> None:
    for _ in range(3):
        screen = Offscreen(BallHead(), (32, 32))
        screen.render(values())
        screen.close()
        screen.close()


def test_two_at_once_do_not_disturb_each_other(gl: None) -> None:
    with Offscreen(BallHead(), (64, 64)) as one:
        alone = one.render(values())
        with Offscreen(BallHead(), (48, 48), quality="fast") as two:
            two.render(values(jawOpen=1))
        assert (one.render(values()) == alone).all()


@pytest.mark.parametrize("size", [(0, 100), (100, 1_000_000)])
def test_impossible_sizes(gl: None, size: tuple[int, int]) -> None:
    with pytest.raises(ViewError, match=f"{size[0]}x{size[1]}"):
        Offscreen(BallHead(), size)


def test_without_opengl_the_message_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(**options: object) -> None:
        raise Exception("libEGL.so not loaded")

    monkeypatch.setattr("moderngl.create_context", refuse)
    with pytest.raises(ViewError, match=r"libEGL\.so not loaded") as caught:
        open_context()
    assert caught.value.hint == NO_OPENGL_HINT


def test_without_moderngl_the_message_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "moderngl", None)
    with pytest.raises(MissingPackage, match="moderngl") as caught:
        open_context()
    assert caught.value.hint == "pip install 'omote[view]'"


def test_a_picture_is_1280_by_720_where_no_size_is_given_and_one_pixel_is_a_size(gl: None) -> None:
    with Offscreen(BallHead(), quality="fast") as screen:
        assert screen.render(values()).shape == (720, 1280, 3)
    with Offscreen(BallHead(), (1, 1)) as screen:
        assert screen.render(values()).shape == (1, 1, 3)


def test_egl_is_asked_first_then_the_platform_for_opengl_31(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[dict[str, object]] = []

    def refuse(**options: object) -> None:
        asked.append(options)
        raise Exception(f" reason {len(asked)} ")

    monkeypatch.setattr("moderngl.create_context", refuse)
    with pytest.raises(ViewError, match=r"no OpenGL 3\.1 without a window: reason 1; reason 2"):
        open_context()
    platform = {"standalone": True, "require": 310}
    assert asked == [platform | {"backend": "egl"}, platform]


def test_a_closed_picture_has_released_all_it_had_once(gl: None, monkeypatch: pytest.MonkeyPatch) -> None:
    screen, released = Offscreen(BallHead(), (32, 32)), list[str]()
    for name in ("renderer", "target"):
        thing = getattr(screen, name)
        monkeypatch.setattr(thing, "release", lambda name=name, real=thing.release: (released.append(name), real()))
    screen.close()
    screen.close()
    assert released == ["renderer", "target"]


def test_a_frame_in_flight_is_the_only_one(gl: None) -> None:
    with Offscreen(BallHead(), (64, 64), samples=1) as screen:
        screen.go_live()
        assert screen.target.samples == 1 and screen.renderer.revision == 0
        screen.draw(values())
        assert screen.target._pending is not None
        screen.finish()
        assert screen.target._pending is None


class Counted:
    """A context that counts how often the processor waits for all that was drawn."""

    def __init__(self, ctx: Any) -> None:
        self._ctx, self.waits = ctx, 0

    def finish(self) -> None:
        self.waits += 1
        self._ctx.finish()

    def __enter__(self) -> Any:
        return self._ctx.__enter__()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._ctx, name)


@pytest.mark.parametrize(("samples", "waits"), [(1, 2), (None, 0)])
def test_in_software_a_frame_waits_for_the_last_one_unless_its_edges_were_smoothed(
    gl: None, samples: int | None, waits: int
) -> None:
    """Smoothing the edges of a live picture has waited for it already."""
    with Offscreen(BallHead(), (32, 32), samples=samples) as screen:
        screen._fence, screen._sampling = None, AdaptiveSampling("full", samples, software=True)
        screen.go_live()
        screen.ctx = counted = Counted(screen.ctx)  # type: ignore[assignment]
        for _ in range(2):
            screen._frame(values(), None)
        assert counted.waits == waits
