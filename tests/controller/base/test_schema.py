"""controller.base.schema: options of plug-ins from a command line, held to their limits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import pytest
from pydantic import BaseModel, ValidationError, create_model

from controller.base.errors import ConfigError
from controller.base.schema import bare_type, check_kind, fields_of, from_command_line, parse_with, to_options
from controller.links.kind import LINKS
from drivers.base.options import REQUIRED, option


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options with every limit."""

    side: str = option("Which.", "left", choices=("left", "right"))
    gain: float = option("How much.", 1.0, above=0, at_most=2)
    count: int = option("How many.", REQUIRED, at_least=1)
    name_of_it: str = option("What.", "", longest=3)


def test_good_values_become_an_instance() -> None:
    assert from_command_line(Options, {"count": 2, "side": "right"}) == Options(count=2, side="right")


@pytest.mark.parametrize(
    ("given", "flag"),
    [
        ({"count": 1, "side": "up"}, "--side: "),
        ({"count": 1, "gain": 0.0}, "--gain: "),
        ({"count": 1, "gain": float("nan")}, "--gain: "),
        ({"count": 0}, "--count: "),
        ({}, "--count: "),
        ({"count": 1, "name_of_it": "long"}, "--name-of-it: "),
    ],
)
def test_values_beyond_their_limits_are_told_by_their_flag(given: dict[str, Any], flag: str) -> None:
    with pytest.raises(ConfigError) as caught:
        from_command_line(Options, given)
    assert flag in str(caught.value) and caught.value.hint


@dataclass(frozen=True, kw_only=True)
class Loose:
    """Options that may be left out."""

    script: str | None = option("Which.", None, longest=4)
    speed: float | None = option("How fast.", None, above=0)
    on: bool = option("Whether.", False)


@pytest.mark.parametrize(
    ("kind", "bare"), [(int, int), (int | None, int), (int | str, int | str), (list[int], list[int])]
)
def test_the_type_beside_none(kind: Any, bare: Any) -> None:
    assert bare_type(kind) == bare


def test_options_that_may_be_none_keep_their_limits() -> None:
    assert from_command_line(Loose, {}) == Loose()
    assert from_command_line(Loose, {"script": None, "speed": 2, "on": True}) == Loose(speed=2.0, on=True)
    for given in ({"script": "tours"}, {"speed": 0}, {"speed": float("inf")}, {"on": "perhaps"}):
        with pytest.raises(ConfigError):
            from_command_line(Loose, given)


def test_a_table_gives_back_only_what_it_was_given() -> None:
    make: Any = create_model
    model = make("Table", **fields_of(Options))
    table = model(count=2, gain=2.0)
    assert to_options(table, Options) == Options(count=2, gain=2.0)
    for wrong in ({"count": 2, "gain": 2.01}, {"gain": 1.0}):
        with pytest.raises(ValidationError):
            model(**wrong)


class Part(BaseModel):
    kind: str


class Whole(BaseModel):
    parts: list[Annotated[Part, parse_with(lambda table: Part(kind=table["kind"].upper()))]]


def test_tables_are_parsed_by_their_kind_and_anything_else_by_the_field() -> None:
    assert Whole.model_validate({"parts": [{"kind": "a"}]}).parts[0].kind == "A"
    assert Whole(parts=[Part(kind="b")]).parts[0].kind == "b"
    with pytest.raises(ValidationError):
        Whole.model_validate({"parts": [3]})


def test_an_unknown_kind_lists_those_there_are() -> None:
    assert check_kind(LINKS, "line") == "line"
    with pytest.raises(ValueError, match=r"lin.*\(.*line.*\)"):
        check_kind(LINKS, "lin")
