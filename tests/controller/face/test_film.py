"""controller.face.film: what each picture of a film shows and when, with a screen that only notes what it draws."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.face import film
from controller.layers.idle.settings import IdleSettings

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
        stage=None,
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
    rows = np.zeros((3, len(P)))
    rows[:, JAW], rows[:, YAW] = (0.0, 0.5, 1.0), (0.1, 0.2, 0.3)
    count = film.draw_film(still, rows, Path("a.mp4"), 4.0, Path("a.wav"), lambda *done: told.append(done))
    assert count == 3 and written == [(Path("a.mp4"), {"fps": 4.0, "sound": Path("a.wav")})]
    assert told == [(1, 3), (2, 3), (3, 3)]
    assert swayed == [(0.1, 0.0), (0.2, 0.25), (0.3, 0.5)]
    assert lived == [(0.0, 0.0)] * 3  # no stage, no idle motion
    film.draw_film(still, rows, Path("a.mp4"), 4.0, lives=np.array([[1.0, 0.1], [2.0, -0.1], [3.0, 0.0]]))
    assert lived[3:] == [(1.0, 0.1), (2.0, -0.1), (3.0, 0.0)]
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


def _of_stage(liveliness: float, seed: int) -> Any:
    settings = SimpleNamespace(liveliness=liveliness, seed=seed)
    life = IdleSettings.named("natural", P)
    return SimpleNamespace(parameters=P, stage=SimpleNamespace(settings=settings, life=life))


def test_a_film_of_a_lively_stage_breathes_as_its_run_and_alike_each_time() -> None:
    shown = film.idle_lives(_of_stage(1.0, 3), 300, 30.0)
    rise, pupil = shown.T
    assert rise.min() == 0.0 and 2.9 < rise.max() <= 3.0  # [breath] rise_mm
    assert np.abs(np.diff(rise)).max() < 0.3 and np.ptp(pupil) > 0.02
    np.testing.assert_array_equal(shown, film.idle_lives(_of_stage(1.0, 3), 300, 30.0))
    assert (shown[:, 1] != film.idle_lives(_of_stage(1.0, 4), 300, 30.0)[:, 1]).any()
    np.testing.assert_allclose(film.idle_lives(_of_stage(0.5, 3), 300, 30.0), 0.5 * shown)
    assert not film.idle_lives(_of_stage(0.0, 3), 300, 30.0).any()
