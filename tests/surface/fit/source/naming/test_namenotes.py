"""What is said of the shapes of a mesh."""

import pytest

from surface.fit.source.names import NameMap, Source
from surface.fit.source.naming.namenotes import MAX_LISTED, listed, name_notes

NAMES = ("jawOpen", "Joy", "A", "blank", "smile2", "odd")


def noted(sources=None, other=None, **found) -> list[str]:
    return name_notes(
        NAMES, NameMap(sources or {"jawOpen": [Source(0)]}, (), found.pop("left_out", ()), **found), other
    )


def test_nothing_is_said_where_every_shape_has_its_own_name() -> None:
    assert noted() == []


def test_shapes_of_every_sort_are_counted() -> None:
    notes = noted(presets=("A", "Joy"), spare=("smile2",), empty=("blank",), left_out=("odd",))
    assert notes == [
        "6 shapes: 1 make 1 parameters, 2 presets and visemes, 1 doubled, 1 empty, 1 not understood",
        "understood, and made from parameters: A, Joy", "not taken, another shape means the same: smile2",
        "empty, they move nothing: blank",
    ]  # fmt: skip
    assert noted(left_out=("odd",)) == ["6 shapes: 1 make 1 parameters, 1 not understood"]
    two = {"jawOpen": [Source(0), Source(2)], "mouthSmileLeft": [Source(0)]}
    assert noted(two, spare=("smile2",))[0] == "6 shapes: 2 make 2 parameters, 1 doubled"


def stand_in(sources, mouth=(1,), eyes=(2,), other=None, which=None) -> list[str]:
    return noted(sources, other, stand_ins=tuple(sources) if which is None else which, mouth=mouth, eyes=eyes)[1:]


def test_what_a_parameter_is_made_from_is_said_with_its_region_and_what_is_taken_away() -> None:
    assert stand_in({"jawOpen": [Source(1)]}) == ["jawOpen is made from 'Joy'"]
    made = {"jawOpen": [Source(1, "", "mouth", 2), Source(2, "", "eyes")]}
    assert stand_in(made) == [
        "jawOpen is made from 'Joy' about the mouth, less its share of 'A' and 'A' about the eyes"
    ]
    for known in ({"mouth": ()}, {"eyes": ()}):
        assert "about" not in stand_in({"jawOpen": [Source(1, "", "mouth")]}, **known)[0]
    assert stand_in({"jawOpen": [Source(1, less=0)]}) == ["jawOpen is made from 'Joy', less its share of 'jawOpen'"]


def test_both_halves_of_a_shape_are_told_in_one_note() -> None:
    both = {"mouthSmileLeft": [Source(1, "Left")], "mouthSmileRight": [Source(1, "Right")]}
    assert stand_in(both) == ["mouthSmileLeft and Right are made from the halves of 'Joy'"]
    apart = {"mouthSmileLeft": [Source(1)], "mouthSmileRight": [Source(2)]}
    assert stand_in(apart) == ["mouthSmileLeft is made from 'Joy'", "mouthSmileRight is made from 'A'"]
    alone = {"mouthSmileRight": [Source(1, "Right")]}
    assert stand_in(alone) == ["mouthSmileRight is made from the right half of 'Joy'"]
    own = {"mouthSmileLeft": [Source(1)], "mouthSmileRight": [Source(1, "Right")]}
    assert len(stand_in(own, which=("mouthSmileRight",))) == 1  # the left one has a shape of its own
    gaze = {"eyeLookOutLeft": [Source(1, "Left")]}
    assert stand_in(gaze) == ["eyeLookOutLeft is made from the left half of 'Joy'"]


def test_shapes_are_called_as_the_file_calls_them_elsewhere() -> None:
    assert stand_in({"jawOpen": [Source(1)]}, other={1: ["Joy", "happy"]}) == ["jawOpen is made from 'happy' (Joy)"]
    assert stand_in({"jawOpen": [Source(1)]}, other={2: ["x"], 1: ["Joy"]}) == ["jawOpen is made from 'Joy'"]


@pytest.mark.parametrize("count", [1, MAX_LISTED, MAX_LISTED + 1, MAX_LISTED + 5])
def test_of_very_many_names_the_first_ones_are_listed(count: int) -> None:
    every = tuple(f"n{k}" for k in range(count))
    more = f" and {count - MAX_LISTED} more" if count > MAX_LISTED else ""
    assert listed(every) == ", ".join(every[:MAX_LISTED]) + more
