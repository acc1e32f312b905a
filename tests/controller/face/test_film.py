"""controller.face.film: what each picture of a film shows and when, with a screen that only notes what it draws."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.face import film
from controller.face.still import Still
from controller.layers.commands import CommandState
from controller.takes.recording import recorded
from controller.tools.motion_file import load_motion

JAW, YAW = P.index("jawOpen"), P.index("headYaw")


class Screen:
    """Stands for the picture without a window; ``drawn`` : the values and the camera of each picture."""

    def __init__(self, head: Any, size: tuple[int, int], **how: Any) -> None:
        self.size, self.how, self.drawn = size, how, list[tuple[np.ndarray, str]]()

    def __enter__(self) -> Screen:
        return self

    def __exit__(self, *_: object) -> None:
        self.drawn.append((np.zeros(0), "closed"))

    def render(self, values: np.ndarray, camera: str) -> np.ndarray:
        self.drawn.append((values, camera))
        return np.full((1, 1, 3), len(self.drawn))


def test_every_row_is_a_picture_at_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    screens, swayed, written, told = list[Screen](), list[tuple[Any, float]](), list[Any](), list[tuple[int, int]]()
    lived = list[tuple[float, float]]()
    head = SimpleNamespace(
        parameters=list(P.names),
        live=lambda *of: lived.append(of),
        sway=SimpleNamespace(advance=lambda angles, at_s: swayed.append((angles, at_s))),
    )
    look = SimpleNamespace(
        make_camera=lambda: "camera",
        make_theme=lambda: "theme",
        still_quality="full",
        evaluator="cpu",
        dressed=False,
    )
    still: Any = SimpleNamespace(
        load_head=lambda chord_mm: {0.5: head}[chord_mm],
        look=look,
        size=(64, 48),
        parameters=P,
        chord_mm=0.5,
        wall=None,
    )

    def screen(*given: Any, **how: Any) -> Screen:
        screens.append(Screen(*given, **how))
        return screens[-1]

    def write(pictures: Any, out: Path, **how: Any) -> int:
        written.append((out, how))
        return len(list(pictures))

    monkeypatch.setattr(film, "Offscreen", screen)
    monkeypatch.setattr(film, "framed", lambda camera, of, worn: f"{camera} of the head" * (of is head and not worn))
    monkeypatch.setattr(film, "write_clip", write)
    monkeypatch.setattr(film, "head_angles", lambda values: float(values[YAW]))
    rows, lives = np.zeros((3, 1, len(P))), np.array([[[1.0, 0.1]], [[2.0, -0.1]], [[3.0, 0.0]]])
    rows[:, 0, JAW], rows[:, 0, YAW] = (0.0, 0.5, 1.0), (0.1, 0.2, 0.3)
    count = film.draw_film(still, rows, lives, Path("a.mp4"), 4.0, Path("a.wav"), lambda *done: told.append(done))
    assert count == 3 and written == [(Path("a.mp4"), {"fps": 4.0, "sound": Path("a.wav"), "count": 3})]
    assert told == [(1, 3), (2, 3), (3, 3)]
    assert swayed == [(0.1, 0.0), (0.2, 0.25), (0.3, 0.5)]
    assert lived == [(1.0, 0.1), (2.0, -0.1), (3.0, 0.0)]
    made = screens[0]
    assert made.size == (64, 48) and made.how == {"quality": "full", "theme": "theme", "evaluator": "cpu"}
    assert [camera for _, camera in made.drawn] == ["camera of the head"] * 3 + ["closed"]
    assert [values[JAW] for values, _ in made.drawn[:3]] == [0.0, 0.5, 1.0]


def test_what_a_motion_does_not_move_is_as_in_the_picture_and_all_is_in_range() -> None:
    values, mask = P.neutral(), np.zeros(len(P), bool)
    values[JAW], values[YAW], mask[YAW] = 0.25, 0.75, True
    motion = np.zeros((3, len(P)))
    motion[:, YAW], motion[:, JAW] = (-0.5, 2.0, -2.0), 0.9
    rows = film.base_of(SimpleNamespace(values=values, parameters=P), motion, mask)  # type: ignore[arg-type]
    assert rows[:, YAW].tolist() == [-0.5, 1.0, -1.0] and rows[:, JAW].tolist() == [0.25] * 3
    assert film.FPS == 30.0


TAKE = "time,jawOpen\n0,0.5\n4,0.5\n"
DUET = '[[heads]]\nname = "maple"\nliveliness = 0.0\n[[heads]]\nname = "oak"\n'


def rows_of(folder: Path, more: str | None, *settings: str, path: str = "a.csv", head: str | None = None) -> Any:
    """What a film of a file shows, at 20 frames a second, on a stage with ``more`` in its file; None: without one."""
    (folder / "a.csv").write_text(TAKE)
    if more is not None:
        (folder / "stage.toml").write_text(f'name = "stage"\n{more}')
    still = Still.parse(list(settings), [], head=head, stage=str(folder / "stage.toml") if more is not None else None)
    motion = load_motion(folder / path, still.parameters, 20.0)
    return film.film_rows(still, folder / path, motion.values, motion.mask, motion.lives, 20.0)


@pytest.mark.parametrize("stage", [None, "liveliness = 0.0\n"])
def test_without_idle_motion_a_film_is_the_take_itself(tmp_path: Path, stage: str | None) -> None:
    rows, lives = rows_of(tmp_path, stage, "headYaw=0.25")
    wanted = P.neutral()
    wanted[JAW], wanted[YAW] = 0.5, 0.25
    np.testing.assert_array_equal(rows, np.tile(wanted, (81, 1, 1)))
    assert lives.shape == (81, 1, 2) and not lives.any()


def test_a_film_of_a_lively_stage_lives_as_its_run_and_alike_each_time(tmp_path: Path) -> None:
    (rows, lives), again = (rows_of(tmp_path, "liveliness = 1.0\nseed = 3\n") for _ in range(2))
    other, half = (rows_of(tmp_path, more) for more in ("liveliness = 1.0\nseed = 4\n", "liveliness = 0.5\nseed = 3\n"))
    np.testing.assert_array_equal(rows, again[0])
    np.testing.assert_array_equal(lives, again[1])
    rise = lives[:, 0, 0]
    assert rise.min() < 0.1 and 2.9 < rise.max() <= 3.0 and np.abs(np.diff(rise)).max() < 0.45  # [breath] rise_mm
    assert (lives[..., 1] != other[1][..., 1]).any() and (rows != other[0]).any()
    np.testing.assert_allclose(half[1], 0.5 * lives, atol=1e-9)
    assert np.ptp(rows[:, 0, YAW]) > 0.002 and rows[20:, 0, JAW] == pytest.approx(0.5)


def test_what_options_set_is_held_beside_the_idle_motion_unless_the_take_moves_it(tmp_path: Path) -> None:
    rows, _ = rows_of(tmp_path, "liveliness = 1.0\n", "headYaw=0.25", "jawOpen=0.9")
    assert rows[:, 0, YAW] == pytest.approx(0.25) and rows[20:, 0, JAW] == pytest.approx(0.5)


def test_a_stage_of_several_heads_is_played_on_all_of_them(tmp_path: Path) -> None:
    rows, lives = rows_of(tmp_path, "liveliness = 1.0\n" + DUET, "headYaw=0.25", "jawOpen=0.2")
    assert rows.shape == (81, 2, len(P)) and rows[..., YAW] == pytest.approx(0.25)
    assert rows[20:, 0, JAW] == pytest.approx(0.5) and rows[:, 1, JAW] == pytest.approx(0.2)
    assert not lives[:, 0].any() and lives[:, 1, 0].max() > 2.0  # the first has no idle motion of its own


def test_one_head_that_is_named_beside_such_a_stage_lives_as_its_first(tmp_path: Path) -> None:
    rows, lives = rows_of(tmp_path, "liveliness = 1.0\n" + DUET, head="ict")
    assert rows.shape == (81, 1, len(P)) and rows[:, 0, JAW] == pytest.approx(0.5) and not lives.any()
    _, lives = rows_of(tmp_path, DUET.replace("0.0", "1.0"), head="ict")
    assert lives[:, 0, 0].max() > 2.0


@pytest.mark.parametrize(
    ("more", "heads"), [("liveliness = 1.0\n", 1), ("control_hz = 50\nliveliness = 1.0\n" + DUET, 2)]
)
def test_a_recording_is_shown_as_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, more: str, heads: int) -> None:
    if heads == 1:
        monkeypatch.setattr(film, "play_offline", None)  # no layers are needed
    shown, beside, out = [], [], P.neutral()
    with recorded(CommandState(P), tmp_path / "a.rec") as state:
        state.live(1.0, 0)
        state.set_parameters([JAW], [0.6], 1)
        for k in range(101):
            state.tick(10_000_000 * (k + 1), 0.01, out)
            shown.append(out.copy())
            beside.append(state.beside)
    rows, lives = rows_of(tmp_path, more, "jawOpen=0.1", "tongueOut=0.3", path="a.rec")
    assert rows.shape == (21, heads, len(P)) and rows[:, 0, P.index("tongueOut")] == pytest.approx(0.3)
    moved = np.arange(len(P)) != P.index("tongueOut")
    np.testing.assert_allclose(rows[:, 0, moved], np.array(shown)[::5, moved], atol=1e-9)
    np.testing.assert_allclose(lives[:, 0], beside[::5], atol=1e-9)


def test_all_heads_of_a_stage_are_drawn_at_the_time_of_each_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    asked, done = list[Any](), list[tuple[int, int]]()

    class Wall:
        """Stands for the heads; joined they are two pixels wide and one high."""

        def __init__(self, *of: Any) -> None:
            asked.append(of)

        def __enter__(self) -> Wall:
            return self

        def __exit__(self, *_: object) -> None:
            asked.append("closed")

        def pictures(self, rows: np.ndarray, lives: np.ndarray, time_s: float) -> float:
            asked.append((rows.tolist(), lives.tolist(), time_s))
            return time_s

        def join(self, at_s: float) -> np.ndarray:
            return np.full((1, 2, 3), 4 * at_s, np.uint8)

    monkeypatch.setattr(film, "Wall", Wall)
    monkeypatch.setattr(film, "write_clip", lambda pictures, out, **how: [each.tolist() for each in pictures])
    still: Any = SimpleNamespace(wall="stage", parameters=P, size=(3, 1))
    rows, lives = np.arange(4.0).reshape(2, 2, 1), np.arange(8.0).reshape(2, 2, 2)
    written: Any = film.draw_film(still, rows, lives, Path("a.webp"), 4.0, progress=lambda *of: done.append(of))
    assert written == [[[[0] * 3] * 3], [[[1] * 3] * 3]] and done == [(1, 2), (2, 2)]
    wanted = [(rows[k].tolist(), lives[k].tolist(), k / 4) for k in range(2)]
    assert asked == [("stage", P, (3, 1)), *wanted, "closed"]


def test_a_picture_is_filled_to_its_size_by_its_borders() -> None:
    picture = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)
    found = film.filled(picture, (3, 4))
    assert found.shape == (4, 3, 3) and found.dtype == np.uint8
    np.testing.assert_array_equal(found[:2, :2], picture)
    np.testing.assert_array_equal(found[3, 2], picture[1, 1])
    np.testing.assert_array_equal(film.filled(picture, (1, 2)), picture)
