"""drivers.base.options: ids in words, and options that files and commands can be made to read."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import pytest

from drivers.base.errors import DriverError
from drivers.base.options import REQUIRED, check_options, entries, option, parse_ids


def test_ids_are_numbers_and_ranges() -> None:
    assert parse_ids("1-3, 7") == [1, 2, 3, 7]
    assert parse_ids("0") == [0]
    assert parse_ids("252,5-5") == [252, 5]


@pytest.mark.parametrize(
    "text",
    [
        "",
        "x",
        "1-x",
        "-1",
        "1-",
        "1,,2",
        "²",
        "1-253",
        "999999999",
        "1,1",
        "2-1",
        "1,5-3",
        "1.5",
        "9" * 5000,
        "0-" + "9" * 5000,
    ],
)
def test_what_is_no_list_of_ids_is_told(text: str) -> None:
    with pytest.raises(DriverError, match="--ids") as caught:
        parse_ids(text)
    assert "--ids 1-24" in caught.value.hint


@dataclass(frozen=True, kw_only=True)
class Good:
    """Options of every kind."""

    one: int = option("One.", REQUIRED, at_least=1)
    many: list[str] = field(default_factory=lambda: ["a"])
    some: float | None = option("Some.")
    plain: bool = True


def test_options_say_their_types_defaults_and_limits() -> None:
    check_options(Good)
    found = {entry.name: entry for entry in entries(Good)}
    assert [*found] == ["one", "many", "some", "plain"]
    assert found["one"].default is REQUIRED and found["one"].option.at_least == 1
    assert found["many"].default == ["a"] and found["some"].default is None and found["plain"].default is True


@dataclass
class Strange:
    """A type that no file can hold."""

    value: dict[str, int] = field(default_factory=dict)


@dataclass
class Unknown:
    """A type that is nowhere."""

    value: Nowhere = None  # type: ignore[name-defined]  # noqa: F821


@dataclass
class Model:
    """A name that pydantic keeps for itself."""

    model_config: int = 3


class Plain:
    """No dataclass."""


@pytest.mark.parametrize(
    ("options", "reserved", "message"),
    [
        (Strange, (), "Strange.value: its type must be"),
        (Unknown, (), "Nowhere"),
        (Model, (), "Model.model_config: the name is taken"),
        (Good, ("plain",), "Good.plain: the name is taken"),
        (Plain, (), "must be a dataclass"),
        (None, (), "must be a dataclass"),
    ],
)
def test_options_that_cannot_be_read_are_told(options: Any, reserved: tuple[str, ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        check_options(options, reserved)


def test_a_range_that_runs_backwards_is_named() -> None:
    with pytest.raises(DriverError, match="'5-3' runs backwards"):
        parse_ids("1,5-3")
    assert parse_ids("0" * 5000 + "7") == [7]
