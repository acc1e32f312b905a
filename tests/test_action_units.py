"""How far action units move their landmarks on the shipped head: no less than people's faces do."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import numpy as np
import pytest

from controller.base.paths import find_config
from surface.head import Head

WEAKER, STRONGER = 0.8, 1.7  # of people's mean; they were asked to move as far as they could


@pytest.fixture
def program(benchmark: Callable[[str], ModuleType]) -> ModuleType:
    return benchmark("action_units")


@pytest.fixture(scope="module")
def head() -> Head:
    return Head.load(find_config("heads", "ict"))


@pytest.mark.slow
def test_no_unit_is_much_weaker_than_in_people_nor_beyond_them(program: ModuleType, head: Head) -> None:
    rows = [(unit, mm) for unit, mm, _ in program.measured(head) if "people" in unit]
    assert {unit["unit"] for unit, _ in rows} >= {"1+2", "4", "12", "27", "29", "30", "45"}
    for unit, mm in rows:
        mean = unit["people"]["mean"]
        assert WEAKER * mean < mm < STRONGER * mean, unit["name"]


def test_every_unit_moves_its_landmark_the_way_it_names(program: ModuleType, head: Head) -> None:
    for unit, mm, share in program.measured(head):
        assert mm > 2.5, unit["name"]
        assert share == pytest.approx(mm / 63.6, rel=0.01)


def test_a_landmark_is_the_foremost_point_at_its_place_and_is_followed(program: ModuleType, head: Head) -> None:
    places = {"chin": {"at": [0.0, -63.2]}, "teeth": {"at": [0.0, -38.0], "part": "teeth_lower"}}
    marks = program.Landmarks(head, places)
    assert np.hypot(*(marks.rest["chin"][:2] - [0.0, -63.2])) < 2.0
    assert marks.rest["chin"][2] > 105.0
    assert marks.moved("chin", {"jawOpen": 1.0})[1] < -25.0
    left, right = marks.moved("chin", {"jawLeft": 1.0}), marks.moved("chin", {"jawRight": 1.0})
    assert left[0] > 5.0 and right[0] < -5.0
    assert np.abs(marks.moved("teeth", {"mouthSmile": 1.0})).max() < 1e-6
