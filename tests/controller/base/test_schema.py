"""controller.base.schema: options of plug-ins from a command line, held to their limits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest

from controller.base.errors import ConfigError
from controller.base.schema import from_command_line
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
