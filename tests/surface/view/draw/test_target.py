"""surface.view.draw.target"""

from __future__ import annotations

import numpy as np
import pytest
from ball_head import BallHead, values

from surface.view import Camera, Offscreen
from surface.view.draw.renderer import Renderer
from surface.view.draw.target import Target, enlarged
from surface.view.pictures.offscreen import open_context


@pytest.mark.slow
@pytest.mark.parametrize("samples", [1, 4])
def test_drawing_only_what_moved_leaves_no_trace(gl: None, samples: int) -> None:
    poses = [
        (values(), Camera.front()),
        (values(headYaw=1), Camera.profile()),
        (values(jawOpen=1), Camera.front().zoom(0.5)),
    ]
    with Offscreen(BallHead(), (180, 150), samples=samples) as screen:
        moved = [screen.render(*pose) for pose in poses]
    for pose, picture in zip(poses, moved, strict=True):
        with Offscreen(BallHead(), (180, 150), samples=samples) as fresh:
            assert np.abs(fresh.render(*pose).astype(int) - picture).max() <= 1


def test_samples_smooth_the_outline(gl: None) -> None:
    steps = {}
    for samples in (1, 4):
        with Offscreen(BallHead(), (200, 200), samples=samples) as screen:
            row = screen.render(values())[:, :, 0].astype(int)
            steps[samples] = len(np.unique(row))
            assert screen.target.samples == samples
    assert steps[4] > 50


def test_a_head_out_of_sight_leaves_the_background(gl: None) -> None:
    away = Camera.front().aimed((9000.0, 0.0, 0.0))
    with Offscreen(BallHead(), (90, 80)) as screen:
        empty = screen.render(values(), away)
        screen.render(values(), Camera.front())
        assert (screen.render(values(), away) == empty).all()


def test_rows_are_top_first(gl: None) -> None:
    with Offscreen(BallHead(), (120, 100)) as screen:
        picture = screen.render(values(), Camera.front().aimed((0.0, 150.0, 40.0)))
    assert picture.shape == (100, 120, 3)
    assert picture.dtype == np.uint8
    assert picture[80, 60, 0] > 150 > picture[5, 60, 0]


def test_a_face_at_rest_is_not_drawn_again(gl: None, monkeypatch: pytest.MonkeyPatch) -> None:
    with Offscreen(BallHead(), (64, 64), samples=4) as screen:
        drawn: list[Camera] = []
        draw = screen.renderer.draw

        def counted(camera: Camera, *rest: object) -> None:
            drawn.append(camera)
            draw(camera, *rest)

        monkeypatch.setattr(screen.renderer, "draw", counted)
        first = screen.render(values())
        monkeypatch.setattr(screen.head, "pose", lambda values: _touch_nothing(screen))
        assert (screen.render(values()) == first).all()
        assert len(drawn) == 1
        screen.render(values(), Camera.profile())
        screen.renderer.set_background((0, 0, 0), (0, 0, 0))
        screen.render(values(), Camera.profile())
        assert len(drawn) == 3


def _touch_nothing(screen: Offscreen) -> None:
    """What a head does when the values are those it has."""
    for part in screen.head.parts:
        part.changed = []


def test_a_picture_drawn_smaller_looks_the_same_but_softer(gl: None) -> None:
    ctx = open_context()
    renderer = Renderer(ctx, BallHead(), quality="fast")
    renderer.update()
    pictures = []
    for scale in (1.0, 0.6):
        target = Target(ctx, (300, 260), 1, scale)
        target.paint(renderer, Camera.front())
        pictures.append(target.read().astype(int))
        target.release()
    assert (np.abs(pictures[0] - pictures[1]).max(axis=2) > 0).any()
    assert np.abs(pictures[0] - pictures[1]).mean() < 2.0
    renderer.release()
    ctx.release()


