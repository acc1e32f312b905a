"""controller.fleet.rejoining and silence: when a session is opened again, by the time and by who answers."""

from __future__ import annotations

import logging
from types import SimpleNamespace

import pytest

from controller.fleet.offset import Clocks
from controller.fleet.rejoining import Rejoining
from controller.fleet.silence import Silence


def acts_at(silence: Silence, end_s: float) -> list[float]:
    """When it is due, asked ten times a second."""
    return [k / 10 for k in range(round(10 * end_s)) if silence.due(k / 10)]


def test_pauses_double_up_to_the_longest_and_begin_anew_when_something_came() -> None:
    silence = Silence(1.0, 3.0, 0.0)
    assert acts_at(silence, 12.0) == [1.0, 2.0, 4.0, 7.0, 10.0] and silence.acts == 5
    silence.hear(20.0)
    assert not silence.due(20.9) and silence.due(21.0) and silence.acts == 1


class Head:
    """A head that hears faces when told so; answers come ten times a second while ``answers``. opened : when (s)."""

    def __init__(self) -> None:
        self.clocks, self.heard_s, self.now_s, self.opened = Clocks(), 0.0, 0.0, list[float]()
        hearing = SimpleNamespace(silent=lambda: ("d", self.heard_s))
        wire = SimpleNamespace(move=self.opened.append)
        self.rejoining = Rejoining(wire, hearing, self.clocks, lambda: self.now_s, 0.0)  # type: ignore[arg-type, return-value]

    def run(self, seconds: float, *, answers: bool, hears: bool = False) -> list[float]:
        """Sessions opened in this time, in seconds from its begin."""
        begin_s = self.now_s
        self.opened.clear()
        for k in range(1, round(20 * seconds) + 1):
            self.now_s = begin_s + k / 20
            if hears:
                self.heard_s = self.now_s
            if answers and k % 2 == 0:
                now_ns = round(self.now_s * 1e9)
                self.clocks.add(5, now_ns, now_ns, now_ns, now_ns)
            self.rejoining.check(self.now_s)
        return [round(at - begin_s, 2) for at in self.opened]


def test_a_head_that_hears_no_face_although_a_conductor_answers_is_connected_anew(
    caplog: pytest.LogCaptureFixture,
) -> None:
    head = Head()
    with caplog.at_level(logging.WARNING):
        assert head.run(5.0, answers=True, hears=True) == []
        first, second, *_ = head.run(5.0, answers=True)
    assert first < 1.0 and second < 2.0
    assert caplog.text.count("no face of head d arrives") == 1
    assert head.run(5.0, answers=True, hears=True) == []


def test_a_head_without_a_conductor_keeps_its_session() -> None:
    head = Head()
    assert head.run(2.0, answers=True, hears=True) == []
    assert head.run(60.0, answers=False) == []


def test_a_head_that_asks_more_often_while_it_is_silent() -> None:
    head = Head()
    head.heard_s = 10.0
    assert not head.rejoining.silent(10.3) and head.rejoining.silent(10.5)


def test_a_conductor_that_has_nothing_for_a_head_is_not_asked_all_the_time() -> None:
    assert len(Head().run(300.0, answers=True)) < 20
