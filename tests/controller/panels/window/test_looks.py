"""controller.panels.window.looks: a look is drawn at once where the head stays, and loaded where it is another."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import pytest

from controller.base.parameters import PARAMETERS
from controller.panels.window.looks import Looks, person_names
from controller.stage.stage import load_stage


class Jobs:
    """Keeps what is to be loaded; nothing is."""

    def __init__(self) -> None:
        self.started: list[tuple[str, Any]] = []
        self.dropped: list[str] = []

    def start(self, title: str, work: Any, done: Any, given_up: Any) -> None:
        self.started.append((title, done))

    def drop(self, title: str) -> None:
        self.dropped.append(title)


@pytest.fixture
def desk() -> SimpleNamespace:
    swapped: list[tuple[Any, Any]] = []
    jobs = Jobs()
    looks = Looks(load_stage("demo", PARAMETERS), lambda head, face: swapped.append((head, face)), cast(Any, jobs))
    return SimpleNamespace(looks=looks, jobs=jobs, swapped=swapped)


def test_another_quality_of_the_same_head_is_drawn_without_loading(desk: SimpleNamespace) -> None:
    desk.looks.show(replace(desk.looks.first, quality="fast"))
    ((head, face),) = desk.swapped
    assert head is None and face.quality == "fast" and desk.jobs.started == []


def test_another_person_is_loaded_and_drawn_when_it_is_there(desk: SimpleNamespace) -> None:
    other = next(name for name in person_names() if name != desk.looks.first.person)
    desk.looks.show(replace(desk.looks.first, person=other))
    ((title, done),) = desk.jobs.started
    assert title == f"loading {other}" and desk.swapped == []
    head = object()
    done(head)
    ((shown, face),) = desk.swapped
    assert shown is head and face.person == other
    desk.looks.show(None)
    assert desk.jobs.started[-1][0] == f"loading {desk.looks.first.person}"


def test_the_same_added_points_drop_what_is_being_loaded(desk: SimpleNamespace) -> None:
    desk.looks.show_light(())
    assert len(desk.jobs.dropped) == 1 and desk.jobs.started == []
    light: Any = (object(),)
    desk.looks.show_light(light)
    assert len(desk.jobs.started) == 1 and desk.looks.shown_light == ()
    desk.jobs.started[0][1](object())
    assert desk.looks.shown_light == light and desk.looks.only_light


def test_what_was_overtaken_while_it_was_loaded_is_not_drawn(desk: SimpleNamespace) -> None:
    desk.looks.show_light(cast(Any, (object(),)))
    desk.looks.show_light(cast(Any, (object(), object())))
    desk.jobs.started[0][1](object())
    assert desk.swapped == []
