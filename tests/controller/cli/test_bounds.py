"""Numbers that options take: their bounds and defaults, as --help and the docs of the commands tell them."""

from __future__ import annotations

import inspect
import typing
from collections.abc import Callable, Iterator
from typing import Any

from typer import Typer

from controller.cli.app import make_app

NONE = inspect.Parameter.empty
BOUNDS: list[tuple[str, str, float | None, float | None, Any]] = [
    ("demo", "seconds", 0.1, 1e8, None),
    ("run", "seconds", 0.1, 1e8, None),
    ("run", "voice_hz", 1000, None, None),
    ("edit", "seconds", 0.1, 1e8, None),
    ("play", "seconds", 0.1, 1e8, None),
    ("play", "voice_hz", 1000, None, None),
    ("convert", "rate_hz", 1, 1000, None),
    ("render", "crowd", 1, 1024, None),
    ("render", "rate_hz", 1, 240, None),
    ("export", "rate_hz", 1, 1000, None),
    ("scan", "protocol", 1, 2, None),
    ("set-id", "old", 0, 252, NONE),
    ("set-id", "new", 0, 252, NONE),
    ("set-id", "baud", None, None, 1_000_000),
    ("set-id", "protocol", 1, 2, None),
    ("monitor", "baud", None, None, 1_000_000),
    ("monitor", "protocol", 1, 2, None),
    ("monitor", "rate", 0.1, 200, 10.0),
    ("monitor", "seconds", 0.1, None, None),
    ("calibrate", "margin", 0, 20, 1.0),
    ("calibrate", "torque", 0.01, 0.5, 0.15),
    ("preflight", "amplitude_deg", 1, 15, 3.0),
    ("preflight", "load", 0.05, 0.9, 0.4),
    ("bench", "seconds", 0.01, None, 0.3),
    ("bench", "vertices", 1_000, None, 100_000),
    ("bench", "level", 0, 9, 7),
    ("bench", "updates", 1, None, 1_000_000),
    ("bench", "heads", 1, 10_000, 64),
    ("bench", "baud", 300, None, 1_000_000),
    ("bench", "buses", 0, 16, 0),
    ("bench", "servos", 1, 64, 12),
    ("translate", "seconds", 0.1, None, None),
    ("translate", "baud", 300, None, 115_200),
    ("webcam", "camera", 0, None, 0),
    ("webcam", "seconds", 0.1, None, None),
    ("study", "seed", 0, None, None),
]


def callbacks(app: Typer) -> Iterator[tuple[str, Callable[..., Any]]]:
    """Every command by its name, groups of commands by their own."""
    for each in app.registered_commands:
        assert each.callback is not None
        yield each.name or each.callback.__name__.replace("_", "-"), each.callback
    for group in app.registered_groups:
        if group.typer_instance is not None:
            yield from callbacks(group.typer_instance)


def numbers(callback: Callable[..., Any]) -> Iterator[tuple[str, float | None, float | None, Any]]:
    """Options of a command that have bounds or a number as default: name, bounds and default."""
    hints = typing.get_type_hints(callback, include_extras=True)
    for given in inspect.signature(callback).parameters.values():
        options = [each for each in getattr(hints.get(given.name), "__metadata__", ()) if hasattr(each, "min")]
        low, high = (options[0].min, options[0].max) if options else (None, None)
        is_number = isinstance(given.default, int | float) and not isinstance(given.default, bool)
        if low is not None or high is not None or is_number:
            yield given.name, low, high, given.default


def test_options_have_the_bounds_and_defaults_that_are_told() -> None:
    found = [(name, *each) for name, callback in callbacks(make_app()) for each in numbers(callback)]
    assert [each for each in BOUNDS if each not in found] == []
