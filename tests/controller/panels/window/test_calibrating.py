"""Servos that are turned by hand in the window: what is asked of the body, captured, and told."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from controller.base.errors import ParameterError
from controller.body.messages import Jog
from controller.panels.session.servo_captures import Captured
from controller.panels.window.calibrating import Calibrating
from tests.controller.panels.window.drawn import Drawn

SERVO = {
    "bus": "head",
    "id": 4,
    "name": "jaw",
    "wanted_deg": 4.0,
    "low_deg": -10.0,
    "high_deg": 30.0,
    "measured_deg": 3.5,
}


class Captures:
    """Stands for what keeps the angles."""

    def __init__(self, kept: Captured | None = None) -> None:
        self.kept, self.done = kept or Captured(), list[Any]()

    def of(self, servo: Any) -> Captured:
        return self.kept

    def capture(self, servo: Any, mark: str) -> None:
        self.done.append(("capture", mark))

    def clear(self, servo: Any) -> None:
        self.done.append("clear")

    def save(self, name: str) -> list[Path]:
        if not name.strip():
            raise ParameterError("no name")
        return [Path("a.desk.toml"), Path("b.desk.toml")]


class Turned(Drawn):
    """Its slider is dragged to an angle."""

    def __init__(self, pressed: str = "", to: float | None = None) -> None:
        super().__init__(pressed)
        self._to = to

    def slider_float(self, *given: Any) -> tuple[bool, float]:
        self.calls.append(("slider", *given))
        return (False, given[1]) if self._to is None else (True, self._to)

    def button(self, label: str, *_: Any) -> bool:
        self.calls.append(("button", label))
        return label.partition("##")[0] == self.pressed


def made(kept: Captured | None = None) -> tuple[Calibrating, Captures, list[Any], list[Any]]:
    captures, sent, problems = Captures(kept), list[Any](), list[Any]()

    class Problems:
        add = staticmethod(problems.append)

    return Calibrating(captures, sent.append, Problems()), captures, sent, problems  # type: ignore[arg-type]


def drawn(calibrating: Calibrating, pressed: str = "", to: float | None = None, **other: Any) -> Any:
    library: Any = Turned(pressed, to)
    calibrating._servo(library, {**SERVO, **other})
    return library


def test_a_slider_turns_the_servo_within_its_limits_until_it_is_given_back() -> None:
    calibrating, _, sent, _ = made()
    ((_, shown, low, high, words),) = drawn(calibrating).named("slider")
    assert (shown, low, high) == (4.0, -10.0, 30.0) and words == "jaw %.1f deg" and sent == []
    library = drawn(calibrating, to=12.5)
    assert sent == [Jog("head", "jaw", 12.5)]
    assert any(label.startswith("release") for (label,) in library.named("button"))
    assert library.named("set_tooltip") == [("the servo follows the face again",)]
    assert drawn(calibrating).named("slider")[0][1] == 12.5  # and not where the face wants it
    drawn(calibrating, pressed="release")
    assert sent[-1] == Jog("head", "jaw", None) and drawn(calibrating).named("slider")[0][1] == 4.0
    assert not any(label.startswith("release") for (label,) in drawn(calibrating).named("button"))
    drawn(calibrating, to=20.0)
    calibrating.forget()
    assert drawn(calibrating).named("slider")[0][1] == 4.0 and len(sent) == 3


def test_marks_are_captured_where_the_servo_is_and_only_where_that_is_known() -> None:
    calibrating, captures, _, _ = made()
    labels = [label.partition("##")[0] for (label,) in drawn(calibrating).named("button")]
    for mark in labels:
        drawn(calibrating, pressed=mark)
    assert captures.done == [("capture", mark) for mark in labels] and len(labels) == 3
    captures.done.clear()
    drawn(calibrating, pressed=labels[0], measured_deg=None)
    assert captures.done == []


def test_what_was_captured_is_shown_and_can_be_cleared() -> None:
    first, *_ = (label.partition("##")[0] for (label,) in drawn(made()[0]).named("button"))
    calibrating, captures, _, _ = made(Captured(**{first: -9.25}))
    labels = [label.partition("##")[0] for (label,) in drawn(calibrating).named("button")]
    assert labels[0] == f"{first} -9.25" and labels[-1] == "clear"
    drawn(calibrating, pressed="clear")
    assert captures.done == ["clear"]


@pytest.mark.parametrize(("name", "saved"), [(" desk ", True), (" ", False)])
def test_saving_says_what_was_written_and_what_to_put_into_the_robot(name: str, saved: bool) -> None:
    calibrating, _, _, problems = made()
    calibrating.save(name)
    assert bool(problems) != saved
    wanted = 'wrote a.desk.toml, b.desk.toml; put it beside the robot file, and there: calibration = "desk"'
    assert calibrating._message == (wanted if saved else "")
