"""controller.panels.session.feed and problems"""

from __future__ import annotations

import numpy as np
import pytest

from controller.base.errors import ConfigError
from controller.body.messages import AskDetails, Details
from controller.panels.session.feed import KEPT_S, PERIOD_S, Feed, History
from controller.panels.session.problems import Problems

SERVO = {"bus": "head", "id": 7, "name": "jawOpen", "wanted_deg": 3.0, "measured_deg": None, "low_deg": 0.0}


class Body:
    """Answers when a test lets it; the clock is the test's."""

    def __init__(self) -> None:
        self.sent: list[object] = []
        self.answer: Details | None = None
        self.now_s, self.problems = 100.0, Problems()
        self.feed = Feed(self.sent.append, lambda: self.answer, self.problems, lambda: self.now_s)

    def frame(self, seconds: float) -> None:
        self.now_s += seconds
        self.feed()


def test_one_question_is_under_way_and_a_lost_one_is_asked_again() -> None:
    body = Body()
    for _ in range(20):
        body.frame(1 / 60)
    assert body.sent == [AskDetails()] and body.feed.waiting
    body.answer = Details(servos=[SERVO])
    body.frame(1 / 60)
    assert len(body.sent) == 2 and body.feed.details is body.answer and not body.feed.waiting
    for _ in range(60):
        body.frame(1 / 60)
    assert len(body.sent) == 2  # no answer came
    body.frame(2.0)
    assert len(body.sent) == 3


def test_the_last_half_minute_is_kept_in_order() -> None:
    body, rows = Body(), round(KEPT_S / PERIOD_S)
    for i in range(rows + 30):
        body.answer = Details(servos=[{**SERVO, "wanted_deg": float(i), "measured_deg": None if i % 2 else i - 0.5}])
        body.frame(PERIOD_S)
    times, values = body.feed.history(SERVO).series()
    assert values.shape == (3, rows) and np.allclose(np.diff(times), PERIOD_S)
    assert values[0].tolist() == [float(i) for i in range(30, rows + 30)]
    assert np.isnan(values[1][1]) and values[1][0] == 29.5 and np.isnan(values[2]).all()


def test_warnings_of_the_body_are_told_once_with_their_count() -> None:
    body = Body()
    for _ in range(3):
        body.answer = Details(notes=["bus head is not back: no port"])
        body.frame(PERIOD_S)
    body.problems.add(ConfigError("a.toml: no such file", hint="look at: ls a.toml"))
    assert [(p.text, p.times) for p in body.problems.unread] == [
        ("bus head is not back: no port", 3),
        ("a.toml: no such file (look at: ls a.toml)", 1),
    ]
    body.problems.dismiss()
    assert len(body.problems.unread) == 1
    for i in range(1000):
        body.problems.add(f"fault {i}")
    assert len(body.problems.unread) == 100 and body.problems.unread[-1].text == "fault 999"
    body.problems.dismiss_all()
    assert body.problems.unread == []


@pytest.mark.parametrize("key", ["wanted_deg", "measured_deg"])
def test_a_servo_of_the_same_name_on_another_bus_is_another(key: str) -> None:
    body = Body()
    body.answer = Details(servos=[{**SERVO, key: 1.0}, {**SERVO, "bus": "neck", key: 2.0}])
    body.frame(PERIOD_S)
    assert len(body.feed.histories) == 2


@pytest.mark.parametrize(
    ("answered", "after_s", "asked"), [(True, 0.199, 1), (True, 0.201, 2), (False, 1.999, 1), (False, 2.001, 2)]
)
def test_it_is_asked_again_after_a_fifth_of_a_second_or_two_without_an_answer(
    answered: bool, after_s: float, asked: int
) -> None:
    body = Body()
    body.frame(0.0)
    if answered:
        body.answer = Details(buses=[{"name": "head"}])
        body.frame(0.0)
        assert not body.feed.waiting
    body.frame(after_s)
    assert len(body.sent) == asked


def test_a_history_of_few_rows_has_no_more() -> None:
    history = History(("a", "b"))
    assert [part.shape for part in history.series()] == [(0,), (2, 0)]
    for k in range(3):
        history.add(10.0 + k, {"a": k, "b": None if k == 1 else 2 * k, "c": 9.0})
    times, values = history.series()
    assert times.tolist() == [10.0, 11.0, 12.0] and values[0].tolist() == [0.0, 1.0, 2.0]
    np.testing.assert_array_equal(values[1], [0.0, np.nan, 4.0])
    assert Feed.COLUMNS == ("wanted_deg", "measured_deg", "temperature_c")


@pytest.mark.parametrize("found", [{"servos": [SERVO]}, {"links": [{}]}, {"buses": [{}]}])
def test_anything_that_is_answered_ends_the_waiting(found: dict[str, list[dict[str, object]]]) -> None:
    body = Body()
    body.frame(0.0)
    assert body.feed.waiting
    body.answer = Details(**found)  # type: ignore[arg-type]
    body.frame(0.0)
    assert not body.feed.waiting
