"""controller.panels.session.feed and problems"""

from __future__ import annotations

import numpy as np
import pytest

from controller.base.errors import ConfigError
from controller.body.messages import AskDetails, Details
from controller.panels.session.feed import KEPT_S, PERIOD_S, Feed
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
