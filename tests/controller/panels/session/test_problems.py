"""Problems of the panel: each once, counted, oldest first, until it was read."""

from __future__ import annotations

import pytest

from controller.base.errors import ConfigError
from controller.panels.session.problems import Problem, Problems


def test_each_message_is_kept_once_and_counted() -> None:
    problems = Problems()
    for what in ("one", "two", "one", "one"):
        problems.add(what)
    assert problems.unread == [Problem("one", 3), Problem("two", 1)]


def test_an_error_is_shown_with_its_next_step() -> None:
    problems = Problems()
    problems.add(ConfigError("no head 'icy'", hint="see configs/heads"))
    problems.add(ValueError("out of range"))
    first, second = (problem.text for problem in problems.unread)
    assert "no head 'icy'" in first and "see configs/heads" in first and "out of range" in second


def test_the_newest_is_read_first() -> None:
    problems = Problems()
    problems.dismiss()
    problems.add("one")
    problems.add("two")
    problems.dismiss()
    assert problems.unread == [Problem("one")]
    problems.add("two")
    assert problems.unread == [Problem("one"), Problem("two", 1)]  # it is new again
    problems.dismiss_all()
    assert problems.unread == []


def test_only_the_newest_hundred_are_kept() -> None:
    problems = Problems()
    for number in range(103):
        problems.add(f"{number}")
    assert [problem.text for problem in problems.unread] == [f"{number}" for number in range(3, 103)]


def test_where_no_panel_shows_them_problems_are_logged_once(caplog: pytest.LogCaptureFixture) -> None:
    problems = Problems()
    problems.add(ConfigError("no head 'icy'", hint="see configs/heads"))
    problems.log_all()
    problems.log_all()
    (record,) = caplog.records
    assert record.levelname == "ERROR" and "see configs/heads" in record.getMessage()
