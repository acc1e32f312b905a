"""The tables of a stage's heads: what each takes from the stage, where it stands, and which names it may have."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from controller.stage.heads import HeadSettings, head_faults, own_settings
from controller.stage.stage import StageSettings


def stage(**given: Any) -> dict[str, Any]:
    return dict(StageSettings.model_validate({"name": "s", **given}))


@pytest.mark.parametrize("name", ["a", "Maple-2_b", "x" * 32])
def test_names_are_words(name: str) -> None:
    assert HeadSettings(name=name).name == name


@pytest.mark.parametrize("name", ["", "2b", "a b", "x" * 33, "ä", "a.b", "ALL", "all"])
def test_other_names_are_refused(name: str) -> None:
    with pytest.raises(ValidationError, match=r"a name begins with a letter|@all means every head"):
        HeadSettings(name=name)


def test_heads_stand_in_a_row_from_the_viewers_left_or_where_they_say() -> None:
    row = [HeadSettings(name="a").placement(index, 3) for index in range(3)]
    assert [place.position_mm for place in row] == [(-450.0, 0, 0), (0.0, 0, 0), (450.0, 0, 0)]
    assert [place.yaw_deg for place in row] == [0.0, 0.0, 0.0]
    assert [HeadSettings(name="a").placement(i, 2).position_mm[0] for i in (0, 1)] == [-225.0, 225.0]
    own = HeadSettings(name="a", position_mm=(0.0, 20.0, -30.0), yaw_deg=90.0).placement(1, 3)
    assert own.position_mm == (0.0, 20.0, -30.0) and own.yaw_deg == 90.0


def test_what_stands_at_the_top_of_a_stage_is_its_first_heads() -> None:
    top = stage(seed=5, robots=["one"], show="tour", take="a.csv", voice="a.wav", liveliness=0.5)
    first = own_settings(top, HeadSettings(name="a", robots=["two"]), 0)
    second = own_settings(top, HeadSettings(name="b", robots=["two"], show="own"), 1)
    assert (first["robots"], second["robots"]) == (["one", "two"], ["two"])
    assert [first[key] for key in ("show", "take", "voice")] == ["tour", "a.csv", "a.wav"]
    assert [second[key] for key in ("show", "take", "voice")] == ["own", None, None]
    assert (first["seed"], second["seed"]) == (5, 6) and first["heads"] == [] and first["zenoh"] is None
    assert "liveliness" not in second  # the stage's own


def test_a_head_changes_what_it_names() -> None:
    given = {
        "head": "other",
        "identity": {"wide": 0.5},
        "liveliness": 0.25,
        "life": "calm",
        "manner": "speak",
        "seed": 9,
    }
    found = own_settings(stage(seed=5), HeadSettings(name="a", **given), 1)
    assert {key: found[key] for key in given} == given
    assert own_settings(stage(seed=5), HeadSettings(name="a", liveliness=0.0), 0)["liveliness"] == 0.0
    assert "face" not in found
    top = stage()
    worn = own_settings(top, HeadSettings(name="a", person="maple"), 0)["face"]
    assert worn.person == "maple" and worn == top["face"].model_copy(update={"person": "maple"})


def test_layers_are_joined_key_by_key() -> None:
    top = stage() | {"layers": {"capture": {"priority": 5, "weight": 0.5}, "life": {"weight": 1.0}}}
    head = HeadSettings(name="a", layers={"capture": {"weight": 0.25}, "extra": {"priority": 1}})
    assert own_settings(top, head, 0)["layers"] == {
        "capture": {"priority": 5, "weight": 0.25}, "life": {"weight": 1.0}, "extra": {"priority": 1}
    }  # fmt: skip


def test_names_that_are_taken_and_groups_that_name_nobody() -> None:
    heads = [HeadSettings(name=name) for name in ("maple", "pine", "Maple")]
    assert head_faults(heads, {"trees": ["maple", "PINE"]}) == ["heads[2].name: 'Maple' is the name of heads[0]"]
    assert head_faults(heads[:2], {"two": ["mapel", "oak"]}) == [
        "groups.two: no head called 'mapel', did you mean 'maple'?", "groups.two: no head called 'oak'"
    ]  # fmt: skip
    for group in ("Pine", "all", "two words", ""):
        (fault,) = head_faults(heads[:2], {group: ["pine"]})
        assert fault.startswith(f"groups.{group}: choose another name")
