"""controller.face.live_wall: all heads of a stage in one picture of a window's context."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest

from controller.base.mailboxes import Mailbox
from controller.base.parameters import PARAMETERS as P
from controller.face import live_wall
from controller.face.live_wall import LiveWall
from controller.face.wall import load_heads
from controller.stage.stage import heads_of
from surface.view.draw.target import read_pixels
from surface.view.pictures.offscreen import open_context
from tests.controller.face.test_wall import stage_of

JAW = P.index("jawOpen")


@contextmanager
def wall_of(tmp_path: Path, *heads: str) -> Iterator[tuple[LiveWall, list[Mailbox]]]:
    stage = stage_of(tmp_path, *heads)
    with ExitStack() as stack:
        boxes = [stack.enter_context(Mailbox.create(len(P))) for _ in heads]
        for box in boxes:
            box.publish(P.neutral())
        yield LiveWall(load_heads(heads_of(stage), P), P, boxes, "fast"), boxes


@pytest.mark.slow
def test_heads_appear_one_look_after_the_other_and_each_shows_its_own_face(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live_wall, "FRAME_S", 1000.0)
    with wall_of(tmp_path, "", 'person = "oak"', "") as (wall, boxes), open_context() as ctx:

        def tiles(size: tuple[int, int] = (195, 80)) -> list[np.ndarray]:
            picture = read_pixels(wall.draw(ctx, size))
            assert picture.shape == (size[1], size[0], 3)
            return [
                picture[int(top) : int(top + height), int(left) : int(left + width)]
                for left, top, width, height in wall.boxes(size)
            ]

        first, waiting, third = tiles()
        assert first.any() and not waiting.any()
        np.testing.assert_array_equal(first, third)
        first, oak, _ = tiles()
        assert (first != oak).mean() > 0.2
        face = P.neutral()
        face[JAW] = 1.0
        boxes[2].publish(face)
        again, same, opened = tiles()
        np.testing.assert_array_equal(again, first)
        np.testing.assert_array_equal(same, oak)
        assert (opened != first).mean() > 0.01
        boxes[2].publish(face, 0, (6.0, 0.0))
        boxes[1].publish(P.neutral(), 0, (6.0, 0.0))
        again, same, breathing = tiles()
        np.testing.assert_array_equal(again, first)
        assert (breathing[60:] != opened[60:]).any() and (same[60:] != oak[60:]).any()
        np.testing.assert_array_equal(breathing[:40], opened[:40])
        assert [tile.shape for tile in tiles((100, 300))] == [(100, 100, 3)] * 3
        wall.release()
        wall.release()  # nothing is released twice


@pytest.mark.slow
def test_heads_take_turns_where_all_take_too_long(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_wall, "FRAME_S", 0.0)
    with wall_of(tmp_path, "", 'person = "oak"', "") as (wall, _), open_context() as ctx:
        drawn = []
        for _ in range(5):
            picture = read_pixels(wall.draw(ctx, (195, 80)))
            drawn.append([bool(picture[:, x : x + 65].any()) for x in (0, 65, 130)])
        wall.release()
    assert [sum(row) for row in drawn] == [1, 2, 3, 3, 3]  # one more in each frame


def test_a_picture_too_small_for_its_tiles_is_drawn_all_the_same(tmp_path: Path) -> None:
    with wall_of(tmp_path, "", "", "") as (wall, _), open_context() as ctx:
        assert wall.draw(ctx, (2, 1)).size == (2, 1)
        wall.release()


def test_tiles_share_the_picture_and_what_is_left_is_beside_them(tmp_path: Path) -> None:
    with wall_of(tmp_path, "", "", "") as (wall, _):
        assert wall.boxes((200, 80)) == [(1, 0, 66, 80), (67, 0, 66, 80), (133, 0, 66, 80)]


def test_heads_that_look_alike_are_loaded_once_and_loading_can_be_cancelled(tmp_path: Path) -> None:
    stages = heads_of(stage_of(tmp_path, "", 'person = "oak"', ""))
    asked = iter([True, False])
    (only,) = load_heads(stages, P, lambda: next(asked))
    assert only.places == [0] and only.stage is stages[0]
