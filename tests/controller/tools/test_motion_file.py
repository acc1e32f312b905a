"""What takes, shows and recordings show, written as plain tables and read again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ConfigError, ControllerError, TakeError
from controller.base.parameters import PARAMETERS as P
from controller.base.parameters import Parameters
from controller.layers.commands import CommandState
from controller.layers.settings import default_layers
from controller.links.line.script import load_script
from controller.links.line.show import Show
from controller.takes.reader import load_take
from controller.takes.recording import recorded
from controller.tools.motion_file import Motion, convert, load_motion
from controller.vocabulary.vocabulary import Vocabulary

JAW = P.index("jawOpen")
TAKE = "Timecode,BlendShapeCount,JawOpen,EyeBlinkLeft,HeadYaw\n" + "".join(
    f"00:00:0{k // 60}:{k % 60:02}.000,61,{k / 100:.3f},1.2,{-0.01 * k}\n" for k in range(0, 90, 2)
)


def test_a_take_comes_back_from_its_table_within_a_millionth(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(TAKE)
    convert(tmp_path / "a.csv", tmp_path / "out.csv", P)
    first, again = load_take(tmp_path / "a.csv", P), load_take(tmp_path / "out.csv", P)
    np.testing.assert_allclose(again.times_s, first.times_s, atol=1e-6)
    np.testing.assert_array_equal(again.mask, first.mask)
    inside = np.clip(first.values, P.low, P.high)
    np.testing.assert_allclose(again.values[:, first.mask], inside[:, first.mask], atol=1e-6)


def test_rows_at_another_rate_lie_on_the_take(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(TAKE)
    motion = load_motion(tmp_path / "a.csv", P, 100.0)
    take, out = load_take(tmp_path / "a.csv", P), P.neutral()
    np.testing.assert_allclose(np.diff(motion.times_s), 0.01)
    assert motion.times_s[-1] <= take.duration_s < motion.times_s[-1] + 0.01
    for time, row in zip(motion.times_s, motion.values, strict=True):
        np.testing.assert_allclose(row, take.sample(float(time), out))


def test_a_show_moves_as_on_the_face(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text('steps = ["0 SET jawOpen 0.8", "0.5 SET jawOpen 0.2", "1 NEUTRAL 0.2"]')
    motion = load_motion(tmp_path / "s.toml", P)
    assert motion.values[[28, 55], JAW] == pytest.approx([0.8, 0.2], abs=0.02)
    assert motion.values[-1, JAW] == pytest.approx(0.0, abs=0.01) and np.flatnonzero(motion.mask).tolist() == [JAW]
    assert motion.times_s[-1] == pytest.approx(3.0, abs=0.02)


def test_a_show_moves_whenever_it_begins_as_in_a_file(tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    path.write_text('steps = ["0 EXPR happiness 0.8", "0 GAZE 5 4", "0.4 GAZE OFF", "0.6 NEUTRAL 0.2"]')
    state, out = CommandState(P), P.neutral()
    show = Show(load_script(str(path), P), state)
    show.playing = True
    motion = load_motion(path, P, 100.0)
    for k, row in enumerate(motion.values):
        now_ns = 10**12 + 10_000_000 * k
        show.tick(now_ns)
        state.tick(now_ns, 0.01, out)
        np.testing.assert_allclose(row, out, atol=2e-3)


def test_a_recording_is_what_its_ticks_were(tmp_path: Path) -> None:
    out, rows = P.neutral(), []
    with recorded(CommandState(P), tmp_path / "r.rec") as state:
        state.set_parameters([JAW], [0.6], 1)
        for k in range(1, 101):
            state.tick(k * 10_000_000, 0.01, out)
            rows.append(out[JAW])
    motion = load_motion(tmp_path / "r.rec", P, 50.0)
    np.testing.assert_allclose(motion.values[:, JAW], np.array(rows)[::2], atol=1e-9)


def test_a_recording_keeps_breath_and_pupils_of_its_idle_motion(tmp_path: Path) -> None:
    shown, out = [], P.neutral()
    with recorded(CommandState(P, seed=5), tmp_path / "r.rec", seed=5) as state:
        state.live(1.0, 0)
        for k in range(200):
            state.tick(10_000_000 * (k + 1), 0.01, out)
            shown.append(state.beside)
    lives = load_motion(tmp_path / "r.rec", P, 100.0).lives
    assert lives is not None and lives[:, 0].max() > 1.0
    np.testing.assert_allclose(lives, shown, atol=1e-9)


def test_a_recording_is_played_into_the_layers_that_it_was_recorded_with(tmp_path: Path) -> None:
    calm = [replace(layer, weight=0.5) for layer in default_layers()]

    def make(parameters: Parameters, seed: int, period_s: float) -> CommandState:
        return CommandState(parameters, layers=calm, seed=seed, period_s=period_s)

    out = P.neutral()
    with recorded(make(P, 0, 0.01), tmp_path / "r.rec") as state:
        state.set_parameters([JAW], [0.6], 1)
        for k in range(1, 101):
            state.tick(k * 10_000_000, 0.01, out)
    assert load_motion(tmp_path / "r.rec", P, make=make).values[-1, JAW] == pytest.approx(0.3)
    with pytest.raises(ControllerError, match="came out differently"):
        load_motion(tmp_path / "r.rec", P)


def test_a_show_knows_own_expressions(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text("[wide]\nweights = { jawOpen = 0.8 }\n")
    (tmp_path / "s.toml").write_text('steps = ["0 EXPR wide 1"]')
    own = Vocabulary.load(P, more=[tmp_path / "mine.toml"])
    assert load_motion(tmp_path / "s.toml", P, vocabulary=own).values[-1, JAW] == pytest.approx(0.8, abs=0.01)
    with pytest.raises(ConfigError, match="unknown expression 'wide'"):
        load_motion(tmp_path / "s.toml", P)


def test_what_cannot_be_converted_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(TAKE)
    with pytest.raises(TakeError, match=r"tables of parameters are \.csv files"):
        convert(tmp_path / "a.csv", tmp_path / "a.json", P)
    with pytest.raises(TakeError, match="is the input file"):
        convert(tmp_path / "a.csv", tmp_path / "a.csv", P)
    with pytest.raises(ControllerError, match="cannot be written"):
        convert(tmp_path / "a.csv", tmp_path / "a.csv" / "b.csv", P)
    with pytest.raises(ConfigError):
        load_motion(tmp_path / "none.toml", P)
    (tmp_path / "s.toml").write_text("steps = [")
    with pytest.raises(ConfigError):
        load_motion(tmp_path / "s.toml", P)


def test_motions_are_told_apart_by_themselves_since_arrays_have_no_one_answer() -> None:
    one, two = (Motion("a", np.arange(3.0), np.ones((3, 2)), np.ones(2, bool)) for _ in range(2))
    assert one == one and one != two and len({one, two}) == 2
    assert one.with_rest().tolist() == [[1.0, 1.0, 0.0]] * 3
