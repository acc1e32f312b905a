"""controller.panels.session.held_values: settings here and what the body reports agree again after every change."""

from __future__ import annotations

from typing import Any

import pytest

from controller.body.messages import Hold
from controller.panels.session.commands import Commands
from controller.panels.session.held_values import LOST_S, PATIENCE_S, HeldValues

A, B = 3, 7


class Desk:
    """Settings beside a body that reports what it holds."""

    def __init__(self) -> None:
        self.sent: list[Any] = []
        self.commands, self.now_s = Commands(self.sent.append), 100.0
        self.reported: dict[int, float] = {}
        self.values = HeldValues(self.commands, self, lambda: self.now_s)  # type: ignore[arg-type]

    def held(self) -> dict[int, float]:
        return self.reported

    def after(self, seconds: float) -> dict[int, float | None]:
        self.now_s += seconds
        self.values.update()
        return {index: self.values.get(index) for index in (A, B)}


@pytest.fixture
def desk() -> Desk:
    return Desk()


def test_what_was_set_here_counts_until_the_body_reports_it_however_late(desk: Desk) -> None:
    desk.commands.hold({A: 0.5})
    assert desk.values.get(A) == 0.5
    assert desk.after(0.0) == {A: 0.5, B: None}
    assert desk.after(LOST_S - 0.1) == {A: 0.5, B: None}  # it opens a slow link
    desk.reported = {A: 0.5}
    assert desk.after(0.2) == {A: 0.5, B: None}
    assert desk.commands.now.held == {A: 0.5}


def test_what_the_body_never_holds_is_given_up(desk: Desk) -> None:
    desk.commands.hold({A: 0.5})
    desk.after(0.0)
    assert desk.after(LOST_S) == {A: None, B: None} and desk.commands.now.held == {}


def test_a_value_that_others_have_changed_is_taken_over_and_undo_does_not_bring_the_old_one_back(desk: Desk) -> None:
    desk.commands.hold({A: 0.5})
    desk.commands.hold({B: 0.1})
    desk.reported = {A: 0.5, B: 0.1}
    desk.after(0.0)
    desk.reported = {A: 0.9, B: 0.1}
    assert desk.after(0.1) == {A: 0.9, B: 0.1}
    desk.sent.clear()
    desk.commands.undo()
    assert desk.sent == [Hold(B, None)]
    desk.commands.hold({A: 0.5})
    assert desk.sent[1:] == [Hold(A, 0.5)]  # it is not taken for what is held already


def test_undo_does_not_hold_what_others_have_released(desk: Desk) -> None:
    desk.commands.hold({A: 0.5})
    desk.commands.hold({B: 0.1})
    desk.reported = {A: 0.5, B: 0.1}
    desk.after(0.0)
    desk.reported = {}
    assert desk.after(0.1) == {A: None, B: None}
    desk.sent.clear()
    desk.commands.undo()
    desk.commands.undo()
    desk.commands.redo()
    assert desk.sent == [] and desk.commands.now.held == {}


def test_an_older_report_does_not_undo_what_is_set_or_released_here(desk: Desk) -> None:
    desk.commands.hold({A: 0.5})
    desk.reported = {A: 0.5}
    desk.after(0.0)
    desk.commands.hold({A: 0.6})
    assert desk.after(PATIENCE_S - 0.1) == {A: 0.6, B: None}
    desk.reported = {A: 0.6}
    desk.after(0.1)
    desk.commands.hold({A: None})
    assert desk.after(0.1) == {A: None, B: None}
    assert desk.after(PATIENCE_S) == {A: 0.6, B: None}  # another one holds it


def test_another_head_s_settings_are_not_new_to_the_body(desk: Desk) -> None:
    desk.commands.hold({A: 0.5})
    desk.after(0.0)
    desk.commands.switch_head("maple", "oak", 0.0)
    desk.reported = {A: 0.3}
    assert desk.after(0.1) == {A: 0.3, B: None}
    desk.commands.switch_head("oak", "maple", 0.0)
    desk.reported = {A: 0.8}
    assert desk.after(0.1) == {A: 0.8, B: None} and desk.commands.now.held == {A: 0.8}


def test_without_a_body_the_settings_here_count() -> None:
    commands = Commands(lambda request: None)
    values = HeldValues(commands, None)
    commands.hold({A: 0.5})
    values.update()
    assert values.get(A) == 0.5 and values.get(B) is None
