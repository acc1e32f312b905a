"""``omote calibrate --pairs``: fits the mixes of a robot's channels to recorded pairs and writes them into its file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from controller.base.config import config_error, read_toml
from controller.base.errors import ConfigError
from controller.base.files import replacing
from controller.base.parameters import Floats, Parameters
from controller.base.plain_numbers import plain_number
from controller.robot.pairs.fit import MIN_PAIRS, FittedServo, FittedTerm, fit_servo
from controller.robot.robot import load_robot, robot_parameters
from controller.robot.settings import ChannelSettings, RobotSettings
from surface.base.files import read_file, read_text, reading

PREFIX = "servos:"
"""Prefix of the names of columns with angles; the channel's name follows."""
_MAX_BYTES, _MAX_ROWS = 1 << 26, 100_000
_MAX_DEG = 36_000.0
_MAX_BEYOND = 0.05  # fraction of its range by which a parameter may exceed it; such values are clipped


@dataclass(frozen=True)
class Pairs:
    """Recorded pairs. values : (m, p) faces. deg : (m,) angles of each channel that was recorded."""

    values: Floats
    deg: Mapping[str, Floats]


@dataclass(frozen=True)
class FittedChannel:
    """A channel and its fit; ``why_not`` : empty, or why its channel stays as it is."""

    channel: ChannelSettings
    fit: FittedServo
    why_not: str


def read_pairs(path: Path, robot: RobotSettings, parameters: Parameters) -> Pairs:
    """Read pairs from a CSV file: columns of parameters by name, and ``servos:NAME`` with angles (deg) of channels.

    A column ``time`` is ignored. Raises ConfigError where the file cannot be read, a column is unknown, or a number is
    missing or outside the range of its column.
    """
    with reading(path, ConfigError):
        lines = [line for line in read_text(path, _MAX_BYTES).splitlines() if line.strip()]
    head = [cell.strip() for cell in lines[0].split(",")] if lines else []
    known = {channel.name for channel in robot.channels}
    if faults := list(_column_faults(head, known, parameters)):
        raise _wrong(path, faults)
    pairs = max(len(lines) - 1, 0)
    if not MIN_PAIRS <= pairs <= _MAX_ROWS:
        raise _wrong(path, [f"has {pairs} pairs; it takes {MIN_PAIRS} to {_MAX_ROWS}"])
    table = np.array([_numbers(path, number, line, len(head)) for number, line in enumerate(lines[1:], 2)])
    if faults := list(_number_faults(head, table, parameters)):
        raise _wrong(path, faults)
    values = np.tile(parameters.rest, (len(table), 1))
    for column, name in enumerate(head):
        if (at := parameters.find(name)) is not None:
            values[:, at] = np.clip(table[:, column], parameters.low[at], parameters.high[at])
    angles = {name.removeprefix(PREFIX): table[:, i] for i, name in enumerate(head) if name.startswith(PREFIX)}
    return Pairs(values, angles)


def _column_faults(head: list[str], channels: set[str], parameters: Parameters) -> Iterator[str]:
    counts, first = Counter(head), dict[int, str]()
    for name in head:
        at = parameters.find(name)
        if name.startswith(PREFIX) and name.removeprefix(PREFIX) not in channels:
            yield f"column {name!r}: the robot has no channel of that name"
        elif not name.startswith(PREFIX) and name.lower() != "time" and at is None:
            yield f"column {name!r}: is no parameter, and no {PREFIX}NAME of a channel"
        if counts[name] > 1:
            yield f"column {name!r}: stands there twice"
        elif at is not None and first.setdefault(at, name) != name:
            yield f"column {name!r}: is the same parameter as column {first[at]!r}"
    if not any(name.startswith(PREFIX) for name in head):
        yield f"there is no column {PREFIX}NAME with the angles of a channel (degrees)"


def _wrong(path: Path, faults: list[str]) -> ConfigError:
    return config_error(path, faults, f"omote calibrate ROBOT --pairs {path}")


def _numbers(path: Path, number: int, line: str, count: int) -> list[float]:
    found = [plain_number(cell.strip()) for cell in line.split(",")]
    numbers = [each for each in found if each is not None]
    if len(found) != count or len(numbers) != count:
        raise _wrong(path, [f"row {number}: has {len(numbers)} numbers for {count} columns"])
    return numbers


