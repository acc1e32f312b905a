"""Problems and jobs as they are drawn on top of every tab."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any

import pytest

from controller.panels.window.notices import draw_jobs, draw_problems
from tests.controller.panels.window.drawn import Drawn


class Problems:
    """Unread problems, the newest last, and what was done with them."""

    def __init__(self, *texts: str, times: int = 1) -> None:
        self.unread = [SimpleNamespace(text=text, times=times) for text in texts]
        self.done: list[str] = []

    def dismiss(self) -> None:
        self.done.append("newest")

    def dismiss_all(self) -> None:
        self.done.append("all")


def shown(problems: Problems, pressed: str = "") -> Drawn:
    drawn: Any = Drawn(pressed)
    draw_problems(drawn, problems)  # type: ignore[arg-type]
    return drawn  # type: ignore[no-any-return]


def test_without_problems_nothing_is_drawn() -> None:
    assert shown(Problems()).calls == []


@pytest.mark.parametrize(("times", "text"), [(1, "lost"), (2, "lost (2 times)")])
def test_the_newest_problem_is_drawn_with_how_often_it_was_and_can_be_read(times: int, text: str) -> None:
    problems = Problems("lost", times=times)
    drawn = shown(problems, "dismiss##problem")
    assert drawn.named("text_wrapped") == [(text,)] and drawn.named("button") == [("dismiss##problem",)]
    assert problems.done == ["newest"]


def test_several_problems_can_be_read_at_once() -> None:
    problems = Problems("old", "older still", "new")
    drawn = shown(problems, "all 3##problem")
    assert drawn.named("text_wrapped") == [("new",)]
    assert drawn.named("button") == [("dismiss##problem",), ("all 3##problem",)] and problems.done == ["all"]
    assert shown(problems).named("button") == drawn.named("button") and problems.done == ["all"]


def test_jobs_under_way_have_a_bar_that_moves_and_can_be_cancelled() -> None:
    jobs = [
        SimpleNamespace(title=t, cancelled=c, since_s=time.monotonic() - 3.0) for t, c in (("a", False), ("b", True))
    ]
    running: Any = SimpleNamespace(running=jobs)
    drawn: Any = Drawn()
    draw_jobs(drawn, running)
    ((share, size, title),) = drawn.named("progress_bar")
    assert title == "a" and size.x == -1 and share == pytest.approx(-1.5, abs=0.2)  # less than 0: it has no known end
    assert [job.cancelled for job in jobs] == [False, True]
    draw_jobs(Drawn("cancel##a"), running)  # type: ignore[arg-type]
    assert [job.cancelled for job in jobs] == [True, True]
    drawn = Drawn()
    draw_jobs(drawn, running)
    assert drawn.calls == []
