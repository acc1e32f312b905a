"""Recordings and their replay."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ControllerError, ParameterError
from controller.base.parameters import PARAMETERS as P
from controller.layers.commands import CommandState
from controller.links.line.session import LineSession
from controller.takes.recording import Replay, recorded, replay

STEP_NS = 10_000_000


def perform(path: Path, seconds: float = 6.0) -> np.ndarray:
    """A lively run with everything in it; returns (n, 59) what came out."""
    random = np.random.default_rng(5)
    out, rows, now = P.neutral(), [], 10**9
    lines = [
        b"LIFE 1", b"EXPR happiness 0.8", b"SET jawOpen 0.5", b"GAZE 30 -5", b"GAZE AT 100 0 300", b"RELEASE jawOpen",
        b"EXPR wink 1 0.4", b"GAZE OFF", b"EXPR AU1+2 0.5", b"NEUTRAL 0.3", b"SET nothing 1", b"FRAME " + b"0.1 " * 59,
    ]  # fmt: skip
    with recorded(CommandState(P, seed=7), path, seed=7) as state:
        session = LineSession(state, now)
        for i in range(round(seconds * 100)):
            now += int(STEP_NS * random.uniform(0.9, 1.1))
            if i % 40 == 7:
                session.feed(lines[(i // 40) % len(lines)] + b"\n", now - 12345)
            if 200 < i < 300:
                state.write_layer("capture", random.random(59), random.random(59) < 0.5, now, through=random.random(59))
            state.tick(now, 0.01, out)
            rows.append(out.copy())
    return np.array(rows)


def test_a_replay_is_the_same_bit_by_bit(tmp_path: Path) -> None:
    path = tmp_path / "run.omote"
    recorded = perform(path)
    played = np.array([values.copy() for _, values in replay(path, P)])
    np.testing.assert_array_equal(played, recorded)
    assert np.ptp(recorded, axis=0).max() > 0.5


def test_a_recording_ends_with_its_block_and_the_state_goes_on(tmp_path: Path) -> None:
    state, path = CommandState(P), tmp_path / "a"
    with recorded(state, path, seed=3, period_s=0.02):
        state.set_parameters(np.array([17]), np.array([0.5]), 0)
        state.tick(STEP_NS, 0.01, P.neutral())
        with pytest.raises(ParameterError):
            state.expression("nothing", 1.0, None, 0)  # what is refused is not recorded
    text = path.read_text()
    state.set_parameters([17], [0.1], 0)
    state.tick(2 * STEP_NS, 0.01, P.neutral())
    assert path.read_text() == text
    header, *calls = map(json.loads, text.splitlines())
    assert header == ["omote recording", 1, 3, 0.02, list(P.names)]
    assert calls[0] == ["set_parameters", [17], [0.5], 0] and calls[1][:3] == ["tick", STEP_NS, 0.01]
    assert len(calls) == 2


def test_a_manner_of_idle_motion_is_replayed(tmp_path: Path) -> None:
    state, path, out = CommandState(P, seed=3), tmp_path / "a", P.neutral()
    with recorded(state, path, seed=3):
        state.live(1.0, 0, "listen")
        for i in range(300):
            state.tick(i * STEP_NS, 0.01, out)
        state.live(0.5, 0)
        state.tick(300 * STEP_NS, 0.01, out)
    replayed = [values.copy() for _, values in replay(path, P)]
    assert len(replayed) == 301 and np.array_equal(replayed[-1], out)
    calls = [json.loads(line) for line in path.read_text().splitlines() if "live" in line]
    assert calls == [["live", 1.0, 0, "listen"], ["live", 0.5, 0]]


def test_an_error_in_the_block_ends_the_recording(tmp_path: Path) -> None:
    state, path = CommandState(P), tmp_path / "a"
    with pytest.raises(KeyError), recorded(state, path):
        raise KeyError
    state.live(0.5, 0)
    assert len(path.read_text().splitlines()) == 1


def test_a_tick_that_comes_out_differently_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "run.omote"
    perform(path, 1.0)
    lines = path.read_text().splitlines()
    i = next(i for i, line in enumerate(lines) if "expression" in line)
    lines[i] = lines[i].replace("0.8", "0.7")
    path.write_text("\n".join(lines))
    with pytest.raises(ControllerError, match="came out differently"):
        list(replay(path, P))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "not a recording"),
        ("{}\n", "line 1: damaged"),
        ("[]\n", "line 1: damaged"),
        ('["omote recording"]\n', "must be a whole number"),
        ('["omote recording",1,0,[]]\n', "not a recording of version 1"),
        ('["omote recording",99,0,[]]\n', "is 99, written by a newer omote"),
        ('["omote recording",1,0,0.01,["jawOpen"]]\n', "other parameters"),
        ("\xff", "line 1: damaged"),
    ],
)
def test_broken_files_say_why(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "a"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(ControllerError, match=message):
        list(replay(path, P))


@pytest.mark.parametrize(
    ("seed", "period"),
    [("0", '"x"'), ("0", "null"), ("0", "0"), ("0", "-1"), ("0", "NaN"), ("0", "1e9"), ("0", "true"), ("-1", "0.01")],
)
def test_a_seed_or_a_length_of_a_tick_that_none_has_is_damage(tmp_path: Path, seed: str, period: str) -> None:
    (tmp_path / "a").write_text(f'["omote recording",1,{seed},{period},{json.dumps(P.names)}]\n')
    with pytest.raises(ControllerError, match="line 1: damaged"):
        list(replay(tmp_path / "a", P))


@pytest.mark.parametrize("line", ['["system","ls"]', '["tick",1]', '["gaze","a","b",0]', "[1", '["write_layer","x"]'])
def test_a_damaged_line_is_named_and_nothing_else_is_called(tmp_path: Path, line: str) -> None:
    path = tmp_path / "a"
    perform(path, 0.05)
    path.write_text(path.read_text() + line + "\n")
    with pytest.raises(ControllerError, match="line 7: damaged"):
        list(replay(path, P))


def test_files_that_cannot_be_opened(tmp_path: Path) -> None:
    with pytest.raises(ControllerError, match="cannot be read"):
        list(replay(tmp_path / "none", P))
    with pytest.raises(ControllerError, match="cannot be written"), recorded(CommandState(P), tmp_path / "none" / "a"):
        pass


def test_a_replay_without_a_tick_is_finished_at_once(tmp_path: Path) -> None:
    path, out = tmp_path / "a.rec", P.neutral()
    with recorded(CommandState(P), path):
        pass
    player = Replay(path, P)
    assert (player.finished, player.ticks, player.played_s) == (False, 0, 0.0)
    assert player.tick(5, 0.01, out) == 0 and player.finished and player.ticks == 0 and not out.any()


def test_a_replay_ticks_at_its_own_pace_whatever_the_clock(tmp_path: Path) -> None:
    path = tmp_path / "a.rec"
    recorded, out = perform(path, 2.0), P.neutral()
    player = Replay(path, P)
    rows = []
    for i in range(400):  # a clock twice as fast
        player.tick(7 * 10**9 + i * STEP_NS // 2, 0.005, out)
        rows.append(out.copy())
        if player.finished:
            break
    assert player.finished and player.ticks == 200 and player.played_s == pytest.approx(2.0, abs=0.05)
    shown = {row.tobytes() for row in rows}
    assert all(row.tobytes() in shown for row in recorded[::7])  # each recorded face was shown, bit by bit
    np.testing.assert_array_equal(rows[-1], recorded[-1])


def test_captures_are_recorded(tmp_path: Path) -> None:
    path, out = tmp_path / "a.rec", P.neutral()
    with recorded(CommandState(P), path) as state:
        state.capture(np.full(len(P), 0.6), np.ones(len(P), dtype=bool), 10**9)
        for i in range(60):
            state.tick(10**9 + i * STEP_NS, 0.01, out)
    *_, (_, values) = replay(path, P)
    np.testing.assert_array_equal(values, out)
    assert values[P.index("jawOpen")] == pytest.approx(0.6, abs=0.01)


def test_breath_and_pupils_of_a_recording_are_those_of_its_run(tmp_path: Path) -> None:
    path, now, shown = tmp_path / "run.omote", 10**9, []
    with recorded(CommandState(P, seed=7), path, seed=7) as state:
        state.live(1.0, now)
        for _ in range(200):
            now += STEP_NS
            state.tick(now, 0.01, P.neutral())
            shown.append(state.beside)
    player, played, out = Replay(path, P), [], P.neutral()
    assert player.beside == (0.0, 0.0)
    for k in range(200):
        player.tick(k * STEP_NS, 0.01, out)
        played.append(player.beside)
    assert played == shown and np.ptp(shown, axis=0).min() > 0.02