def _number_faults(head: list[str], table: Floats, parameters: Parameters) -> Iterator[str]:
    """List, for each column with numbers outside the range of its parameter or servo, the first such number."""
    for column, name in enumerate(head):
        low, high, unit = -_MAX_DEG, _MAX_DEG, "degrees"
        if (at := parameters.find(name)) is not None:
            low, high, unit = float(parameters.low[at]), float(parameters.high[at]), "its range"
        elif not name.startswith(PREFIX):
            continue
        spare = _MAX_BEYOND * (high - low)
        beyond = np.flatnonzero((table[:, column] < low - spare) | (table[:, column] > high + spare))
        if len(beyond):
            yield f"row {beyond[0] + 2}: {name} is {table[beyond[0], column]:g}, beyond {low:g} to {high:g}, {unit}"


def fit_channels(robot: RobotSettings, pairs: Pairs) -> list[FittedChannel]:
    """Fit every channel that was recorded, in the robot's order."""
    linked = {name for linkage in robot.linkages for name in linkage.channels}
    found = []
    for channel in robot.channels:
        if channel.name in pairs.deg:
            fit = fit_servo(pairs.values, pairs.deg[channel.name])
            why = "a linkage moves it" if channel.name in linked else fit.why_not
            found.append(FittedChannel(channel, fit, why))
    return found


def write_robot(path: Path, target: Path, fitted: list[FittedChannel], parameters: Parameters) -> Path | None:
    """Write the robot of ``path`` with the fitted channels to ``target``; returns where the old file is kept.

    parameters : without those of the robot's own vocabularies. Nothing is written unless the new file can be read.
    Raises ConfigError, ControllerError.
    """
    table, known = read_toml(path), robot_parameters(load_robot(path, parameters), path, parameters)
    new = {each.channel.name: _keys(each, known) for each in fitted if not each.why_not}
    table["channels"] = [
        {**{k: v for k, v in old.items() if k not in _REPLACED}, **new[old["name"]]} if old["name"] in new else old
        for old in table["channels"]
    ]
    text = "# Mixes fitted to recorded pairs by omote calibrate --pairs.\n" + tomli_w.dumps(table)
    kept = _keep(target) if target.exists() else None
    with replacing(target) as temporary:
        temporary.write_text(text, encoding="utf-8")
        load_robot(temporary, parameters)
        if kept is not None:
            with replacing(kept) as copy:
                copy.write_bytes(read_file(target, _MAX_BYTES))
    return kept


_REPLACED = ("mix", "formula", "anchor", "join", "map", "trim_deg")


def _keep(target: Path) -> Path:
    """The first name for the old file that none has."""
    number = 1
    while (kept := target.with_name(f"{target.stem}.before{number}{target.suffix}")).exists():
        number += 1
    return kept


def _keys(each: FittedChannel, parameters: Parameters) -> dict[str, Any]:
    """Return the keys of a channel for its fit: terms in degrees, and a map that adds the angle at rest."""
    low, high = each.channel.limit_deg
    rest = each.fit.rest_deg
    mix = {parameters.names[term.parameter]: _term(term) for term in each.fit.terms}
    at = [round(low - rest, 4), round(high - rest, 4)]
    return {"mix": mix, "join": "sum", "map": {"at": at, "deg": [low, high]}, "trim_deg": 0.0}


def _term(term: FittedTerm) -> float | dict[str, list[float]]:
    """Return a weight if the term is a straight line through 0, else its curve."""
    if len(term.at) == 2:
        return round(float((term.gives[1] - term.gives[0]) / (term.at[1] - term.at[0])), 4)
    return {"at": np.round(term.at, 5).tolist(), "gives": np.round(term.gives, 4).tolist()}


def report_rows(fitted: list[FittedChannel], parameters: Parameters) -> Iterator[tuple[str, ...]]:
    """Of each channel: name, span, error, error of what was left out, what it follows, and what is to be known."""
    for each in fitted:
        fit, names = each.fit, parameters.names
        follows = ", ".join(names[term.parameter] + ("" if len(term.at) == 2 else " (curve)") for term in fit.terms)
        doubts = "; ".join(f"{names[i]} may as well be {names[j]}" for i, j in fit.alike)
        outside = _outside(each)
        said = f"stays as it is: {each.why_not}" if each.why_not else "; ".join(filter(None, (outside, doubts)))
        yield (each.channel.name, f"{fit.span_deg:.1f}", f"{fit.rms_deg:.2f}", f"{fit.left_out_deg:.2f}", follows, said)


def _outside(each: FittedChannel) -> str:
    low, high = each.channel.limit_deg
    return "" if low <= each.fit.rest_deg <= high else f"rests at {each.fit.rest_deg:.1f}, beyond limit_deg"
