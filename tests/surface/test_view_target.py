"""surface.view.target"""

from __future__ import annotations

import numpy as np
import pytest
from ball_head import BallHead, values

from surface.view import Camera, Offscreen
from surface.view.target import union


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


def test_union() -> None:
    assert union((10, 10, 5, 5), (0, 12, 4, 10)) == (0, 10, 15, 12)
    assert union((0, 0, 0, 0), (3, 4, 5, 6)) == (3, 4, 5, 6)
    assert union((3, 4, 5, 6), (9, 9, 0, 3)) == (3, 4, 5, 6)


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
