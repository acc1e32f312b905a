"""controller.tools.calibrate_screen: what the keys capture, and what they never do."""

from __future__ import annotations

import io

import numpy as np
import pytest
from rich.console import Console

from controller.base.parameters import PARAMETERS
from controller.base.paths import find_config
from controller.robot.robot import load_robot
from controller.tools.calibrate_screen import STEP_DEG, CalibrationScreen

CHANNELS = load_robot(find_config("robots", "head24"), PARAMETERS).channels[:3]


def pressed(state: CalibrationScreen, *keys: str) -> CalibrationScreen:
    for key in keys:
        state.handle_key(key)
    return state


def seen(state: CalibrationScreen, *angles: float) -> CalibrationScreen:
    state.set_angles(np.array(angles))
    return state


def test_a_channel_is_captured_by_hand() -> None:
    state = CalibrationScreen(CHANNELS, margin_deg=1.0)
    pressed(seen(state, 0, 5, 0), "down", "n")
    pressed(seen(state, 0, -20, 0), "[")
    pressed(seen(state, 0, 30, 0), "]")
    (name,) = state.captured()
    got = state.captured()[name]
    assert name == CHANNELS[1].name
    assert (got.min_deg, got.neutral_deg, got.max_deg) == (-19, 5, 29)


def test_extremes_are_followed_while_it_is_moved() -> None:
    state = pressed(CalibrationScreen(CHANNELS, margin_deg=0.0), "t")
    for angle in (1, -7, np.nan, 12, 3):
        seen(state, angle, 0, 0)
    pressed(state, "t", "N")
    seen(state, 90, 0, 0)
    got = state.captured()[CHANNELS[0].name]
    assert (got.min_deg, got.neutral_deg, got.max_deg) == (-7, 3, 12)


def test_nothing_moves_before_the_motors_hold_and_never_past_the_limits() -> None:
    state = seen(CalibrationScreen(CHANNELS), 0.0, 0.0, 0.0)
    pressed(state, "right")
    assert np.isnan(state.target_deg).all()
    pressed(state, "h", "right")
    assert state.target_deg[0] == STEP_DEG
    pressed(state, *["right"] * 1000)
    assert state.target_deg[0] == CHANNELS[0].limit_deg[1]
    assert "limit_deg" in state.message
    pressed(state, "h")
    assert not state.holding


def test_motors_stay_off_while_a_servo_is_silent() -> None:
    state = pressed(seen(CalibrationScreen(CHANNELS), 0.0, np.nan, 0.0), "h")
    assert not state.holding


def test_servos_that_tell_nothing_are_moved_from_where_they_begin() -> None:
    state = seen(CalibrationScreen(CHANNELS, measures=False), np.nan, np.nan, np.nan)
    pressed(state, "h", "right")
    assert np.isnan(state.target_deg[0])
    seen(state, 2.0, 0.0, 0.0)
    assert pressed(state, "right").target_deg[0] == 2.0 + STEP_DEG
    seen(state, 2.25, 0.0, 0.0)
    assert state.target_deg[0] == 2.0 + STEP_DEG
    assert pressed(state, "t").tracking is False


def test_what_is_missing_is_told_and_nothing_is_saved() -> None:
    state = pressed(seen(CalibrationScreen(CHANNELS), 0.0, 0.0, 0.0), "n", "s")
    assert not state.saving
    assert "lowest, highest" in state.message


@pytest.mark.parametrize(("answer", "done"), [("y", True), ("n", False)])
def test_leaving_with_something_captured_is_asked_about(answer: str, done: bool) -> None:
    state = pressed(seen(CalibrationScreen(CHANNELS), 0.0, 0.0, 0.0), "n", "q")
    assert state.question
    assert not state.done
    assert pressed(state, "x", answer).done is done
    assert not state.question


def test_a_file_in_the_way_is_replaced_only_after_yes() -> None:
    state = CalibrationScreen(CHANNELS)
    state.ask("replace desk.toml? (y/n)")
    assert not pressed(state, "n").saving
    state.ask("replace desk.toml? (y/n)")
    assert pressed(state, "y").saving
    assert state.may_replace


def test_the_screen_shows_every_channel_with_its_bar() -> None:
    state = pressed(seen(CalibrationScreen(CHANNELS), 1.0, 2.0, np.nan), "n", "down")
    out = io.StringIO()
    Console(file=out, width=140).print(state.picture("head24"))
    lines = out.getvalue().splitlines()
    rows = [line for line in lines if any(f" {channel.name} " in line for channel in CHANNELS)]
    assert len(rows) == 3
    assert rows[1].startswith(">")
    assert "●" in rows[0]
    assert "●" not in rows[2]
