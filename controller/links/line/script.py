"""Scripts: lines of the line protocol and when they are said, by a simulated robot host or in a show."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from controller.base.parameters import Floats, Parameters, did_you_mean, file_error, read_toml
from controller.links.line.commands import Grammar
from controller.links.line.protocol import LineError
from controller.vocabulary.vocabulary import Vocabulary

_KEYS = ("name", "description", "loop_s", "frames_hz", "marks", "steps")
_MAX_FRAMES_HZ = 200.0


@dataclass(frozen=True)
class Script:
    """What a robot host sends, or a show plays.

    Attributes
    ----------
    steps : (time s, line) in rising time.
    loop_s : after how long it begins again; 0 plays it once.
    frames_hz : how often every parameter is sent besides, 0 for never.
    marks : names of moments (s).
    """

    steps: tuple[tuple[float, str], ...]
    loop_s: float = 0.0
    frames_hz: float = 0.0
    name: str = ""
    marks: dict[str, float] = field(default_factory=dict)

    @classmethod
    def load(cls, path: Path, parameters: Parameters, vocabulary: Vocabulary) -> Script:
        """Read a script and check every line of it.

        Raises
        ------
        ConfigError : the file cannot be read or is wrong; every fault with its key.
        """
        table = read_toml(path)
        faults = [f"{key}: unknown key{did_you_mean(key, _KEYS)}" for key in table if key not in _KEYS]
        grammar = Grammar(parameters, lambda name: vocabulary[name].name)
        steps = _steps(table.get("steps", []), grammar, faults)
        loop_s = _number(table, "loop_s", 86_400.0, faults)
        frames_hz = _number(table, "frames_hz", _MAX_FRAMES_HZ, faults)
        marks = _marks(table.get("marks", {}), faults)
        if loop_s and steps and steps[-1][0] > loop_s:
            faults.append(f"loop_s: {loop_s:g} is before the last step at {steps[-1][0]:g}")
        if faults:
            raise file_error(path, faults)
        return cls(tuple(steps), loop_s, frames_hz, str(table.get("name", path.stem)), marks)


def _steps(given: Any, grammar: Grammar, faults: list[str]) -> list[tuple[float, str]]:
    if not isinstance(given, list):
        faults.append('steps: must be a list of strings like "1.5 EXPR smile"')
        return []
    steps: list[tuple[float, str]] = []
    for i, text in enumerate(given):
        try:
            steps.append(_step(text, grammar, steps[-1][0] if steps else 0.0))
        except (LineError, ValueError) as error:
            faults.append(f"steps[{i}]: {error} (is {text!r})")
    return steps


def _step(text: Any, grammar: Grammar, earliest_s: float) -> tuple[float, str]:
    time_text, _, line = str(text).strip().partition(" ")
    try:
        at_s = float(time_text)
    except ValueError:
        raise ValueError("begins with a time in seconds, then the line") from None
    if not earliest_s <= at_s < math.inf:
        raise ValueError(f"times must rise from 0; this one is before {earliest_s:g}")
    if grammar.parse(line.encode("utf-8")) is None:
        raise ValueError("no command after the time")
    return at_s, line.strip()


def _marks(given: Any, faults: list[str]) -> dict[str, float]:
    if not isinstance(given, dict):
        faults.append("marks: must be a table of times, like { chorus = 12.5 }")
        return {}
    marks = {}
    for name in given:
        inner: list[str] = []
        marks[name] = _number(given, name, 86_400.0, inner)
        faults += [f"marks.{fault}" for fault in inner]
    return marks


def _number(table: dict[str, Any], key: str, most: float, faults: list[str]) -> float:
    value = table.get(key, 0.0)
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value <= most:
        faults.append(f"{key}: must be a number from 0 to {most:g} (is {value!r})")
        return 0.0
    return float(value)


class Wave:
    """Every parameter in motion, each at its own pace, for measuring under load.

    Parameters
    ----------
    parameters : gives number and ranges.
    """

    def __init__(self, parameters: Parameters) -> None:
        index = np.arange(len(parameters))
        self._rate = 2 * math.pi * (0.25 + 0.5 * np.modf(index * 0.6180339887)[0])
        self._phase = 2 * math.pi * np.modf(index * 0.7548776662)[0]
        self._middle = np.where(parameters.low < 0, 0.0, 0.25)
        self._swing = np.where(parameters.low < 0, 0.4, 0.25)

    def at(self, time_s: float) -> Floats:
        """(P,) values at a time; none rests between two calls at different times."""
        values: Floats = self._middle - self._swing * np.cos(self._rate * time_s + self._phase)
        return values