def test_a_smaller_picture_leaves_no_trace_when_the_head_moves(gl: None) -> None:
    ctx = open_context()
    renderer = Renderer(ctx, BallHead(), quality="fast")
    moving, fresh = Target(ctx, (200, 170), 1, 0.6), Target(ctx, (200, 170), 1, 0.6)
    for yaw, camera in ((0.0, Camera.front().zoom(0.7)), (1.0, Camera.profile()), (0.4, Camera.front().zoom(0.5))):
        renderer.pose(values(headYaw=yaw))
        renderer.update()
        moving.paint(renderer, camera)
    fresh.paint(renderer, camera)
    assert np.abs(moving.read().astype(int) - fresh.read()).max() <= 1
    ctx.release()


def test_a_picture_is_complete_when_it_is_read(gl: None) -> None:
    with Offscreen(BallHead(), (90, 80), samples=1) as screen:
        screen.draw(values(jawOpen=0.0))
        screen.draw(values(jawOpen=1.0))
        late = screen.read()
        assert (screen.render(values(jawOpen=1.0)) == late).all()
        assert (screen.render(values(jawOpen=0.0)) != late).any()


def test_enlarged_rectangles_hold_what_their_edge_reaches() -> None:
    whole, part = enlarged(np.array([[0, 0, 60, 60], [10, 20, 15, 26]]), (60, 60), (100, 100))
    assert whole.tolist() == [0, 0, 100, 100]
    left, bottom, right, top = part
    assert (left <= 9 / 0.6, bottom <= 19 / 0.6) == (True, True)
    assert (right >= 16 / 0.6, top >= 27 / 0.6) == (True, True)
    assert max(right - left, top - bottom) < 18


@pytest.mark.parametrize("samples", [1, 4])
def test_another_background_is_drawn_everywhere_and_the_same_one_only_around_the_head(gl: None, samples: int) -> None:
    with Offscreen(BallHead(), (180, 150), samples=samples) as screen:
        screen.render(values())
        screen.renderer.set_background((0.0, 0.0, 1.0), (0.0, 0.0, 1.0))
        blue = screen.render(values())
        corners = blue[[2, 2, -3, -3], [2, -3, 2, -3]].astype(int)
        assert corners[:, :2].max() <= 2 and corners[:, 2].min() > 150
        boxes = []
        real = screen.renderer.draw
        screen.renderer.draw = lambda camera, into, bands: (boxes.append(bands.box()), real(camera, into, bands))  # type: ignore[method-assign,assignment,func-returns-value]
        screen.render(values(jawOpen=1.0))
        assert len(boxes) == 1 and boxes[0][2] < 120
        away = Camera.front().aimed((9000.0, 0.0, 0.0))
        screen.render(values(), away)
        screen.render(values(jawOpen=0.1), away)
        assert len(boxes) == 2, "where no head is and was, nothing is drawn"


def test_targets_have_at_least_a_pixel_and_a_sample(gl: None) -> None:
    ctx = open_context()
    wanted = (((1, 1), 1, 0.1, (1, 1)), ((10, 20), 1, 0.6, (6, 12)), ((10, 20), 2, 0.6, (10, 20)))
    for size, samples, scale, inner in wanted:
        target = Target(ctx, size, samples, scale)
        assert (target.size, target._drawn.size, target.samples) == (size, inner, samples)
        assert target.scale == (scale if samples == 1 else 1.0)
        target.release()
    most = Target(ctx, (8, 8), 10_000)
    assert most.samples == ctx.max_samples and Target(ctx, (8, 8), 0).samples == 1
    assert Target(ctx, (8, 8)).samples == min(4, ctx.max_samples)
    ctx.release()


def test_enlarged_rectangles_reach_a_pixel_of_the_smaller_picture_further() -> None:
    assert enlarged(np.array([[10, 20, 15, 25]]), (50, 50), (100, 100)).tolist() == [[18, 38, 33, 53]]
    assert enlarged(np.array([[0, 1, 50, 49]]), (50, 50), (100, 100)).tolist() == [[0, 0, 100, 100]]
