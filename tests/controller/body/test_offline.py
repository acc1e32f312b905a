"""controller.body.offline: a file on the heads of a stage, as a run shows it, without waiting for a clock."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controller.base.errors import ControllerError, TakeError
from controller.base.parameters import PARAMETERS as P
from controller.body.offline import play_offline
from controller.links.line.script import load_script
from controller.links.line.show import Show
from controller.stage.stage import Stage, load_stage
from controller.takes.livelink import TakePlayer
from controller.takes.reader import load_take
from controller.takes.recording import recorded, replay

JAW, BLINK, YAW, EYE = (P.index(name) for name in ("jawOpen", "eyeBlinkLeft", "headYaw", "leftEyeYaw"))
LIVELY = 'name = "lively"\nliveliness = 0.8\nseed = 5\n[layers.capture]\nfade_in_s = 0.4\n'
DUET = (
    'name = "duet"\nliveliness = 1.0\n[[heads]]\nname = "maple"\n[[heads]]\nname = "oak"\nposition_mm = [600, 0, 0]\n'
)
NOTHING = np.zeros(len(P), dtype=bool)


def stage_of(tmp_path: Path, text: str = LIVELY) -> Stage:
    path = tmp_path / "stage.toml"
    path.write_text(text)
    return load_stage(str(path), P)


def take_of(tmp_path: Path, **columns: float) -> Path:
    """A take of two minutes that holds parameters at their values."""
    path = tmp_path / "take.csv"
    values = ",".join(map(str, columns.values()))
    path.write_text(f"time,{','.join(columns)}\n0,{values}\n120,{values}\n")
    return path


def played(stage: Stage, path: Path, count: int = 300, fps: float = 100.0) -> tuple[np.ndarray, np.ndarray]:
    return play_offline(stage, path, count, fps, P.neutral(), [NOTHING] * max(1, len(stage.heads)))


def by_hand(stage: Stage, path: Path, count: int) -> tuple[np.ndarray, np.ndarray]:
    """What the layers of the stage show in each tick of a hundredth of a second: (count, P), (count, 2)."""
    state, rows, lives = stage.state(), np.empty((count, len(P))), np.empty((count, 2))
    state.live(stage.settings.liveliness, 0, stage.settings.manner)
    player: Any
    if path.suffix == ".toml":
        player = Show(load_script(str(path), P), state)
        player.playing = True
    else:
        player = TakePlayer(load_take(path, P), state)
    for k, row in enumerate(rows):
        now_ns = 10_000_000 * (k + 1)
        player.tick(now_ns)
        state.tick(now_ns, 0.01, row)
        lives[k] = state.beside
    return rows, lives


def test_a_take_is_blended_with_idle_motion_by_the_layers_of_the_stage(tmp_path: Path) -> None:
    stage, take = stage_of(tmp_path), take_of(tmp_path, jawOpen=0.5, browInnerUp=0.25)
    rows, lives = played(stage, take)
    wanted_rows, wanted_lives = by_hand(stage, take, 300)
    np.testing.assert_allclose(rows[:, 0], wanted_rows, atol=1e-12)
    np.testing.assert_allclose(lives[:, 0], wanted_lives, atol=1e-12)
    assert rows[20, 0, JAW] < 0.4 and rows[60:, 0, JAW] == pytest.approx(0.5)  # it fades in, as the stage says
    assert np.ptp(rows[:, 0, YAW]) > 1e-3 and lives[:, 0, 0].max() > 1.0


def test_a_take_that_holds_lids_and_gaze_keeps_them(tmp_path: Path) -> None:
    eyes = {name: 0.0 for name in P.names if name.startswith(("eyeLook", "leftEye", "rightEye"))}
    stage = stage_of(tmp_path)
    free, _ = played(stage, take_of(tmp_path, jawOpen=0.5), 1200, 20.0)
    held, _ = played(stage, take_of(tmp_path, eyeBlinkLeft=0.1, eyeBlinkRight=0.1, **eyes), 1200, 20.0)
    assert free[:, 0, BLINK].max() > 0.7 and np.ptp(free[:, 0, EYE]) > 0.05
    assert held[20:, 0, BLINK] == pytest.approx(0.1) and held[20:, 0, EYE] == pytest.approx(0.0)
    np.testing.assert_array_equal(held[20:, 0, YAW], free[20:, 0, YAW])  # the take says nothing of the head


def test_the_same_seed_gives_the_same_film_and_another_one_another(tmp_path: Path) -> None:
    take = take_of(tmp_path, jawOpen=0.5)
    first, second = (played(stage_of(tmp_path), take) for _ in range(2))
    other, _ = played(stage_of(tmp_path, LIVELY.replace("5", "6", 1)), take)
    np.testing.assert_array_equal(first[0], second[0])
    np.testing.assert_array_equal(first[1], second[1])
    assert (first[0] != other).any()


@pytest.mark.parametrize("fps", [30.0, 100.0 / 3.0, 240.0, 7.0])
def test_frames_between_ticks_lie_between_them(tmp_path: Path, fps: float) -> None:
    stage, take = stage_of(tmp_path), take_of(tmp_path, jawOpen=0.5)
    ticks, beside = by_hand(stage, take, 330)
    times = np.arange(int(3.0 * fps)) / fps
    rows, lives = played(stage, take, len(times), fps)
    for shown, wanted in ((rows, ticks), (lives, beside)):
        expected = np.stack([np.interp(times, np.arange(330) * 0.01, column) for column in wanted.T], axis=1)
        np.testing.assert_allclose(shown[:, 0], expected, atol=1e-9)


def test_a_show_plays_with_the_idle_motion_of_the_stage(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text('steps = ["0 EXPR smile 1", "0.5 GAZE 20 0", "1 SET jawOpen 0.3"]')
    stage = stage_of(tmp_path)
    rows, _ = played(stage, tmp_path / "own.toml")
    np.testing.assert_allclose(rows[:, 0], by_hand(stage, tmp_path / "own.toml", 300)[0], atol=1e-12)
    assert rows[-1, 0, JAW] == pytest.approx(0.3) and rows[-1, 0, EYE] > 0.1


def test_the_first_of_several_heads_plays_and_lines_reach_the_others(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text('steps = ["0 SET jawOpen 0.3", "0 @oak SET jawOpen 0.6", "0.5 TURN maple", "0.5 EXPR smile 1"]')
    rows, lives = played(stage_of(tmp_path, DUET), path)
    assert rows.shape == (300, 2, len(P)) and lives.shape == (300, 2, 2)
    assert rows[-1, :, JAW] == pytest.approx([0.3, 0.6])
    assert abs(rows[-1, 1, YAW]) > 0.1  # who listens looks at who speaks
    assert (lives[:, 0] != lives[:, 1]).any()  # each lives by its own seed


def test_other_heads_live_as_they_would_alone(tmp_path: Path) -> None:
    stage = stage_of(tmp_path, DUET)
    rows, _ = played(stage, take_of(tmp_path, jawOpen=0.5))
    state, out = stage.heads[1].stage.state(), P.neutral()
    state.live(1.0, 0, "auto")
    for k in range(300):
        state.tick(10_000_000 * (k + 1), 0.01, out)
        np.testing.assert_allclose(rows[k, 1], out, atol=1e-12)


def test_the_file_replaces_what_the_first_head_plays_and_nothing_outside_is_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*what: object, **how: object) -> None:
        raise AssertionError(f"opened {what} {how}")

    for outside in ("LinkPart", "BusLoop", "Voice"):
        monkeypatch.setattr(f"controller.body.body.{outside}", refuse)
    (tmp_path / "open.toml").write_text('steps = ["0 SET jawOpen 0.9"]')
    (tmp_path / "mouth.csv").write_text("time,cheekPuff\n0,0.4\n60,0.4\n")
    own = 'show = "open.toml"\ntake = "mouth.csv"\nvoice = "/dev/null/none.wav"\nrobots = ["head24"]\n'
    link = '\nport = "/dev/null/none"\n'
    file, puff = take_of(tmp_path, browInnerUp=0.5), P.index("cheekPuff")
    rows, _ = played(stage_of(tmp_path, f'name = "one"\nliveliness = 0.5\n{own}[[links]]{link}'), file)
    assert rows[-1, 0, JAW] < 0.05 and rows[-1, 0, puff] < 0.05
    oak = DUET.replace("position_mm", f"{own}position_mm")
    rows, _ = played(
        stage_of(tmp_path, oak.replace("[[heads]]", own + "[[heads]]", 1) + "[[heads.links]]" + link), file
    )
    assert rows[-1, 0, [JAW, puff]].max() < 0.05
    assert rows[-1, 1, JAW] == pytest.approx(0.9) and rows[-1, 1, puff] == pytest.approx(0.4, abs=0.05)


def test_an_error_of_a_take_ends_the_film(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(player: TakePlayer, now_ns: int) -> None:
        raise TakeError("the disk is gone")

    monkeypatch.setattr(TakePlayer, "tick", fail)
    with pytest.raises(TakeError, match="the disk is gone"):
        played(stage_of(tmp_path), take_of(tmp_path, jawOpen=0.5))


def test_what_is_held_is_there_from_the_first_frame_and_as_if_set(tmp_path: Path) -> None:
    values, held = P.neutral(), NOTHING.copy()
    values[YAW], values[BLINK], held[YAW] = 0.4, 0.4, True
    stage, take = stage_of(tmp_path, DUET), take_of(tmp_path, jawOpen=0.5)
    rows, _ = play_offline(stage, take, 300, 100.0, values, [held, NOTHING])
    assert rows[:, 0, YAW] == pytest.approx(0.4) and rows[0, :, BLINK] == pytest.approx(0.0, abs=0.05)
    assert np.ptp(rows[:, 1, YAW]) > 1e-3


def test_a_recording_is_that_of_its_stage(tmp_path: Path) -> None:
    path, stage = tmp_path / "a.rec", stage_of(tmp_path, DUET)
    first, out = stage.heads[0].stage, P.neutral()
    with recorded(first.state(), path, seed=first.settings.seed) as state:
        state.live(1.0, 0)
        for k in range(100):
            state.tick(10_000_000 * (k + 1), 0.01, out)
    rows, _ = played(stage, path, 100)
    np.testing.assert_allclose(rows[:, 0], [row.copy() for _, row in replay(path, P)], atol=1e-12)
    calm = stage_of(tmp_path, DUET.replace("[[heads]]", "layers.idle.weight = 0.5\n[[heads]]", 1))
    with pytest.raises(ControllerError, match="came out differently"):
        played(calm, path, 100)
