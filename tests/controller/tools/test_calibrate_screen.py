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


def drawn(state: CalibrationScreen, width: int = 140) -> list[str]:
    out = io.StringIO()
    Console(file=out, width=width).print(state.picture("head24"))
    return out.getvalue().splitlines()


def test_a_bar_spans_the_limits_and_marks_every_angle_in_its_place() -> None:
    low, high = CHANNELS[0].limit_deg
    span = high - low
    state = CalibrationScreen(CHANNELS)

    def bar() -> str:
        row = next(line for line in drawn(state) if f" {CHANNELS[0].name} " in line)
        return next(word for word in row.split("  ") if "·" in word).strip()

    for key, share in (("[", 0.0), ("n", 10 / 43), ("]", 42 / 43)):
        pressed(seen(state, low + share * span, 0.0, 0.0), key)
    seen(state, high, 0.0, 0.0)
    assert bar() == "[" + "·" * 9 + "|" + "·" * 31 + "]●"
    seen(state, low, 0.0, 0.0)
    assert bar() == "●" + "·" * 9 + "|" + "·" * 31 + "]·"
    seen(state, high + span, 0.0, 0.0)  # a hand moves it past the limits
    assert bar() == "[" + "·" * 4 + "|" + "·" * 15 + "]" + "·" * 21 + "●"
    assert len(bar()) == 44
    seen(state, np.nan, 0.0, 0.0)
    assert "●" not in bar()


def test_the_screen_tells_angles_state_questions_and_keys() -> None:
    state = seen(CalibrationScreen(CHANNELS), 1.25, -2.04, np.nan)
    pressed(state, "n", "down", "[")
    lines = drawn(state)
    assert lines[0].rstrip() == "head24   torque off: move it by hand"
    assert lines[1].split() == ["channel", "now", "lowest", "neutral", "highest"]
    assert lines[2].split()[:2] == [CHANNELS[0].name, "1.2"] and lines[2].split()[-1] == "1.2"
    assert lines[3].split()[:3] == [">", CHANNELS[1].name, "-2.0"] and lines[3].split()[-1] == "-2.0"
    assert "up/down channel" in lines[-2] and "q leave" in lines[-1]
    pressed(seen(state, 0.0, 0.0, 0.0), "t", "h")
    assert drawn(state)[0].rstrip() == "head24   torque on, following the extremes"
    pressed(state, "q")
    assert any("leave without saving? (y/n)" in line for line in drawn(state))


def test_steps_limits_and_selection() -> None:
    state = seen(CalibrationScreen(CHANNELS), 0.0, 1.0, 2.0)
    assert STEP_DEG == 0.5
    pressed(state, "up", "h", "left", "left", "right")
    assert state.selected == 2 and state.target_deg.tolist() == [0.0, 1.0, 1.5]
    pressed(state, "down", "right")
    assert state.selected == 0 and state.target_deg[0] == 0.5 and state.message == ""
    pressed(state, "left", *["left"] * 1000)
    low = CHANNELS[0].limit_deg[0]
    assert state.target_deg[0] == low and state.message == f"limit_deg of the robot file ends at {low:g}"
    pressed(state, "h", "left")
    assert state.message == "press h first: it switches the torque on at the present angles; then the arrows move"
    assert not state.holding
    pressed(state, "?")
    assert state.message == ""


def test_what_cannot_be_captured_is_named() -> None:
    state = pressed(seen(CalibrationScreen(CHANNELS), 3.0, np.nan, np.nan), "N")
    assert state.message == f"no angle from {CHANNELS[1].name}, {CHANNELS[2].name}"
    assert state.changed and state.marks[0].neutral == 3.0 and np.isnan(state.marks[1].neutral)
    state = pressed(seen(CalibrationScreen(CHANNELS), np.nan, 0.0, 0.0), "n")
    assert state.message == f"no angle from {CHANNELS[0].name}" and not state.changed
    pressed(state, "q")
    assert state.done  # nothing was captured: nothing is asked
    assert not CalibrationScreen(CHANNELS).changed and CalibrationScreen(CHANNELS).margin_deg == 1.0


def test_a_margin_keeps_neutral_inside_and_a_channel_without_a_way_is_left_out() -> None:
    state = CalibrationScreen(CHANNELS, margin_deg=2.0)
    for key, angle in (("n", 1.0), ("[", 0.0), ("]", 10.0)):
        pressed(seen(state, angle, angle, 5.0), key, "down", key, "down", key, "down")
    (first, second) = state.captured().values()
    assert (first.min_deg, first.neutral_deg, first.max_deg) == (1.0, 1.0, 8.0) == (
        second.min_deg, second.neutral_deg, second.max_deg
    )  # fmt: skip
    pressed(state, "s")
    assert state.saving and state.message == ""
    state.saved("saved 2 channels")
    assert not state.saving and not state.changed and state.message == "saved 2 channels"
    pressed(state, "c", "down", "c")
    assert list(state.captured()) == []
    pressed(state, "down", "s")
    assert not state.saving
    assert state.message == f"nothing to save yet: {CHANNELS[2].name} lacks room between its ends"


def test_a_neutral_angle_outside_of_the_ends_is_named_and_not_made_an_end() -> None:
    state = CalibrationScreen(CHANNELS, margin_deg=0.5)
    for key, first, second, third in (("[", 10.0, 30.0, 0.8), ("n", 0.0, 0.0, 0.0), ("]", 30.0, -30.0, 20.0)):
        pressed(seen(state, first, second, third), key, "down", key, "down", key, "down")
    assert list(state.captured()) == [CHANNELS[2].name], "measured a little off neutral"
    assert state.in_wrong_order() == [CHANNELS[0].name, CHANNELS[1].name]
    pressed(state, "down", "down", "c", "up", "up", "s")
    assert state.message == f"nothing to save yet: {CHANNELS[0].name} lacks a neutral angle between lowest and highest"


def test_answers_in_capitals_count_and_others_keep_the_question() -> None:
    state = pressed(seen(CalibrationScreen(CHANNELS), 0.0, 0.0, 0.0), "n", "q", "t", "N")
    assert not state.done and not state.question and not state.tracking
    assert pressed(state, "q", "Y").done
    state = CalibrationScreen(CHANNELS)
    state.saving = True
    state.ask("replace desk.toml? (y/n)")
    assert not state.saving
    pressed(state, "N")
    assert (state.message, state.may_replace, state.done) == ("not saved", False, False)
    state.ask("replace desk.toml? (y/n)")
    pressed(state, "Y")
    assert (state.message, state.may_replace, state.saving) == ("", True, True)


def test_extremes_are_not_followed_while_the_motors_hold_or_where_nothing_is_measured() -> None:
    state = pressed(seen(CalibrationScreen(CHANNELS), 0.0, 0.0, 0.0), "t", "h")
    seen(state, 9.0, 9.0, 9.0)
    assert np.isnan(state.marks[0].high) and not state.changed
    pressed(state, "h")
    seen(state, 7.0, 9.0, np.nan)
    assert (state.marks[0].low, state.marks[0].high, state.changed) == (7.0, 7.0, True)
    assert state.marks[2].missing == ["lowest", "neutral", "highest"]
    pressed(state, "t")
    assert not state.tracking and state.message == ""
    silent = pressed(CalibrationScreen(CHANNELS, measures=False), "t")
    assert silent.message == "these servos do not measure their angle: use the arrows"
    silent = pressed(CalibrationScreen(CHANNELS), "h")
    assert silent.message == "the angle of a servo is unknown"
