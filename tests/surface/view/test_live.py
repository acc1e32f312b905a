"""surface.view.live: a head drawn frame after frame, whose target follows the size and the samples."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from ball_head import BallHead, values

from surface.view import live as module
from surface.view.draw.renderer import Renderer
from surface.view.live import LiveDrawing
from surface.view.pictures.offscreen import open_context
from surface.view.scene.camera import Camera
from surface.view.scene.sampling import BUDGET_S, SCALE


@pytest.fixture
def drawing(gl: None, monkeypatch: pytest.MonkeyPatch) -> Iterator[LiveDrawing]:
    """The ball head in the quality "full", on a machine that draws by itself."""
    monkeypatch.setattr(module, "is_software", lambda ctx: False)
    yield from made("full")


def made(quality: str) -> Iterator[LiveDrawing]:
    ctx = open_context()
    found = LiveDrawing(Renderer(ctx, BallHead(), quality=quality))
    yield found
    found.release()
    ctx.release()


def pixels(drawing: LiveDrawing) -> np.ndarray:
    """(height, width, 4) of the last picture, its bottom row first."""
    width, height = drawing.target.size
    return np.frombuffer(drawing.target.texture.read(), np.uint8).reshape(height, width, 4)


def test_every_frame_has_the_size_that_was_set(drawing: LiveDrawing) -> None:
    assert drawing.size == (1, 1)
    drawing.size = (64, 48)
    drawing.draw(values())
    first = drawing.target
    assert first.size == (64, 48) and pixels(drawing).std() > 5.0
    drawing.draw(values())
    assert drawing.target is first
    drawing.size = (96, 48)
    drawing.draw(values())
    assert drawing.target is not first and drawing.target.size == (96, 48)


def test_a_target_that_is_replaced_is_released(drawing: LiveDrawing, monkeypatch: pytest.MonkeyPatch) -> None:
    released: list[object] = []
    real = module.Target.release
    monkeypatch.setattr(module.Target, "release", lambda target: (released.append(target), real(target)))
    drawing.size = (64, 48)
    drawing.draw(values())
    first = drawing.target
    drawing.draw(values())
    assert released == []
    drawing.size = (32, 32)
    drawing.draw(values())
    assert released == [first]


def test_a_camera_of_one_s_own_shows_the_head_from_elsewhere(drawing: LiveDrawing) -> None:
    drawing.size = (64, 64)
    drawing.draw(values())
    front = pixels(drawing).copy()
    drawing.draw(values(), Camera.front())
    np.testing.assert_array_equal(pixels(drawing), front)
    drawing.draw(values(), Camera.around(80.0, 30.0))
    assert (pixels(drawing) != front).any()


def test_the_head_has_the_pose_of_each_frame(drawing: LiveDrawing, monkeypatch: pytest.MonkeyPatch) -> None:
    posed: list[np.ndarray] = []
    monkeypatch.setattr(drawing.renderer, "pose", posed.append)
    one, two = values(), values()
    for each in (one, two):
        drawing.draw(each)
    assert posed[0] is one and posed[1] is two


def test_slow_frames_lead_to_fewer_samples(drawing: LiveDrawing, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter(np.arange(0.0, 100.0, 2.0 * BUDGET_S).tolist())
    monkeypatch.setattr(module.time, "perf_counter", lambda: next(clock))
    drawing.size = (32, 32)
    drawing.draw(values())
    first, samples = drawing.target, drawing.target.samples
    for _ in range(16):
        drawing.draw(values())
    if samples > 1:
        assert drawing.target is not first
    assert drawing.target.samples == 1


@pytest.mark.parametrize(("quality", "scale"), [("full", 1.0), ("fast", SCALE)])
def test_a_processor_draws_simpler_pictures_from_the_first_on(
    gl: None, monkeypatch: pytest.MonkeyPatch, quality: str, scale: float
) -> None:
    hurried: list[int] = []
    monkeypatch.setattr(module, "is_software", lambda ctx: True)
    monkeypatch.setattr(Renderer, "hurry", lambda renderer: hurried.append(1))
    for drawing in made(quality):
        drawing.size = (50, 40)
        drawing.draw(values())
        assert hurried == [1] and drawing.target.samples == 1 and drawing.target.scale == scale


def test_one_that_never_drew_is_released(gl: None) -> None:
    for drawing in made("full"):
        assert not hasattr(drawing, "target")
