"""controller.face.wall: the heads of a stage side by side, each as it looks alone."""

from __future__ import annotations

from contextlib import ExitStack, closing
from pathlib import Path

import numpy as np
import pytest

from controller.base.mailboxes import Mailbox
from controller.base.parameters import PARAMETERS as P
from controller.face.face import Recorder
from controller.face.wall import Wall, WallFace, grid
from controller.stage.stage import Stage, load_stage

JAW = P.index("jawOpen")
SIZE = "[face]\nsize = [192, 80]\nquality = 'fast'\n"


def stage_of(tmp_path: Path, *heads: str) -> Stage:
    path = tmp_path / "stage.toml"
    tables = "".join(f'[[heads]]\nname = "h{i}"\n{head}\n' for i, head in enumerate(heads))
    path.write_text(f'name = "wall"\n{SIZE}{tables}')
    return load_stage(str(path), P)


@pytest.mark.parametrize(
    ("count", "size", "wanted"),
    [(1, (800, 600), (1, 1)), (3, (1280, 720), (3, 1)), (3, (300, 900), (1, 3)), (64, (1000, 1250), (8, 8))],
)
def test_tiles_leave_the_heads_as_large_as_can_be(count: int, size: tuple[int, int], wanted: tuple[int, int]) -> None:
    assert grid(count, size) == wanted


@pytest.mark.slow
def test_heads_that_look_alike_are_a_crowd_and_each_shows_its_own_face(tmp_path: Path) -> None:
    stage = stage_of(tmp_path, "", 'person = "oak"', "")
    rows = np.zeros((3, len(P)))
    rows[2, JAW] = 1.0
    with Wall(stage, P, (192, 80)) as wall:
        assert wall.names == ("h0", "h1", "h2") and wall.crowded and wall.columns == 3
        first, other, open_jaw = wall.pictures(rows)
        again = wall.pictures(rows[[0, 1, 0]])
        joined = wall.join([first, other, open_jaw])
    np.testing.assert_array_equal(again[2], first)  # the same face of the same person
    assert (first != other).mean() > 0.2 and (first != open_jaw).mean() > 0.01
    np.testing.assert_array_equal(joined[:, 64:128], other)


@pytest.mark.slow
def test_long_hair_sways_where_pictures_have_a_time(tmp_path: Path) -> None:
    rows = np.zeros((2, 2, len(P)))
    rows[1, :, P.index("headYaw")] = 0.5
    shown = list[list[np.ndarray]]()
    for times in ((0.0, 0.05), (0.0, 0.05), (None, None)):
        with Wall(stage_of(tmp_path, 'person = "willow"', 'person = "oak"'), P, (192, 80)) as wall:
            shown.append([wall.pictures(row, None, at_s)[0] for row, at_s in zip(rows, times, strict=True)])
    (first, swung), (_, again), (same, still) = shown
    np.testing.assert_array_equal(first, same)
    np.testing.assert_array_equal(swung, again)
    assert (swung != still).any()


@pytest.mark.slow
def test_the_newest_face_of_every_head_is_drawn_and_kept(tmp_path: Path) -> None:
    stage = stage_of(tmp_path, 'person = "oak"', "")
    with ExitStack() as stack:
        boxes = [stack.enter_context(Mailbox.create(len(P))) for _ in stage.heads]
        recorder = Recorder(whole=True)
        with closing(WallFace(stage, P, boxes, recorder)) as face:
            asked = iter([True, True, False])

            def keep_going() -> bool:
                row = P.neutral()
                row[JAW] = 1.0
                boxes[1].publish(row, 1)
                return next(asked)

            face.run(keep_going)
            report = face.report()
    assert report["frames"] == 2 and report["heads"] == ["h0", "h1"]
    assert recorder.frames[0].shape == (80, 192, 3)


@pytest.mark.slow
@pytest.mark.parametrize("heads", [('person = "oak"', ""), ("", "")])
def test_without_a_recorder_heads_are_drawn_and_nothing_is_kept(tmp_path: Path, heads: tuple[str, str]) -> None:
    stage = stage_of(tmp_path, *heads)
    with ExitStack() as stack:
        boxes = [stack.enter_context(Mailbox.create(len(P))) for _ in heads]
        with closing(WallFace(stage, P, boxes)) as face:
            asked = iter([True, True, False])
            face.run(lambda: next(asked))
            assert face.report()["frames"] == 2


@pytest.mark.slow
@pytest.mark.parametrize("heads", [("", ""), ("", 'person = "oak"')])
def test_each_head_of_a_wall_breathes_by_itself(tmp_path: Path, heads: tuple[str, str]) -> None:
    stage, seen = stage_of(tmp_path, *heads), []
    with ExitStack() as stack:
        boxes = [stack.enter_context(Mailbox.create(len(P))) for _ in heads]
        recorder = Recorder(whole=True, clip_hz=1e6)
        with closing(WallFace(stage, P, boxes, recorder)) as face:
            asked = iter([True, True, True, False])

            def keep_going() -> bool:
                rise_mm = 6.0 if seen else 0.0
                boxes[1].publish(P.neutral(), 0, (rise_mm, 0.2 if seen else 0.0))
                seen.append(rise_mm)
                return next(asked)

            face.run(keep_going)
    first, *_, last = (frame.astype(int) for frame in recorder.frames)
    changed = np.abs(last - first).max(axis=2) > 3
    assert not changed[:, :96].any() and changed[60:, 96:].any()
